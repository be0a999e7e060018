"""What torques and motion of a clamped leg say by themselves, before any simulation is fitted.

The balance of momentum of two links, whatever their numbers, is linear in eight numbers and the
friction, with angles q1 and q12 = q1 + q2, speeds w, and torques t less friction:

    p1 = a w1 + b cos q2 (2 w1 + w2) + c (w1 + w2)
    p2 = b cos q2 w1 + c (w1 + w2) + d w2
    dp1/dt = t1 - G1 sin(q1 - z1) - G2 sin(q12 - z2)
    dp2/dt = t2 - G2 sin(q12 - z2) - b sin q2 w1 (w1 + w2)

What gears lose of a torque and by how much it is late is linear, too. The inertias must be
positive, the zeros z small, and g b / G2 is the length of the thigh; and with no other sign of a
joint may the same balance leave far less unexplained.
"""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import RecordingError
from hopping_leg.identify.identifiability import correlation_time
from hopping_leg.identify.initial_states import full_states
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.validation import as_torque_driven
from hopping_leg.robot import JOINTS, Robot

_SPAN = 0.1  # over which momentum is balanced, s
_DRAG = 0.05  # speed at which friction is fully there, rad/s
_SURE = 5.0  # deviations from which on a number is beyond doubt
_BETTER = 1.8  # factor by which another sign or zero must leave less unexplained
_ZERO = 0.25  # rad by which a zero may be off, as friction holds a hanging leg
_LENGTH, _COSTS = 1.4, 1.05
"""Factors: of the thigh's length, and of what is left unexplained with the robot's own."""
_DENSE = 0.4  # share of rows with position and velocity, below which nothing is said
_MOST = 1.0  # of the torques' shares left unexplained, summed, beyond which nothing is said


class Balance:
    """The balance of a recording whose torques are commanded, solved for its numbers.

    ``values`` and their deviations ``errors`` are a, b, c, d, G cos z and -G sin z of hip and knee,
    and friction. ``unexplained`` is the torques' share that is left. Signs are factors of each
    joint's angles and torques; ``upright`` takes both zeros for right, ``lever``, s2, b / G2 for
    known.
    """

    def __init__(
        self,
        recording: Recording,
        angles: tuple[int, int] = (1, 1),
        torques: tuple[int, int] = (1, 1),
        *,
        upright: bool = False,
        lever: float = 0.0,
    ) -> None:
        time, step = recording.time, np.diff(recording.time)
        (q1, q2), (w1, w2) = ((values * angles).T for values in full_states(recording))
        torque = np.nan_to_num(recording.array("torque_command") * torques).T
        rows = max(1, round(_SPAN / float(np.median(step))))

        def over(values: Array) -> Array:
            """Return the mean over each span of what was integrated until every row."""
            spans: Array = values[rows:] - values[:-rows]
            return spans / (time[rows:] - time[:-rows])

        def mean(values: Array, *, held: bool = False) -> Array:
            whole = values[:-1] if held else (values[1:] + values[:-1]) / 2
            return over(np.append(0.0, np.cumsum(whole * step)))

        zero, both, one, fold = np.zeros(len(time) - rows), q1 + q2, w1 + w2, np.cos(q2)
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
        ]
        for joint, speed in enumerate((w1, w2)):
            drag, asked = np.tanh(speed / _DRAG), torque[joint]
            for values in (drag, speed, np.abs(asked) * drag, np.append(0.0, np.diff(asked))):
                column = [zero, zero]
                column[joint] = mean(values, held=values is not drag and values is not speed)
                pairs.append((column[0], column[1]))
        design = np.stack([np.concatenate(pair) for pair in pairs], axis=1)
        if upright:
            design[:, 6:8] = 0.0
        if lever:
            design[:, 5] += lever * design[:, 1]
            design[:, 1] = 0.0
        target = np.concatenate([mean(column, held=True) for column in torque])
        weight = np.ones(len(target))
        for _ in range(2):  # again with each joint's own noise
            self.values = np.linalg.lstsq(weight[:, None] * design, weight * target)[0]
            left = (target - design @ self.values).reshape(2, -1)
            weight = np.repeat(1 / np.maximum(np.std(left, axis=1), 1e-6), len(zero))
        sizes = np.var(target.reshape(2, -1), axis=1)
        self.unexplained = float(np.sum(np.var(left, axis=1) / np.maximum(sizes, 1e-9)))
        # spans that overlap tell the same again, and so does what the balance does not explain
        alike = [max(float(rows), correlation_time(joint)) for joint in left]
        scaled = design * (weight / np.sqrt(np.repeat(alike, len(zero))))[:, None]
        covariance = np.linalg.pinv(scaled.T @ scaled, hermitian=True)
        deviations = np.sqrt(np.maximum(np.diag(covariance), 0))
        self.errors = np.where(scaled.any(axis=0), deviations, np.inf)


