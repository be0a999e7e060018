"""Schedules over a training."""

import math


def cosine(left: float) -> float:
    """Fall from 1 to 0.02 as the share of the budget that is left falls from 1 to 0."""
    return 0.02 + 0.98 * (1 + math.cos(math.pi * (1 - left))) / 2
