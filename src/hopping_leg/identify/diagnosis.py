"""What is wrong with a leg, in plain words, as far as one recording tells it.

A stated PD says what torque every row asks for; measured torques regressed on it tell the motor's
gain, a constant offset and how late commands act. The balance of momentum of a clamped leg tells
where angles are zero, torque that is always there though no motor gives it, and at which angles a
joint rubs. Where a motor has play it trembles about what it is asked for, which positions and
velocities show alike, unlike noise.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.identify.identifiability import correlation_time
from hopping_leg.identify.initial_states import full_states
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.torque_balance import Balance
from hopping_leg.identify.validation import as_torque_driven
from hopping_leg.robot import JOINTS, MotorLimit, Robot

_ROWS = 6  # of commands that a measured torque may come from
_SURE = 3.0  # deviations from which on a number counts
_LEAST = 200  # rows that a regression needs
_WEAK, _OFFSET, _ZERO = 0.85, 0.06, 0.03  # gain, N m and rad, beyond which something is wrong
_PULL = 0.12  # N m, more than friction that sticks passes for in healthy legs
_PLACES, _RUBS = 6, 0.12  # angles at which friction is told apart, and N m, likewise
_RANGE, _DRAG = (0.02, 0.98), 0.05  # of the angles' quantiles, and rad/s at which friction is there
_TREMBLES, _NOISE = 1.0, 0.6  # rad/s
_SIZE = 1.4826  # a normal number's standard deviation over its median size
_PRODUCT = 0.455  # median of a normal number's square over its variance
_LATE = 6e-3  # s
_LOST = 0.01  # share of rows without a measurement
_WITHIN = 0.6  # share of what a motor can give at its speed, below which even a weak one follows
_LEFT = 0.3  # of the torques' shares left unexplained, summed, beyond which nothing is said


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong."""

    kind: str
    """``gain``, ``offset``, ``delay``, ``zero``, ``one-sided``, ``rubbing``, ``backlash``,
    ``noise`` or ``dropouts``."""
    joint: str
    """Empty if it concerns both."""
    value: float
    """SI."""
    deviation: float
    """Standard deviation of the value, likewise."""
    sentence: str
    """What it is, its interval, and what to do."""


def diagnose(recording: Recording, robot: Robot) -> list[Finding]:
    """Return what is surely wrong with the leg of a recording; nothing where it cannot tell."""
    found = [*_dropouts(recording), *_scatter(recording)]
    drives = [finding for joint in range(2) for finding in _drive(recording, robot, joint)]
    late = [finding for finding in drives if finding.kind == "delay"]
    found += [finding for finding in drives if finding.kind != "delay"]
    if late:  # both drives hang on one bus, and late torques do not balance
        return [*found, max(late, key=lambda finding: finding.value / finding.deviation)]
    offsets = {finding.joint: finding.value for finding in drives if finding.kind == "offset"}
    return found + list(_balance(recording, [offsets.get(name, 0.0) for name in JOINTS]))


def _dropouts(recording: Recording) -> Iterator[Finding]:
    lost = float(np.isnan(recording.array("position")).any(axis=1).mean())
    deviation = float(np.sqrt(lost * (1 - lost) / len(recording)))
    if lost - _SURE * deviation > _LOST:
        yield Finding(
            "dropouts", "", lost, deviation,
            f"{100 * lost:.2g} % of the rows have no measured position; check bus, plugs and the"
            " cycle time.",
        )  # fmt: skip


