"""Recordings walked through by hypotheses: one compiled call for all of them and all windows.

Physics steps divide the time between two rows evenly, so that every row is met at its own time
stamp. Row n holds state and torque just before command n acts, which arrives at the row's time plus
the drive's delay, wherever that lies in a physics step.
"""

import math

import numpy as np

from hopping_leg.arrays import Array, Record, Records
from hopping_leg.sim.compiled import compiled, inlined
from hopping_leg.sim.leg_physics import ROWS
from hopping_leg.sim.stepper import MEMORY, asked, motor_torque, step_leg

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
        ("velocity_window", np.float64),
        ("ramp", np.float64),
        ("gains", np.float64, (6,)),  # NaN as recorded
    ]
)
"""A hypothesis's drives."""

RESULT = 7
"""Numbers of a row's result: position, velocity and torque of both joints, height of the base."""

_WILD = 1e4  # joint velocity beyond which a simulation has broken down, rad/s
_SOON = 1e-9  # s, within which moments are the same
_PAST = 256  # physics steps that a drive's mean velocity may look back


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
def _add(command: Array, target: Array, share: float, row: Record, drive: Record, t: float) -> None:
    """Add a share of what a row commands, ``t`` s after it arrived, to a drive's command."""
    for joint in range(2):
        stiffness, damping = _gain(row, drive, joint), _gain(row, drive, 2 + joint)
        position = row.position[joint] + drive.ramp * t * row.slope[joint]
        torque = row.torque[joint] + stiffness * position + damping * row.velocity[joint]
        command[joint] += share * torque
        command[2 + joint] += share * stiffness
        command[6 + joint] += share * damping
        target[joint] += share * position


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
    memory.rotor[0], memory.rotor[1] = state[1], state[2]
    memory.rotor[2], memory.rotor[3] = state[4], state[5]
    scratch, none = np.empty((ROWS, 5)), np.empty((0, 6))
    seen, target, integral = np.empty(4), np.zeros(2), np.zeros(2)
    zoh, delay, window = onboard == ZOH, drive.delay, drive.velocity_window
    start, length = span.start, span.length
    lags = onboard == CONTINUOUS and window > 0
    sums = _gain(rows[start], drive, 4) != 0 or _gain(rows[start], drive, 5) != 0
    moves = onboard == CONTINUOUS and (lags or sums or drive.ramp != 0)

    # The newest command that has arrived before the window; a held PD saw the measured state.
    row = start
    while row > span.first and rows[row].time + delay > rows[start].time - _SOON:
        row -= 1
    oldest = row
    held = np.zeros((start + length - oldest, 2))
    for k in range(oldest, start):
        if zoh:
            _hold(rows[k], drive, rows[k].state, held[k - oldest])
    past, count = np.empty((_PAST, 2)), 0
    for k in range(_PAST):
        past[k, 0] = state[1] - (_PAST - k) * timestep * state[4]
        past[k, 1] = state[2] - (_PAST - k) * timestep * state[5]

    command = memory.command
    for n in range(length):
        now = rows[start + n].time
        seen[0], seen[1], seen[2], seen[3] = state[1], state[2], state[4], state[5]
        if not (abs(seen[2]) < _WILD and abs(seen[3]) < _WILD):
            result[: n + 1] = np.nan
            return
        if zoh:
            _hold(rows[start + n], drive, seen, held[start + n - oldest])
        last = n + 1 == length
        steps = 1
        if not last:
            steps = max(1, round((rows[start + n + 1].time - now) / timestep))
        dt = timestep if last else (rows[start + n + 1].time - now) / steps
        if abs(dt - timestep) < _SOON:
            dt = timestep
        step = -1  # at which the motors are only measured
        while step < steps:
            since = now + max(step, 0) * dt - delay  # when what arrives at this moment was sent
            many = 1
            command[:] = 0
            target[:] = 0
            rest = 1.0
            if step >= 0:
                while row < start + n and rows[row + 1].time < since + _SOON:
                    row += 1
                if row == start + n:
                    many = steps - step
                else:
                    many = min(steps - step, int((rows[row + 1].time - since) / dt))
                while many == 0 and row < start + n and rows[row + 1].time < since + dt - _SOON:
                    share = (rows[row + 1].time - since) / dt - (1 - rest)
                    if zoh:
                        command[0] += share * held[row - oldest, 0]
                        command[1] += share * held[row - oldest, 1]
                    else:
                        t = since + (1 - rest + share / 2) * dt - rows[row].time
                        _add(command, target, share, rows[row], drive, max(t, 0.0))
                    rest -= share
                    row += 1
                many = 1 if moves else max(many, 1)
            if zoh:
                command[0] += rest * held[row - oldest, 0]
                command[1] += rest * held[row - oldest, 1]
            else:
                t = since - rows[row].time
                if step >= 0:
                    t += (1 - rest / 2) * dt
                _add(command, target, rest, rows[row], drive, max(t, 0.0))
            for joint in range(2):
                if sums:
                    command[joint] += _gain(rows[row], drive, 4 + joint) * integral[joint]
                if lags:
                    back = min(window / dt, _PAST - 2.0)
                    whole = int(back)
                    near = past[(count - whole) % _PAST, joint] if whole else seen[joint]
                    far = past[(count - whole - 1) % _PAST, joint]
                    speed = (seen[joint] - near - (back - whole) * (far - near)) / (back * dt)
                    command[joint] -= command[6 + joint] * speed
                    command[6 + joint] = 0.0
            if step < 0:
                for joint in range(2):
                    angle, speed = seen[joint], seen[2 + joint]
                    wanted, given = asked(command, joint, angle, speed), memory.motor_torque[joint]
                    result[n, joint], result[n, 2 + joint] = angle, speed
                    result[n, 4 + joint], _ = motor_torque(p, joint, wanted, given, speed)
                result[n, 6] = state[0]
                step = 0
                if last:
                    break
                continue
            if moves:
                past[count % _PAST] = seen[:2]
                count += 1
                integral += dt * (target - seen[:2])
            step_leg(p, state, memory, none, scratch, 0.0, many, dt)
            seen[0], seen[1], seen[2], seen[3] = state[1], state[2], state[4], state[5]
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
