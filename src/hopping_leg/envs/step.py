"""What a tick of many legs led to."""

from typing import NamedTuple

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.envs.observation import Array32


class Step(NamedTuple):
    """Outcome of one tick of n legs; legs whose episode ended have already begun the next."""

    observation: Array32
    """Seen after the tick, (n, size)."""
    reward: Array
    """(n,)."""
    terminated: BoolArray
    """Episode over because the leg fell; never by default, (n,)."""
    truncated: BoolArray
    """Episode over because its time was up, (n,)."""
    apex_error: Array
    """Apex height minus command where a leg just passed an in-flight apex, else NaN, m, (n,)."""
    apex_height: Array
    """Height of that apex, else NaN, m, (n,)."""
    height: Array
    """Base height at the end of the tick, before any restart, m, (n,)."""
    terms: Array
    """Reward terms in the order of the reward's ``names``, (n, k)."""
    final_observation: Array32 | None
    """Observations before the restart, (n, size), where any episode ended."""
    final_privileged: Array32 | None
    """True states before the restart, (n, privileged_size), where any episode ended."""
