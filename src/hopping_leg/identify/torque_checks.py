"""Whether measured torques are what the commands ask for: sign, unit, gear side, the rows' timing.

A stated PD says what every row's torque must be: k (q* - q) + d (q'* - q') + feed-forward. The
measured torque over it is 1 where all is right, -1 where the sign is another, 1/b or 1/b^2 where
it is that of the motor's side of a belt with ratio b; its correlation is highest at the right row.
"""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import RobotError
from hopping_leg.identify.recording_format import PAIRS
from hopping_leg.identify.unit_checks import Inspection
from hopping_leg.robot import Robot, load_robot

_LEAST_ROWS = 50
_LEAST_TORQUE = 0.1  # rms, N m, of what is asked for, below which noise rules
_ALIKE, _STRANGE = 0.9, 0.6  # correlations from which on torques are one, and are strangers
_OPPOSED = -0.5
_CLEARER = 0.7  # share of what a row leaves unexplained that another one must stay below
_LATEST = 10  # rows by which torques are searched for
_TOO_LATE = 0.02  # s, longer than any drive takes
_STATED, _COMMANDED = (0.75, 1.33), (0.4, 2.5)
"""Measured torque over what a stated PD, or a torque command, asks for."""
_SATURATED = 0.8  # of the largest torque, beyond which motors give less


def check_torque(inspection: Inspection) -> None:
    """Refuse torques that contradict what was asked for; doubt rows that come late."""
    metadata = inspection.metadata
    try:
        robot: Robot | None = load_robot(metadata.robot)
    except (RobotError, OSError):
        robot = None
    exact = metadata.onboard == "torque" or metadata.gains_exact
    for joint, column in enumerate(PAIRS["torque"]):
        asked, measured = _asked(inspection, joint), inspection.floats(column)
        if robot is not None:
            most = _SATURATED * float(robot.of_joints("torque_limit")[joint])
            asked = np.where(np.abs(asked) < most, asked, np.nan)
        rows = {late: _compare(asked, measured, late) for late in range(-1, _LATEST)}
        found = {late: pair for late, pair in rows.items() if pair is not None}
        right = 1 if metadata.onboard == "zoh" else 0
        if right not in found:
            continue
        best = max(found, key=lambda late: abs(found[late][1]))
        slope, correlation = found[best]
        named = inspection.named(column)
        if correlation < _OPPOSED:
            inspection.refuse(
                f"{named} has the opposite sign of what was asked for (correlation"
                f" {correlation:.2f}); a positive torque accelerates towards positive angles, turn"
                " its sign round."
            )
        low, high = _COMMANDED if metadata.onboard == "torque" else _STATED
        if exact and correlation > _ALIKE and not low < slope < high:
            inspection.refuse(
                f"{named} is {slope:.3g} times what was asked for{_side(robot, joint, slope)};"
                " give torques in N m at the joint, and gains likewise."
            )
        if metadata.onboard == "torque" or not exact:
            continue
        if correlation < _STRANGE:
            inspection.refuse(
                f"{named} does not follow the stated PD (correlation {correlation:.2f}); check"
                " 'stiffness', 'damping', 'onboard', 'sample' and the columns."
            )
        if best != right and 1 - correlation**2 < _CLEARER * (1 - found[right][1] ** 2):
            late = best - right
            sentence = (
                f"{named} follows the stated PD {'late' if late > 0 else 'early'}, by"
                f" {abs(late) * metadata.period * 1e3:.3g} ms or {abs(late)} of its rows"
                f" (correlation {correlation:.3f}, {found[right][1]:.3f} at its own row)"
            )
            if late < 0 or late * metadata.period >= _TOO_LATE:
                inspection.refuse(
                    f"{sentence}; move the column, or say sample = 'after-command' or onboard ="
                    " 'continuous'."
                )
            inspection.warn(f"{sentence}; unless the drives take that long, move the column")


def _asked(inspection: Inspection, joint: int) -> Array:
    """Return the torque that every row's state and command ask for, (ticks,), NaN if unknown."""
    metadata = inspection.metadata

    def column(name: str) -> Array:
        return inspection.floats(PAIRS[name][joint])

    if metadata.onboard == "torque":
        return column("torque_command")
    stiffness, damping = (
        np.where(np.isnan(column(name)), (pair or (np.nan, np.nan))[joint], column(name))
        for name, pair in (("stiffness", metadata.stiffness), ("damping", metadata.damping))
    )
    commands = [
        column("position_command"),
        *map(np.nan_to_num, map(column, ("velocity_command", "torque_command"))),
    ]
    if metadata.onboard == "continuous":  # a row's torque is from its state and the last command
        commands = [np.append(np.nan, values[:-1]) for values in commands]
    position, velocity, forward = commands
    asked: Array = stiffness * (position - column("position")) + forward
    return asked + damping * (velocity - column("velocity"))


def _compare(asked: Array, measured: Array, late: int) -> tuple[float, float] | None:
    """Return measured over asked and their correlation where the measured rows are late."""
    x, y = asked[max(-late, 0) : len(asked) - max(late, 0)], measured[max(late, 0) :]
    x, y = x[: len(y)], y[: len(x)]
    known = ~np.isnan(x + y)
    x, y = x[known], y[known]
    if len(x) < _LEAST_ROWS or np.sqrt(np.mean(x**2)) < _LEAST_TORQUE:
        return None
    size = float(np.sqrt((x @ x) * (y @ y)))
    return (float(x @ y / (x @ x)), float(x @ y) / size) if size else None


def _side(robot: Robot | None, joint: int, slope: float) -> str:
    """Return the likely reason for a factor, as part of a sentence."""
    factors = {1e3: "in mN m", 10.197: "in kgf cm", 0.102: "in kgf m", 141.6: "in ozf in"}
    if robot is not None:
        one = (robot.hip, robot.knee)[joint]
        belt, gear = one.belt_ratio, one.motor.gear_ratio
        factors |= dict.fromkeys((1 / gear, 1 / (gear * belt)), "at the rotor")
        factors |= dict.fromkeys((1 / belt, 1 / belt**2), "at the motor's side of the belt")
    guess = [word for factor, word in factors.items() if abs(slope / factor - 1) < 0.05]
    return f", as if {guess[-1]}" if guess else ", maybe in amperes or with other gains"
