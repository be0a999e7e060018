"""Whether measured torques are what the commands ask for: sign, unit, gear side, the rows' timing.

A stated PD says what every row's torque must be: k (q* - q) + d (q'* - q') + feed-forward. The
measured torque over it is 1 where all is right, -1 where the sign is another, 1/b or 1/b^2 where
it is that of the motor's side of a belt with ratio b; its correlation is highest at the right row.
"""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.identify.recording_format import PAIRS
from hopping_leg.identify.unit_checks import Inspection
from hopping_leg.robot import Robot

_LEAST_ROWS = 50
_LEAST_TORQUE = 0.1  # rms, N m, of what is asked for, below which noise rules
_ALIKE, _STRANGE = 0.9, 0.6  # correlations from which on torques are one, and are strangers
_OPPOSED = -0.5
_CLEARER = 0.5  # share of what a row leaves unexplained that another one must stay below
_LATEST = 10  # rows by which torques are searched for
_TOO_LATE = 0.02  # s, longer than any drive takes
_RATIOS = {False: (0.75, 1.33), True: (0.4, 2.5)}
"""Measured torque over what a stated PD asks for, or, true, a torque command."""
_NEAR = 0.05  # within which a factor is a gear's or a belt's


def check_torque(inspection: Inspection) -> None:
    """Refuse torques that contradict what was asked for; doubt rows that come late."""
    metadata, robot = inspection.metadata, inspection.robot
    commanded = metadata.onboard == "torque"
    right = 1 if metadata.onboard == "zoh" else 0
    for joint, column in enumerate(PAIRS["torque"]):
        asked, measured = _asked(inspection, joint), inspection.floats(column)
        rows = {late: _compare(asked, measured, late) for late in range(-1, _LATEST)}
        found = {late: pair for late, pair in rows.items() if pair is not None}
        if right not in found:
            continue
        best = max(found, key=lambda late: abs(found[late][1]))
        (slopes, correlation), own = found[best], found[right][1]
        named, late = inspection.named(column), best - right
        if correlation < _OPPOSED:
            inspection.refuse(
                f"{named} has the opposite sign of what was asked for (correlation"
                f" {correlation:.2f}); a positive torque accelerates towards positive angles, turn"
                " its sign round."
            )
        exact, (low, high) = commanded or metadata.gains_exact, _RATIOS[commanded]
        if exact and correlation > _ALIKE and not (slopes[0] < high and slopes[1] > low):
            slope = float(np.sqrt(abs(slopes[0] * slopes[1])))
            inspection.refuse(
                f"{named} is {slope:.3g} times what was asked for{_side(robot, joint, slope)};"
                " give torques in N m at the joint, and gains likewise."
            )
        if commanded or not exact:
            continue
        if correlation < _STRANGE:
            inspection.refuse(
                f"{named} does not follow the stated PD (correlation {correlation:.2f}); check"
                " 'stiffness', 'damping', 'onboard', 'sample' and the columns."
            )
        if late and 1 - correlation**2 < _CLEARER * (1 - own**2):
            sentence = (
                f"{named} follows the stated PD {'late' if late > 0 else 'early'}, by"
                f" {abs(late) * metadata.period * 1e3:.3g} ms or {abs(late)} of its rows"
                f" (correlation {correlation:.3f}, {own:.3f} at its own row); move the column"
            )
            if late < 0 or late * metadata.period >= _TOO_LATE:
                inspection.refuse(f"{sentence}, or check 'sample' and 'onboard'.")
            inspection.warn(f"{sentence} unless the drives take that long")


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
    rate, forward = (np.nan_to_num(column(f"{name}_command")) for name in ("velocity", "torque"))
    position = column("position_command")
    if metadata.onboard == "continuous":  # a row's torque is from its state and the last command
        position, rate, forward = (np.append(np.nan, v[:-1]) for v in (position, rate, forward))
    asked: Array = stiffness * (position - column("position")) + forward
    return asked + damping * (rate - column("velocity"))


def _compare(asked: Array, measured: Array, late: int) -> tuple[tuple[float, float], float] | None:
    """Return measured over asked, least and most, and their correlation at rows that are late.

    Errors of what is asked for pull its regression towards zero, those of what is measured the
    inverse one away from it: the truth is between.
    """
    x = asked[max(-late, 0) : len(asked) - max(late, 0)]
    y = measured[max(late, 0) : len(measured) - max(-late, 0)]
    known = ~np.isnan(x + y)
    x, y = x[known], y[known]
    if len(x) < _LEAST_ROWS or np.sqrt(np.mean(x**2)) < _LEAST_TORQUE or not y.any():
        return None
    small = np.abs(x) <= np.median(np.abs(x))  # larger ones may be beyond what a motor gives
    asked_power, both, power = x[small] @ x[small], x[small] @ y[small], y[small] @ y[small]
    least = float(both / max(asked_power, 1e-12))
    most = float(power / both) if both > 0 else least
    return (least, most), float(x @ y) / float(np.sqrt((x @ x) * (y @ y)))


def _side(robot: Robot | None, joint: int, slope: float) -> str:
    """Return the likely reason for a factor, as part of a sentence."""
    if robot is not None:
        one = (robot.hip, robot.knee)[joint]
        belt, gear = one.belt_ratio, one.motor.gear_ratio
        for side, factors in (
            ("the motor's side of the belt", (1 / belt, 1 / belt**2)),
            ("the rotor", (1 / gear, 1 / (gear * belt))),
        ):
            if any(abs(slope / factor - 1) < _NEAR for factor in factors):
                return f", as if at {side}"
    return ", maybe in amperes or with other gains"
