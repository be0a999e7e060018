"""Recordings walked through by hypotheses: one compiled call for all of them and all windows.

Physics steps divide the time between two rows evenly, so that every row is met at its own time
stamp. Row n holds state and torque just before command n acts, which arrives at the row's time plus
the drive's delay, wherever that lies in a physics step.

The stepper's method is leapfrog's in disguise: a speed belongs half a physics step before its
angle, and the torque of a step to the time from half a step before to half a step after the angle.
Read like that it errs by the square of the step, read as it stands by the step itself, which would
pass for 0.25 ms of delay and for a percent of inertia.
"""

import math

import numpy as np

from hopping_leg.arrays import Array, Record, Records
from hopping_leg.sim.compiled import compiled, inlined
from hopping_leg.sim.stepper import (
    MEMORY,
    SCRATCH,
    after_gear,
    asked,
    dry_friction,
    motor_torque,
    step_leg,
    through_transmission,
)  # fmt: skip

TORQUE, ZOH, CONTINUOUS = range(3)
"""What closes the loop: nothing, a PD once per row, the drives at every physics step."""

ROW = np.dtype(
    [
        ("time", np.float64),
        ("state", np.float64, (4,)),  # angles and speeds that were measured
        ("position", np.float64, (2,)),  # and what was commanded
        ("velocity", np.float64, (2,)),
        ("torque", np.float64, (2,)),
        ("slope", np.float64, (2,)),  # of the position until the next row
        ("gains", np.float64, (6,)),  # stiffness, damping and integral of both
    ]
)
"""A row of a recording."""

SPAN = np.dtype([(name, np.int64) for name in ("start", "length", "first", "recording")])
"""A window: where it starts among all recordings' rows, and its recording's first row."""

DRIVE = np.dtype(
    [
        ("delay", np.float64),
        ("ramp", np.float64),
        ("gains", np.float64, (6,)),  # NaN as recorded
    ]
)
"""A hypothesis's drives."""

RESULT = 7
"""Numbers of a row's result: position, velocity and torque of both joints, height of the base."""

_WILD = 1e4  # joint velocity beyond which a simulation has broken down, rad/s
_SOON = 1e-9  # s, within which moments are the same
_TRIALS = 6  # steps in which an elastic joint's link is moved to where it follows its motor


@inlined
def _gain(row: Record, drive: Record, i: int) -> float:
    fitted: float = drive.gains[i]
    return row.gains[i] if math.isnan(fitted) else fitted


@inlined
def _hold(row: Record, drive: Record, state: Array, torque: Array) -> None:
    """Set the torques that a PD asks for in a state and holds until its next row."""
    for joint in range(2):
        torque[joint] = row.torque[joint]
        torque[joint] += _gain(row, drive, joint) * (row.position[joint] - state[joint])
        torque[joint] += _gain(row, drive, 2 + joint) * (row.velocity[joint] - state[2 + joint])


@inlined
def _add(
    command: Array, target: Array, share: float, row: Record, drive: Record, late: float
) -> None:
    """Add a share of what a row commands, ``late`` s after it arrived, to a drive's command."""
    for joint in range(2):
        stiffness, damping = _gain(row, drive, joint), _gain(row, drive, 2 + joint)
        position = row.position[joint] + drive.ramp * max(late, 0.0) * row.slope[joint]
        torque = row.torque[joint] + stiffness * position + damping * row.velocity[joint]
        command[joint] += share * torque
        command[2 + joint] += share * stiffness
        command[6 + joint] += share * damping
        target[joint] += share * position


@inlined
def _read(p: Record, state: Array, memory: Record, dt: float, seen: Array) -> None:
    """Set motors' angles and speeds of one moment: the speeds go on for half a physics step."""
    for joint in range(2):
        q, v, a = state[1 + joint], state[4 + joint], memory.acceleration[1 + joint]
        if p.elastic[joint] > 0:
            t, w, torque = memory.rotor[joint], memory.rotor[2 + joint], memory.motor_torque[joint]
            loss = dry_friction(p, joint, torque, w)
            torque = after_gear(p, joint, torque, t, w)
            _, _, a = through_transmission(p, joint, torque, loss, q, v, t, w)
            q, v = t, w
        seen[joint], seen[2 + joint] = q, v + dt / 2 * a


