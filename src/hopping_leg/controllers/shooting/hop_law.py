"""A hop in a few numbers: the law that shooting plans with, and its simulation to the next apex.

On the ground the foot stays below the hip while the leg presses it down with one force until it
stops to shorten and with another until the hip has a certain height; in the air a joint PD holds
the foot below the hip. The numbers of a hop are (landing force, push-off force, height of the hip
at lift-off less the foot's radius, length from hip to foot in flight), N and m; forces are those of
the leg on the ground.
"""

import math

import numpy as np

from hopping_leg.arrays import Array, Record, Records
from hopping_leg.sim.compiled import compiled, inlined
from hopping_leg.sim.leg_physics import ROWS
from hopping_leg.sim.stepper import COMMAND, send, step_leg

NUMBERS = 4
"""Numbers of a hop."""

FLIGHT, LANDING, PUSH = 0, 1, 2
"""Phases: in the air, on the ground before and after the leg stops to shorten."""

LIFTED = 0.01
"""Gap between foot and ground with which a leg is in the air, whatever its length, m."""

STRETCHED = 0.97
"""Share of the stretched length at which a push ends in any case."""

SETTINGS = (
    "taper", "sideways_stiffness", "sideways_damping", "hip_stiffness", "hip_damping",
    "knee_stiffness", "knee_damping", "slew",
)  # fmt: skip
"""What is the same in all hops: length over which the push fades, m, stiffness, N/m, and damping,
N s/m, of the foot below the hip, joint PD in flight, N m/rad and N m s/rad, and by how much a
torque may change in a control period, N m."""


@inlined
def next_phase(p: Record, state: Array, hop: Array, phase: int) -> int:
    """Return the phase of the hop in a state."""
    s1, c1 = math.sin(state[1]), math.cos(state[1])
    s12, c12 = math.sin(state[1] + state[2]), math.cos(state[1] + state[2])
    down = p.thigh_length * c1 + p.shank_length * c12
    rate = -p.thigh_length * s1 * state[4] - p.shank_length * s12 * (state[4] + state[5])
    gap = state[0] - down - p.foot_radius
    if phase == FLIGHT:
        return LANDING if gap <= 0 and state[3] < 0 else FLIGHT
    stretched = down >= STRETCHED * (p.thigh_length + p.shank_length)
    if gap > LIFTED or (phase == PUSH and (state[0] - p.foot_radius >= hop[2] or stretched)):
        return FLIGHT
    if phase == LANDING and rate > 0:
        return PUSH
    return phase


@inlined
def law(p: Record, settings: Array, state: Array, hop: Array, phase: int, torque: Array) -> None:
    """Change ``torque`` (2,), that of the period before, to what a phase of the hop asks for."""
    s1, c1 = math.sin(state[1]), math.cos(state[1])
    s12, c12 = math.sin(state[1] + state[2]), math.cos(state[1] + state[2])
    if phase == FLIGHT:
        # Inverse kinematics of the foot below the hip, knee behind.
        l1, l2, length = p.thigh_length, p.shank_length, hop[3]
        knee = -math.acos(
            min(max((length * length - l1 * l1 - l2 * l2) / (2 * l1 * l2), -1.0), 1.0)
        )
        hip = -math.atan2(l2 * math.sin(knee), l1 + l2 * math.cos(knee))
        hip_torque = settings[3] * (hip - state[1]) - settings[4] * state[4]
        knee_torque = settings[5] * (knee - state[2]) - settings[6] * state[5]
    else:
        forward = p.thigh_length * s1 + p.shank_length * s12
        down = p.thigh_length * c1 + p.shank_length * c12
        w12 = state[4] + state[5]
        forward_rate = p.thigh_length * c1 * state[4] + p.shank_length * c12 * w12
        force = hop[0]
        if phase == PUSH:
            force = hop[1] * min(max((hop[2] + p.foot_radius - state[0]) / settings[0], 0.0), 1.0)
        sideways = -settings[1] * forward - settings[2] * forward_rate
        hip_torque = -force * forward + sideways * down
        knee_torque = -force * p.shank_length * s12 + sideways * p.shank_length * c12
    for joint in range(2):
        wanted = hip_torque if joint == 0 else knee_torque
        limit = p.torque_limit[joint]
        wanted = min(max(wanted, -limit), limit)
        torque[joint] = min(max(wanted, torque[joint] - settings[7]), torque[joint] + settings[7])


