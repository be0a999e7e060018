"""Correct a policy's command by what its hops miss, so that their medians meet it."""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers.policy import Policy
from hopping_leg.rl.onnx_export import CommandMap, with_command_map
from hopping_leg.rl.policy_evaluation import CALIBRATION_SEEDS, evaluate_policy, every_centimetre
from hopping_leg.robot.parameters import Robot

_MOST = 0.02
"""Largest shift, m."""

_TRUSTED = 0.01
"""Error of which a round corrects no more, m."""


def calibrate(
    content: bytes,
    robot: Robot,
    command_range: tuple[float, float],
    rounds: int,
    rate: float,
) -> bytes:
    """Return a policy file with the command map with which it meets its commands.

    Round k, on a seed of its own, corrects the k-th part of the remaining error: the mean of what
    the rounds tell. Heights without hops keep their shift.

    Args:
        content: The policy file.
        robot: The leg.
        command_range: Lowest and highest command, m.
        rounds: How many, at most one per calibration seed.
        rate: Control rate, Hz.
    """
    heights = every_centimetre(command_range)
    shifts = np.zeros(len(heights))
    for number, seed in enumerate(CALIBRATION_SEEDS[:rounds], start=1):
        policy = Policy(_mapped(content, heights, shifts), "calibration", "policy")
        results = evaluate_policy(policy, robot, heights, (seed,), rate)
        errors = np.nan_to_num([result.median_error_m for result in results])
        shifts -= errors.clip(-_TRUSTED, _TRUSTED) / number
        shifts = shifts.clip(-_MOST, _MOST)
    return _mapped(content, heights, shifts)


def _mapped(content: bytes, heights: tuple[float, ...], shifts: Array) -> bytes:
    return with_command_map(content, CommandMap(heights, tuple(shifts.tolist())))