@compiled
def _replay_window(
    p: Record,
    drive: Record,
    rows: Records,
    span: Record,
    onboard: int,
    timestep: float,
    state: Array,
    leg: Records,
    result: Array,
) -> None:
    """Simulate one window, see ``replay``; ``state`` is (6,), ``result`` (rows, ``RESULT``).

    The leg's ``MEMORY``, (1,), is an array's that lives on: a record does not keep it.
    """
    memory = leg[0]
    memory.waiting = 0
    memory.acceleration[:] = 0
    memory.motor_torque[:] = 0
    memory.forward = 0
    memory.rotor[0], memory.rotor[1] = state[1], state[2]
    memory.rotor[2], memory.rotor[3] = state[4], state[5]
    scratch, none = np.empty(SCRATCH), np.empty((0, 6))
    seen, target, integral = np.empty(4), np.zeros(2), np.zeros(2)
    zoh, delay = onboard == ZOH, drive.delay
    start, length, dt = span.start, span.length, timestep
    sums = _gain(rows[start], drive, 4) != 0 or _gain(rows[start], drive, 5) != 0
    moves = onboard == CONTINUOUS and (sums or drive.ramp != 0)

    # The newest command that has arrived before the window; a held PD saw the measured state.
    row = start
    while row > span.first and rows[row].time + delay > rows[start].time - dt:
        row -= 1
    oldest = row
    held = np.zeros((start + length - oldest, 2))
    for k in range(oldest, start):
        if zoh:
            _hold(rows[k], drive, rows[k].state, held[k - oldest])

    command = memory.command
    for n in range(length):
        now = rows[start + n].time
        _read(p, state, memory, dt if n > 0 else 0.0, seen)
        if not (abs(seen[2]) < _WILD and abs(seen[3]) < _WILD):
            result[: n + 1] = np.nan
            return
        if zoh:
            _hold(rows[start + n], drive, seen, held[start + n - oldest])
        last = n + 1 == length
        steps, dt = 1, timestep
        if not last:
            steps = max(1, round((rows[start + n + 1].time - now) / timestep))
            even = (rows[start + n + 1].time - now) / steps
            dt = timestep if abs(even - timestep) < _SOON else even
        trials = _TRIALS if p.elastic[0] + p.elastic[1] > 0 else 1
        step = -1 - trials if n == 0 else -1  # at which the motors are only tried and measured
        while step < steps:
            # Before ``since`` was sent what has arrived when this step's torque begins to act.
            since = now - delay + ((step - 0.5) * dt if step >= 0 else 0.0)
            newest, many, rest = row, steps - step, 1.0
            command[:] = 0
            target[:] = 0
            if step < 0:
                while newest < start + n and rows[newest + 1].time < since - _SOON:
                    newest += 1
            else:
                while newest < start + n and rows[newest + 1].time < since + _SOON:
                    newest += 1
                if newest < start + n:
                    many = min(many, int((rows[newest + 1].time - since) / dt + _SOON))
                while many == 0 and newest < start + n and rows[newest + 1].time < since + dt:
                    share = (rows[newest + 1].time - since) / dt - (1 - rest)
                    if zoh:
                        for joint in range(2):
                            command[joint] += share * held[newest - oldest, joint]
                    else:
                        late = since + (1 - rest + share / 2) * dt - rows[newest].time
                        _add(command, target, share, rows[newest], drive, late)
                    rest -= share
                    newest += 1
                row = newest
                many = 1 if moves else max(many, 1)
            if zoh:
                for joint in range(2):
                    command[joint] += rest * held[newest - oldest, joint]
            else:
                late = since - rows[newest].time + ((1 - rest / 2) * dt if step >= 0 else 0.0)
                _add(command, target, rest, rows[newest], drive, late)
            for joint in range(2):
                if sums:
                    command[joint] += _gain(rows[newest], drive, 4 + joint) * integral[joint]
            if step == -1:
                for joint in range(2):
                    angle, speed = seen[joint], seen[2 + joint]
                    wanted, given = asked(command, joint, angle, speed), memory.motor_torque[joint]
                    result[n, joint], result[n, 2 + joint] = angle, speed
                    result[n, 4 + joint], _ = motor_torque(p, joint, wanted, given, speed)
                result[n, 6] = state[0]
                step = steps if last else 0
                continue
            where = state
            if step < 0:
                many, where = 1, state.copy()
            elif moves:
                integral += dt * (target - seen[:2])
            step_leg(p, where, leg, none, scratch, 0.0, many, dt)
            if step < 0:  # a state's speeds belong half a step before
                for joint in range(2):
                    w = seen[2 + joint]
                    gain = (memory.rotor[2 + joint] - w) / dt
                    memory.rotor[joint], memory.rotor[2 + joint] = seen[joint], w
                    if step == -2:
                        memory.rotor[2 + joint] -= dt / 2 * gain
                    elif p.elastic[joint] > 0:
                        ease = 1 / p.armature[joint] + p.joint_softness[joint]
                        gain = memory.acceleration[1 + joint] - gain
                        state[1 + joint] += gain / ease / p.belt_stiffness[joint]
                if step < -2:
                    step += 1
                    continue
                for i in range(3):
                    state[3 + i] -= dt / 2 * memory.acceleration[i]
            _read(p, state, memory, dt, seen)
            step += many


@compiled
def replay(
    table: Records,
    drives: Records,
    rows: Records,
    spans: Records,
    onboard: int,
    timestep: float,
    state: Array,
    first: int,
    last: int,
    result: Array,
) -> None:
    """Simulate pairs of hypothesis and window from number ``first`` to before ``last``.

    Args:
        table: Rows of ``LEG`` of every hypothesis as each recording's limits make it, (h, r).
        drives: Of every hypothesis, (h,).
        rows: Of all recordings, one after the other.
        spans: Windows, (w,).
        onboard: ``TORQUE``, ``ZOH`` or ``CONTINUOUS``.
        timestep: Physics step, s; those between two rows are as near to it as can be.
        state: Where each pair starts, (h, w, 6); it ends where the window does.
        first: Number of the first pair; windows of a hypothesis are neighbours.
        last: Number after the last pair.
        result: Set, (h, w, rows, ``RESULT``); what is not reached stays, what broke down is NaN.
    """
    leg = np.zeros(1, MEMORY)
    for pair in range(first, last):
        h, w = pair // len(spans), pair % len(spans)
        span = spans[w]
        _replay_window(
            table[h, span.recording], drives[h], rows, span, onboard, timestep, state[h, w],
            leg, result[h, w],
        )  # fmt: skip