@inlined
def apex_of(
    p: Record, settings: Array, state: Array, memory: Record, past: Array, rows: Array,
    hop: Array, phase: int, torque: Array, command: Array, steps: int, dt: float, ticks: int,
) -> float:  # fmt: skip
    """Return the height of the next apex after a lift-off, NaN if none comes; all but p changes."""
    pushed = phase != FLIGHT
    for _ in range(ticks):
        phase = next_phase(p, state, hop, phase)
        if phase != FLIGHT:
            pushed = True
        law(p, settings, state, hop, phase, torque)
        command[0], command[1] = torque[0], torque[1]
        send(memory, command, 0.0)
        height, rate = state[0], state[3]
        step_leg(p, state, memory, past, rows, 0.0, steps, dt)
        if pushed and phase == FLIGHT and rate > 0 and state[3] <= 0:
            # Between two ticks the base moves on a parabola.
            period = steps * dt
            return height + rate * rate * period / (2 * max(rate - state[3], 1e-9))
    return np.nan


@compiled
def plan(
    table: Records, settings: Array, state: Array, acceleration: Array, motor: Array,
    phases: Array, commands: Array, hops: Array, torques: Array, limits: Array, scratch: Records,
    first: int, last: int, tries: int, steps: int, dt: float, ticks: int,
) -> None:  # fmt: skip
    """Find the push-off force of legs that push, by regula falsi on the height of the next apex.

    Args:
        table: Rows of the planning model.
        settings: See ``SETTINGS``.
        state: True states, (n, 6).
        acceleration: Present accelerations, where the solver begins, (n, 3).
        motor: What the motors give, N m, (n, 2).
        phases: Phase of each leg, (n,).
        commands: Apex heights, m, (n,).
        hops: Numbers of the hops, (n, 4); the second is renewed.
        torques: Torques of the period before, (n, 2).
        limits: Least and greatest force, N, (2,).
        scratch: One record of memory per thread; the one of number ``first`` is used.
        first: First leg.
        last: Leg before which to stop.
        tries: Simulations at most.
        steps: Physics steps per control period.
        dt: Physics step, s.
        ticks: Control periods at most.
    """
    rows, past = np.empty((ROWS, 5)), np.empty((0, 6))
    command, here, torque = np.zeros(COMMAND), np.empty(6), np.empty(2)
    memory = scratch[first]
    for k in range(first, last):
        if phases[k] != PUSH:
            continue
        low, high, low_error, high_error = limits[0], limits[1], np.nan, np.nan
        force = hops[k, 1]
        best, best_error = force, np.inf
        p = table[k]
        way = hops[k, 2] + p.foot_radius - state[k, 0]
        step = p.mass * p.gravity / max(way, 0.01) / 2
        for _ in range(tries):
            hops[k, 1] = force
            for i in range(6):
                here[i] = state[k, i]
            for i in range(2):
                torque[i] = torques[k, i]
                memory.motor_torque[i] = motor[k, i]
            for i in range(3):
                memory.acceleration[i] = acceleration[k, i]
            memory.waiting = 0
            apex = apex_of(
                p, settings, here, memory, past, rows, hops[k], PUSH, torque, command,
                steps, dt, ticks,
            )  # fmt: skip
            error = apex - commands[k] if apex == apex else -1.0
            if abs(error) < best_error:
                best, best_error = force, abs(error)
            if best_error < 2e-5:
                break
            if error > 0:
                high, high_error = force, error
            else:
                low, low_error = force, error
            if high_error == high_error and low_error == low_error:
                share = low_error / (low_error - high_error)
                force = low + min(max(share, 0.1), 0.9) * (high - low)
            else:
                # The work of the push over the rest of the leg's way lifts the weight.
                step *= 2
                force = min(max(force - step * error, limits[0]), limits[1])
            if force == best and (force == limits[0] or force == limits[1]):
                break
        hops[k, 1] = best


@compiled
def set_phases(table: Records, state: Array, phases: Array, hops: Array) -> None:
    """Set all legs' phases, (n,), in their states, (n, 6)."""
    for k in range(len(state)):
        phases[k] = next_phase(table[k], state[k], hops[k], int(phases[k]))


@compiled
def set_torques(
    table: Records, settings: Array, state: Array, phases: Array, hops: Array, torques: Array
) -> None:
    """Set all legs' torques, N m, (n, 2), from those of the period before."""
    for k in range(len(state)):
        law(table[k], settings, state[k], hops[k], int(phases[k]), torques[k])
