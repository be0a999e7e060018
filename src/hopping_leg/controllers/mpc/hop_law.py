"""A hop in a few numbers: the law that MPC plans with, and its simulation to the next apex.

In the air a joint PD holds the foot below the hip. On the ground the foot stays below the hip while
the leg presses it down: first so that the hip stops at a certain height, then with one force until
the hip has the height of lift-off, where it has faded. A push of large force leans: the foot also
pushes forward, which only the rail bears, so that the hip's motor stretches the leg with the
knee's. Numbers are those of any leg: lengths are shares of the stretched leg's length L, forces of
the weight W, times of sqrt(L / g).
"""

import math

import numpy as np

from hopping_leg.arrays import Array, IntArray, Record, Records
from hopping_leg.sim.compiled import compiled, inlined
from hopping_leg.sim.stepper import COMMAND, SCRATCH, send, step_leg

FLIGHT, LANDING, PUSH = 0, 1, 2
"""Phases: in the air, on the ground before and after the leg stops to shorten."""

HOP = np.dtype(
    [(name, np.float64) for name in ("flight", "squat", "liftoff", "stop", "push", "unplanned")]
)
"""Numbers of one hop: length from hip to foot in flight, heights of the hip above the foot's centre
at which landing ends and at which the push ends, all m, deceleration from which on the leg brakes,
m/s2, push-off force, N, control periods of the push since that was planned."""

LIFTED = 0.01  # Gap between foot and ground with which a leg is in the air, whatever its length, m
REST_SPEED = 0.1  # Speed of the hip on landing that counts as rest, m/s

_STRETCHED = 0.97  # share of the stretched length at which a push ends in any case
_FALL = 0.3  # force over the weight with which a leg sinks until it has to brake
_SINKS = 0.6  # share of the weight that is left to a leg that stands, at least, for it to sink
_LEAST_STROKE = 0.08  # of a landing, over the stretched length
_LEAST_PUSH, _MOST_PUSH = 0.2, 14.0  # push-off force over the weight
_REST = 0.02  # speed of the hip below which a landing ends, m/s
_SINK, _MOST_SINK = 2.0, 0.25  # that the foot sinks in, over that at rest and over the length
_LOWERS = 0.35  # by how much of it the knee comes nearer to the ground
_SPRINGS = 6  # control periods of a flight until transmissions have given back their energy
_LATE = 0.6  # share of the push's way below which a landing may end


@inlined
def shape_hop(p: Record, shape: Record, command: float, hop: Record) -> None:
    """Set the numbers of a hop to a height, m; the push-off force stays."""
    length = p.thigh_length + p.shank_length
    above = command - p.foot_radius
    # A leg with a longer thigh than shank folds no further than until its knee is near the ground,
    # in which the foot sinks.
    sink = min(_SINK * p.gravity / p.contact_stiffness, _MOST_SINK * length)
    knee = p.knee_radius - p.foot_radius + shape.knee_gap * length + _LOWERS * sink
    thigh, shank = p.thigh_length, p.shank_length
    folded = knee + math.sqrt(max(knee * knee + thigh * thigh - shank * shank, 0.0))
    hop.flight = min(shape.flight_length * length, above - shape.clearance * length)
    hop.flight = max(hop.flight, folded + _LEAST_STROKE * length)
    drop = max(above - hop.flight, 0.0)
    hop.liftoff = min(
        hop.flight + shape.least_push * length + shape.liftoff_per_drop * drop,
        shape.liftoff * length,
    )
    highest = min(hop.flight, hop.liftoff) - _LEAST_STROKE * length
    squat = shape.squat * length - shape.squat_per_drop * drop
    hop.squat = max(min(squat, highest), folded)
    stop = shape.braking * p.gravity * drop
    if p.elastic[1] > 0:
        # The leg folds further by what the knee's belt gives under the force that stops it.
        to_knee = (hop.squat + (thigh * thigh - shank * shank) / hop.squat) / 2
        arm = max(thigh * thigh - to_knee * to_knee, 0.0)  # squared
        force = p.mass * (p.gravity + stop / max(hop.flight - hop.squat, 0.02 * length))
        hop.squat = max(min(hop.squat + force * arm / p.belt_stiffness[1], highest), folded)
    hop.stop = stop / max(hop.flight - hop.squat, 0.02 * length)


