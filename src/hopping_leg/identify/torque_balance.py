"""What torques and motion of a clamped leg say by themselves, before any simulation is fitted.

The balance of momentum of two links, whatever their numbers, is linear in eight numbers and the
friction, with angles q1 and q12 = q1 + q2, speeds w, and torques t less friction:

    p1 = a w1 + b cos q2 (2 w1 + w2) + c (w1 + w2)
    p2 = b cos q2 w1 + c (w1 + w2) + d w2
    dp1/dt = t1 - G1 sin(q1 - z1) - G2 sin(q12 - z2)
    dp2/dt = t2 - G2 sin(q12 - z2) - b sin q2 w1 (w1 + w2)

Inertias a to d must be positive, the zeros z small, and g b / G2 is the length of the thigh: other
values mean that a sign, a zero or the leg is another one.
"""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import RecordingError
from hopping_leg.identify.initial_states import full_states
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.validation import as_torque_driven
from hopping_leg.robot import JOINTS, Robot

_SPAN = 0.1  # over which momentum is balanced, s
_DRAG = 0.05  # speed at which friction is fully there, rad/s
_SURE = 4.0  # deviations from which on a number is beyond doubt
_ZERO = 0.25  # rad by which a zero may be off, as friction holds a hanging leg
_LENGTH = 1.3  # factor by which the thigh's length may differ
_DENSE = 0.9  # share of rows with position and velocity, below which nothing is said


def check_balance(recording: Recording, robot: Robot) -> None:
    """Refuse a recording of a clamped leg whose torques and motion cannot be this robot's.

    Raises:
        RecordingError: A sign, a zero or the length of the thigh is surely another one.
    """
    driven = as_torque_driven(recording)
    known = np.isfinite([recording.array(name) for name in ("position", "velocity")]).mean()
    if recording.metadata.rig != "fixed-base" or known < _DENSE or not driven.has("torque_command"):
        return
    found = _solve(driven)
    if found is None:
        return
    values, errors = found
    for name, at in (("hip", 0), ("knee", 3)):
        if values[at] < -_SURE * errors[at]:
            raise RecordingError(
                f"{recording.name}: the {name} accelerates against its torque; turn the sign of"
                " its torque round, or of its angle with everything else of that joint."
            )
    if values[1] < -_SURE * errors[1]:
        raise RecordingError(
            f"{recording.name}: hip and knee drive each other the wrong way; turn round the sign of"
            " angle, velocity, torque and commands of one of them."
        )
    for joint, name in enumerate(JOINTS):
        size = float(np.hypot(values[4 + joint], values[6 + joint]))
        zero = float(np.arctan2(-values[6 + joint], values[4 + joint]))
        if abs(zero) > _ZERO + _SURE * float(errors[6 + joint]) / max(size, 1e-9) and (
            size > _SURE * float(max(errors[4 + joint], errors[6 + joint]))
        ):
            hangs = "the thigh" if joint == 0 else "the shank"
            raise RecordingError(
                f"{recording.name}: by its gravity {hangs} hangs down at {zero:.2g} rad"
                f" {'of the hip' if joint == 0 else 'of hip and knee together'}, not at 0; shift"
                f" the {name}'s zero, or turn its sign round."
            )
    gravity = recording.metadata.effective_gravity
    length = gravity * float(values[1] / values[5])
    spread = abs(length) * float(np.hypot(errors[1] / values[1], errors[5] / values[5]))
    given = robot.thigh.length
    far = not given / _LENGTH < length < given * _LENGTH
    if far and abs(length - given) > _SURE * spread:
        raise RecordingError(
            f"{recording.name}: torques and motion tell of a thigh of {length:.2g} +- {spread:.1g}"
            f" m, but that of '{robot.name}' is {given:g} m: it is another leg, whose file --robot"
            " wants, or one joint's sign is another, of angle, velocity, torque and commands."
        )


def _solve(recording: Recording) -> tuple[Array, Array] | None:
    """Return a, b, c, d, G cos z, -G sin z and friction of both joints, and their deviations."""
    time = recording.time
    (q1, q2), (w1, w2) = (values.T for values in full_states(recording))
    torque = np.nan_to_num(recording.array("torque_command"))
    step = np.diff(time)
    rows = max(1, round(_SPAN / float(np.median(step))))
    if len(time) < 10 * rows:
        return None

    def over(values: Array) -> Array:
        """Return the mean over each span of what was integrated until every row."""
        spans: Array = values[rows:] - values[:-rows]
        return spans / (time[rows:] - time[:-rows])

    def mean(values: Array, *, held: bool = False) -> Array:
        whole = values[:-1] if held else (values[1:] + values[:-1]) / 2
        return over(np.append(0.0, np.cumsum(whole * step)))

    both, zero, one, fold = q1 + q2, np.zeros(len(time) - rows), w1 + w2, np.cos(q2)
    hangs, leans = mean(np.sin(both)), mean(np.cos(both))
    pairs = [
        (over(w1), zero),
        (over(fold * (2 * w1 + w2)), over(fold * w1) + mean(np.sin(q2) * w1 * one)),
        (over(one), over(one)),
        (zero, over(w2)),
        (mean(np.sin(q1)), zero),
        (hangs, hangs),
        (mean(np.cos(q1)), zero),
        (leans, leans),
        *((mean(np.tanh(w1 / _DRAG)), zero), (zero, mean(np.tanh(w2 / _DRAG)))),
        *((mean(w1), zero), (zero, mean(w2))),
    ]
    design = np.stack([np.concatenate(pair) for pair in pairs], axis=1)
    target = np.concatenate([mean(column, held=True) for column in torque.T])
    weight = np.ones(len(target))
    for _ in range(2):  # again with each joint's own noise
        values, *_ = np.linalg.lstsq(weight[:, None] * design, weight * target, rcond=None)
        noise = np.std((target - design @ values).reshape(2, -1), axis=1)
        weight = np.repeat(1 / np.maximum(noise, 1e-6), len(zero))
    scaled = weight[:, None] * design
    normal = scaled.T @ scaled / rows  # spans that overlap tell the same again
    if not np.isfinite(normal).all() or np.linalg.cond(normal) > 1e12:
        return None
    return values, np.sqrt(np.diag(np.linalg.inv(normal)))