def _scatter(recording: Recording) -> Iterator[Finding]:
    """Yield joints that tremble, and velocities that are not those that positions went by."""
    q, qd, time = recording.array("position"), recording.array("velocity"), recording.time
    went = (q[2:] - q[:-2]) / (time[2:] - time[:-2])[:, None]
    seen = (qd[2:] + 4 * qd[1:-1] + qd[:-2]) / 6
    # What both sensors show from row to row is motion; third differences leave no swing.
    both = np.diff(went, 3, axis=0) * np.diff(qd[1:-1], 3, axis=0)
    for joint, name in enumerate(JOINTS):
        apart = np.abs(went - seen)[:, joint]
        apart, shaken = (x[np.isfinite(x)] for x in (apart, both[:, joint]))
        if len(shaken) < _LEAST:
            continue
        tremble = float(np.sqrt(max(np.median(shaken) / _PRODUCT / 20, 0.0)))
        noise = float(np.median(apart)) * _SIZE * np.sqrt(2)
        if tremble > _TREMBLES:
            yield Finding(
                "backlash", name, tremble, tremble * float(np.sqrt(2 / len(shaken))),
                f"The {name} trembles by {tremble:.2g} rad/s from row to row; look for play in its"
                " gear, pulleys and screws, or for gains that are too high.",
            )  # fmt: skip
        elif noise > _NOISE:
            yield Finding(
                "noise", name, noise, noise * float(np.sqrt(2 / len(apart))),
                f"The {name}'s velocity scatters by {noise:.2g} rad/s about what its positions went"
                " by; check its encoder's magnet, its cable and the drive's filter.",
            )  # fmt: skip


def _drive(recording: Recording, robot: Robot, joint: int) -> Iterator[Finding]:
    """Yield what measured torques tell beside those that the stated PD asks for."""
    metadata, name = recording.metadata, JOINTS[joint]
    if metadata.onboard != "zoh" or not metadata.gains_exact or not recording.has("torque"):
        return
    asked, measured = _asked(recording)[:, joint], recording.array("torque")[:, joint]
    lagged = [np.append(np.full(k, np.nan), asked[: len(asked) - k]) for k in range(1, 1 + _ROWS)]
    design = np.stack([*lagged, np.ones(len(asked))], axis=1)
    wanted = _asked(recording) / _WITHIN
    possible = MotorLimit(robot).clip(wanted, recording.array("velocity")) == wanted
    usable = np.isfinite(design).all(axis=1) & np.isfinite(measured)
    for back in range(_ROWS + 1):
        usable[back:] &= possible[: len(usable) - back, joint]
    if usable.sum() < _LEAST:
        return
    values, covariance = _regression(design[usable], measured[usable])
    shares, ones = values[:-1], np.append(np.ones(_ROWS), 0.0)
    gain, of_gain = float(shares.sum()), float(np.sqrt(ones @ covariance @ ones))
    if gain <= 0:
        return
    if gain + _SURE * of_gain < _WEAK:
        yield Finding(
            "gain", name, gain, of_gain,
            f"The {name}'s motor gives {100 * gain:.3g} +- {200 * of_gain:.2g} % of the torque that"
            " it is asked for; check its torque constant, its current limit and the battery.",
        )  # fmt: skip
    offset, of_offset = float(values[-1]), float(np.sqrt(covariance[-1, -1]))
    if abs(offset) > max(_OFFSET, _SURE * of_offset):
        yield Finding(
            "offset", name, offset, of_offset,
            f"The {name}'s measured torque is {offset:.2g} +- {2 * of_offset:.1g} N m off what is"
            " asked for, always; calibrate its current sensor.",
        )  # fmt: skip
    slope = np.append((np.arange(_ROWS) - shares @ np.arange(_ROWS) / gain) / gain, 0.0)
    late = float(shares @ np.arange(_ROWS)) / gain * metadata.period
    of_late = float(np.sqrt(slope @ covariance @ slope)) * metadata.period
    if late - _SURE * of_late > _LATE:
        yield Finding(
            "delay", "", late, of_late,
            f"The {name}'s torque follows its command {1e3 * late:.2g} +- {2e3 * of_late:.1g} ms"
            " late; check bus, computer and the drive's current loop.",
        )  # fmt: skip