@inlined
def next_phase(p: Record, state: Array, hop: Record, phase: int) -> int:
    """Return the phase of the hop in a state."""
    down = p.thigh_length * math.cos(state[1]) + p.shank_length * math.cos(state[1] + state[2])
    height = state[0] - p.foot_radius
    if phase == FLIGHT:
        return LANDING if height <= down and state[3] < 0 else FLIGHT
    stretched = down >= _STRETCHED * (p.thigh_length + p.shank_length)
    if height - down > LIFTED or (phase == PUSH and (height >= hop.liftoff or stretched)):
        return FLIGHT
    low = height < hop.liftoff - _LATE * (hop.liftoff - hop.squat)
    if phase == LANDING and low and (state[3] > -_REST or height <= hop.squat):
        return PUSH
    return phase


@inlined
def law(p: Record, shape: Record, state: Array, hop: Record, phase: int, torque: Array) -> None:
    """Change ``torque`` (2,), what the motors give, to what a phase of the hop asks for."""
    l1, l2 = p.thigh_length, p.shank_length
    length, weight = l1 + l2, p.mass * p.gravity
    time = math.sqrt(length / p.gravity)
    s1, c1 = math.sin(state[1]), math.cos(state[1])
    s12, c12 = math.sin(state[1] + state[2]), math.cos(state[1] + state[2])
    if phase == FLIGHT:
        # Inverse kinematics of the foot below the hip, knee behind.
        cosine = (hop.flight * hop.flight - l1 * l1 - l2 * l2) / (2 * l1 * l2)
        knee = -math.acos(min(max(cosine, -1.0), 1.0))
        hip = -math.atan2(l2 * math.sin(knee), l1 + l2 * math.cos(knee))
        hip_torque = shape.hip_stiffness * (hip - state[1]) - shape.hip_damping * time * state[4]
        knee_torque = (
            shape.knee_stiffness * (knee - state[2]) - shape.knee_damping * time * state[5]
        )
        hip_torque, knee_torque = hip_torque * weight * length, knee_torque * weight * length
    else:
        forward, down = l1 * s1 + l2 * s12, l1 * c1 + l2 * c12
        w12 = state[4] + state[5]
        forward_rate = l1 * c1 * state[4] + l2 * c12 * w12
        if phase == PUSH:
            rest = (hop.liftoff + p.foot_radius - state[0]) / (shape.taper * length)
            force = hop.push * min(max(rest, 0.0), 1.0)
            large = max(hop.push / weight - shape.lean_from, 0.0)
            leaning = force * min(shape.lean * large, shape.most_lean)
        else:
            # Constant deceleration to rest at the squat; a leg that is slower than it sinks.
            way = max(state[0] - p.foot_radius - hop.squat, 0.01 * length)
            rate = min(state[3], 0.0)
            slowing = rate * rate / (2 * way)
            force = _FALL * weight
            if state[3] > -REST_SPEED:  # Joints that rub hold a leg that stands.
                holds = p.friction[1] + p.stiction[1] + (p.friction[0] + p.stiction[0]) / 2
                holds = holds / max(l2 * abs(s12), 0.01 * length) + p.rail_friction
                force = min(shape.fold * weight, _SINKS * weight - holds)
            if slowing >= hop.stop:
                force = weight * min(1 + slowing / p.gravity, shape.most_landing)
            leaning = 0.0
        sideways = -shape.sideways_stiffness * forward / length
        sideways -= shape.sideways_damping * forward_rate * time / length
        sideways = sideways * weight - leaning
        hip_torque = -force * forward + sideways * down
        knee_torque = -force * l2 * s12 + sideways * l2 * c12
    slew = shape.slew * weight * length
    for joint in range(2):
        wanted = hip_torque if joint == 0 else knee_torque
        limit = p.torque_limit[joint]
        wanted = min(max(wanted, -limit), limit)
        torque[joint] = min(max(wanted, torque[joint] - slew), torque[joint] + slew)


@inlined
def begin_plan(
    p: Record, state: Array, memory: Record, past: Array, rows: Array, here: Array, plan: Records,
    steps: int, dt: float,
) -> float:  # fmt: skip
    """Set ``here`` and ``plan`` to a leg when the next command arrives, but for what remains.

    Commands under way act until then. Returns what remains: by how much the next command is later
    than whole control periods, s.
    """
    for i in range(6):
        here[i] = state[i]
    plan[0] = memory
    whole = int(p.command_latency / (steps * dt) + 1e-9)
    if whole > 0:
        step_leg(p, here, plan, past, rows, 0.0, whole * steps, dt)
    return p.command_latency - whole * steps * dt


@inlined
def last_command(memory: Record, torque: Array) -> None:
    """Set ``torque``, (2,), to the newest command, be it in force or under way."""
    waiting = int(memory.waiting)
    for i in range(2):
        torque[i] = memory.pending[waiting - 1, 1 + i] if waiting > 0 else memory.command[i]


