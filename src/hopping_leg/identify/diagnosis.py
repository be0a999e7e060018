"""What is wrong with a leg, in plain words, as far as one recording tells it.

A stated PD says what torque every row asks for; measured torques regressed on it tell the motor's
gain, a constant offset and how late commands act. The balance of momentum of a clamped leg tells
where angles are zero, and torque that is always there though no motor gives it.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.identify.identifiability import correlation_time
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.torque_balance import Balance
from hopping_leg.identify.validation import as_torque_driven
from hopping_leg.robot import JOINTS, MotorLimit, Robot

_ROWS = 6  # of commands that a measured torque may come from
_SURE = 3.0  # deviations from which on a number counts
_LEAST = 200  # rows that a regression needs
_WEAK, _OFFSET, _ZERO = 0.85, 0.06, 0.03  # gain, N m and rad, beyond which something is wrong
_PULL = 0.12  # N m, more than friction that sticks passes for in healthy legs
_LATE = 6e-3  # s
_LOST = 0.01  # share of rows without a measurement
_WITHIN = 0.6  # share of what a motor can give at its speed, below which even a weak one follows
_LEFT = 0.3  # of the torques' shares left unexplained, summed, beyond which nothing is said


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong."""

    kind: str
    """``gain``, ``offset``, ``delay``, ``zero``, ``one-sided`` or ``dropouts``."""
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
    found = list(_dropouts(recording))
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
    down, across = found.values[4], found.values[6]
    zero = float(np.arctan2(-across, down))
    deviation = float(found.errors[6]) / max(abs(float(down)), 1e-9)
    if down > _SURE * found.errors[4] and abs(zero) > max(_ZERO, _SURE * deviation):
        yield Finding(
            "zero", "hip", zero, deviation,
            f"By its gravity the leg hangs down where the hip is {zero:.2g} +- {2 * deviation:.1g}"
            " rad; set the encoder's zero anew.",
        )  # fmt: skip