def _asked(recording: Recording) -> Array:
    """Return the torque that every row's state and command ask for, (rows, 2), NaN if unknown."""
    metadata = recording.metadata
    stiffness, damping = (
        np.where(np.isnan(recording.array(name)), pair or (np.nan, np.nan), recording.array(name))
        for name, pair in (("stiffness", metadata.stiffness), ("damping", metadata.damping))
    )
    rate, forward = (np.nan_to_num(recording.array(f"{n}_command")) for n in ("velocity", "torque"))
    spring = stiffness * (recording.array("position_command") - recording.array("position"))
    return np.asarray(spring + damping * (rate - recording.array("velocity")) + forward)


def _regression(design: Array, target: Array) -> tuple[Array, Array]:
    """Return values, (k,), and their covariance, (k, k), for residuals that last some rows."""
    values = np.asarray(np.linalg.lstsq(design, target)[0], np.float64)
    left = target - design @ values
    variance = float(np.var(left)) * correlation_time(left)
    return values, np.asarray(variance * np.linalg.pinv(design.T @ design, hermitian=True))


def _balance(recording: Recording, shifts: list[float]) -> Iterator[Finding]:
    """Yield what the balance of momentum tells, with torques less their sensors' offsets."""
    known = np.isfinite([recording.array(name) for name in ("position", "velocity")]).all()
    if recording.metadata.rig != "fixed-base" or not known or not recording.has("torque"):
        return
    found = Balance(as_torque_driven(recording), biased=True)
    if found.unexplained > _LEFT:
        return
    offsets, errors = found.offsets
    for joint, name in enumerate(JOINTS):
        pull, deviation = float(offsets[joint]) - shifts[joint], float(errors[joint])
        if abs(pull) > max(_PULL, 1.5 * _SURE * deviation):
            yield Finding(
                "one-sided", name, pull, deviation,
                f"The {name} takes {abs(pull):.2g} +- {2 * deviation:.1g} N m more"
                f" {'forwards' if pull > 0 else 'backwards'} than the other way; look for a cable"
                " that pulls and for friction that differs by direction.",
            )  # fmt: skip
    yield from _rubbing(recording)
    down, across = found.values[4], found.values[6]
    zero = float(np.arctan2(-across, down))
    deviation = float(found.errors[6]) / max(abs(float(down)), 1e-9)
    if down > _SURE * found.errors[4] and abs(zero) > max(_ZERO, _SURE * deviation):
        yield Finding(
            "zero", "hip", zero, deviation,
            f"By its gravity the leg hangs down where the hip is {zero:.2g} +- {2 * deviation:.1g}"
            " rad; set the encoder's zero anew.",
        )  # fmt: skip


def _rubbing(recording: Recording) -> Iterator[Finding]:
    """Yield at which angle a joint's friction is higher than at all others."""
    (q1, q2), speeds = (values.T for values in full_states(recording))
    low, high = np.quantile([q1, q2], _RANGE, axis=1)
    places = np.linspace(low, high, _PLACES).T
    further = [
        (joint, np.interp(angle, places[joint], here) * np.tanh(speed / _DRAG))
        for joint, (angle, speed) in enumerate(zip((q1, q2), speeds, strict=True))
        for here in np.eye(_PLACES)
    ]
    friction, covariance = Balance(as_torque_driven(recording), biased=True, further=further).found
    others = np.eye(_PLACES) - (1 - np.eye(_PLACES)) / (_PLACES - 1)
    for joint, name in enumerate(JOINTS):
        of_joint = slice(joint * _PLACES, (joint + 1) * _PLACES)
        more = others @ friction[of_joint]
        at = int(more.argmax())
        deviation = float(np.sqrt(others[at] @ covariance[of_joint, of_joint] @ others[at]))
        if more[at] > max(_RUBS, 1.5 * _SURE * deviation):
            yield Finding(
                "rubbing", name, float(more[at]), deviation,
                f"Around {places[joint, at]:.2g} rad the {name} takes {more[at]:.2g} +-"
                f" {2 * deviation:.1g} N m more than elsewhere, either way; look for a belt, a"
                " cable or a bearing that rubs there.",
            )  # fmt: skip