@inlined
def apex_of(
    ground: Record, air: Record, shape: Record, state: Array, memory: Records, past: Array,
    rows: Array, hop: Record, torque: Array, command: Array, late: float, steps: int, dt: float,
    air_steps: int, air_dt: float, ticks: int,
) -> float:  # fmt: skip
    """Return the height of the next apex of a leg that pushes, NaN if none comes.

    Changes all but the tables' rows. In the air the transmission is rigid and the step coarser.
    """
    phase, period, flown = PUSH, steps * dt, 0
    for _ in range(ticks):
        phase = next_phase(ground, state, hop, phase)
        law(ground, shape, state, hop, phase, torque)
        command[0], command[1] = torque[0], torque[1]
        send(memory[0], command, late)
        height, rate = state[0], state[3]
        if phase == FLIGHT:
            flown += 1
        if flown > _SPRINGS:
            step_leg(air, state, memory, past, rows, 0.0, air_steps, air_dt)
        else:
            step_leg(ground, state, memory, past, rows, 0.0, steps, dt)
        if phase == FLIGHT and rate > 0 and state[3] <= 0:
            # Between two ticks the base moves on a parabola.
            return height + rate * rate * period / (2 * max(rate - state[3], 1e-9))
    return np.nan


@compiled
def act(
    ground: Records, air: Records, shapes: Records, state: Array, memory: Records, phases: Array,
    commands: Array, hops: Records, torques: Array, scratch: Records, steps: IntArray,
    first: int, last: int, tries: int, tolerance: float, every: int, period: float,
    air_steps: int, ticks: int,
) -> None:  # fmt: skip
    """Set phases, (n,), and torques, N m, (n, 2), of some legs; plan the hops of those that push.

    The push-off force is the one whose simulated apex is the command, m, (n,), found by regula
    falsi in as many ``tries`` at most, each of so many ``ticks`` at most; an error of
    ``tolerance``, m, is good enough. A push is planned anew ``every`` so many control periods.
    Rows of the planning model, (n,), differ on the ``ground``, with ``steps`` physics steps per
    control period, s, and in the ``air``, with ``air_steps``. ``scratch`` has two records of memory
    per thread; those from twice ``first`` on are used.
    """
    rows, past = np.empty(SCRATCH), np.empty((0, 6))
    command, here, there, torque = np.zeros(COMMAND), np.empty(6), np.empty(6), np.empty(2)
    begun, plan = scratch[2 * first : 2 * first + 1], scratch[2 * first + 1 : 2 * first + 2]
    shape = shapes[0]
    for k in range(first, last):
        p, hop, dt = ground[k], hops[k], period / steps[k]
        late = begin_plan(p, state[k], memory[k], past, rows, here, begun, steps[k], dt)
        last_command(memory[k], torques[k])
        shape_hop(p, shape, commands[k], hop)
        phases[k] = next_phase(p, here, hop, int(phases[k]))
        hop.unplanned = hop.unplanned + 1 if phases[k] == PUSH else every
        if phases[k] != PUSH or hop.unplanned < every:
            law(p, shape, here, hop, int(phases[k]), torques[k])
            continue
        hop.unplanned = 0
        weight = p.mass * p.gravity
        least, most = _LEAST_PUSH * weight, _MOST_PUSH * weight
        low, high, low_error, high_error = least, most, np.nan, np.nan
        best, best_error = hop.push, np.inf
        way = hop.liftoff + p.foot_radius - here[0]
        step = weight / max(way, 0.03 * (p.thigh_length + p.shank_length)) / 2
        for _ in range(tries):
            force = hop.push
            for i in range(6):
                there[i] = here[i]
            for i in range(2):
                torque[i] = torques[k, i]
            plan[0] = begun[0]
            apex = apex_of(
                p, air[k], shape, there, plan, past, rows, hop, torque, command, late, steps[k], dt,
                air_steps, period / air_steps, ticks,
            )  # fmt: skip
            error = apex - commands[k] if apex == apex else -1.0
            if abs(error) < best_error:
                best, best_error = force, abs(error)
            if best_error < tolerance:
                break
            if error > 0:
                high, high_error = force, error
            else:
                low, low_error = force, error
            if high_error == high_error and low_error == low_error:
                share = low_error / (low_error - high_error)
                hop.push = low + min(max(share, 0.1), 0.9) * (high - low)
            else:
                # The work of the push over the rest of the leg's way lifts the weight.
                step *= 2
                hop.push = min(max(force - step * error, least), most)
            if hop.push == best and not least < best < most:
                break
        hop.push = best
        law(p, shape, here, hop, PUSH, torques[k])