def check_balance(recording: Recording, robot: Robot) -> None:
    """Refuse a recording of a clamped leg whose torques and motion cannot be this robot's.

    Raises:
        RecordingError: A sign, a zero or the length of the thigh is surely another one.
    """
    driven = as_torque_driven(recording)
    known = np.isfinite([recording.array(name) for name in ("position", "velocity")]).mean()
    silent = recording.metadata.rig != "fixed-base" or not driven.has("torque_command")
    if silent or known < _DENSE or recording.time[-1] - recording.time[0] < 10 * _SPAN:
        return
    found = Balance(driven)
    if found.unexplained > _MOST:
        return
    values, errors = found.values, found.errors
    others = {
        "hip or knee is turned round, with its angle, velocity, torque and commands": (
            Balance(driven, (1, -1), (1, -1))
        ),
        "the hip's torque is turned round": Balance(driven, torques=(-1, 1)),
        "the knee's torque is turned round": Balance(driven, torques=(1, -1)),
    }
    wrong = min(others, key=lambda change: others[change].unexplained)
    if found.unexplained > _BETTER * others[wrong].unexplained:
        raise RecordingError(
            f"{recording.name}: torques and motion fit together"
            f" {found.unexplained / others[wrong].unexplained:.3g} times better where the sign of"
            f" {wrong}; turn it round, a positive torque accelerates towards positive angles."
        )
    if min(values[0] / errors[0], values[3] / errors[3]) < -_SURE:
        raise RecordingError(
            f"{recording.name}: the leg accelerates against its torques; turn their signs round."
        )
    upright = Balance(driven, upright=True).unexplained
    for joint, name in enumerate(JOINTS):
        zero = float(np.arctan2(-values[6 + joint], values[4 + joint]))
        falls = values[4 + joint] < -_SURE * errors[4 + joint]
        if falls or (abs(zero) > _ZERO and upright > _BETTER * found.unexplained):
            raise RecordingError(
                f"{recording.name}: by its gravity the {('thigh', 'shank')[joint]} hangs down at"
                f" {zero:.2g} rad of {('the hip', 'hip and knee together')[joint]}, not at 0; shift"
                f" the {name}'s zero, or turn its sign round."
            )
    gravity, given = recording.metadata.effective_gravity, robot.thigh.length
    length = gravity * float(values[1] / values[5])
    spread = abs(length) * float(np.hypot(errors[1] / values[1], errors[5] / values[5]))
    far = not given / _LENGTH < length < given * _LENGTH
    costs = Balance(driven, lever=given / gravity).unexplained / found.unexplained
    if far and abs(length - given) > _SURE * spread and costs > _COSTS:
        raise RecordingError(
            f"{recording.name}: torques and motion tell of a thigh of {length:.2g} +- {spread:.1g}"
            f" m, but that of '{robot.name}' is {given:g} m; give the file of this recording's leg"
            " with --robot."
        )
