"""What rewards are asked about: a tick of one leg."""

import numpy as np

from hopping_leg.envs import Transition


def transition(
    height=0.3, rate=0.0, *, q=(0.7, -1.4), qd=(0.0, 0.0), command=0.3, action=(0, 0), last=(0, 0),
    torque=(0, 0), clearance=0.05, apex=False,
):  # fmt: skip
    """Return a tick, an apex if so, in which the foot has a clearance."""

    def row(value):
        return np.array([value], dtype=float)

    return Transition(
        height=row(height), rate=row(rate), q=row(q), qd=row(qd), command=row(command),
        action=row(action), last_action=row(last), torque=row(torque), apex=np.array([apex]),
        apex_height=row(height), measure_clearance=lambda: row(clearance),
    )  # fmt: skip
