"""What the simulator knows of n legs and a policy does not, as a critic or a teacher sees it."""

from hopping_leg.arrays import Array
from hopping_leg.envs.observation import Array32, Scaling
from hopping_leg.sim import Simulator

PRIVILEGED = 10
"""Entries of the true state, where all legs are the same."""

PRIVILEGED_HEIGHT, PRIVILEGED_COMMAND, PRIVILEGED_CLEARANCE = 0, 6, 7
"""Where the base's height, the command and the foot's clearance stand among them."""

CLEARANCE_GAIN = 10.0
"""Scale of clearances, 1/m."""


def privileged_observation(legs: Simulator, command: Array, sample: Scaling, out: Array32) -> None:
    """Write the normalised true state.

    Base height and rate, q (2), qd (2), command, clearance of foot, knee and base.

    Args:
        legs: n legs.
        command: Desired heights, m, (n,).
        sample: Normalisation of joints and command, from ``sample_scaling``; the base's height has
            the command's.
        out: (n, ``PRIVILEGED``).
    """
    offset, gain = sample.offset, sample.gain
    out[:, PRIVILEGED_HEIGHT] = (legs.height - offset[4]) * gain[4]
    out[:, 1] = legs.height_rate
    out[:, 2:4] = (legs.q - offset[:2]) * gain[:2]
    out[:, 4:6] = legs.qd * gain[2:4]
    out[:, PRIVILEGED_COMMAND] = (command - offset[4]) * gain[4]
    out[:, PRIVILEGED_CLEARANCE] = legs.foot_clearance() * CLEARANCE_GAIN
    out[:, 8] = legs.knee_clearance() * CLEARANCE_GAIN
    out[:, 9] = legs.base_clearance() * CLEARANCE_GAIN
