"""The paper's joint PD, which tracks a trajectory ("Trajectory Generation and Data Collection").

    tau = Kp (q* - q) + Kd (qd* - qd)

computed once per control period from the newest measurement and held. The paper sets the target
velocity qd* to zero.
"""

from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import UsageError
from hopping_leg.robot.parameters import JOINTS
from hopping_leg.sim.channel import Measurement


@dataclass(frozen=True)
class JointGains:
    """Gains of hip and knee; UsageError refuses a negative one.

    The defaults are chosen here, as the paper prints none: stiff enough to move, soft enough for
    200 Hz and milliseconds of latency with the smallest inertia that leg V2 is said to have
    (Table I's shank).
    """

    stiffness: tuple[float, float] = (20.0, 12.0)
    """Torque per position error, N m/rad."""
    damping: tuple[float, float] = (0.3, 0.15)
    """Torque per velocity error, N m s/rad."""

    def __post_init__(self) -> None:
        for name, values in vars(self).items():
            if not all(0 <= value < float("inf") for value in values):
                raise UsageError(f"'{name}' of the joint PD is {values} but must be zero or more.")


class JointPD:
    """Tracks one trajectory with all legs; a Controller. After its end, the last row is held.

    Positions, rad, and velocities, rad/s, are those of each control period, (ticks, 2); velocities
    are zero, as the paper's, unless given.
    """

    def __init__(
        self, position: Array, velocity: Array | None = None, gains: JointGains | None = None
    ) -> None:
        self.position = position
        self.velocity = np.zeros_like(position) if velocity is None else velocity
        gains = gains or JointGains()
        self._stiffness, self._damping = np.array(gains.stiffness), np.array(gains.damping)
        self.name = "joint-pd"
        self.reset(1)

    def reset(self, count: int) -> None:
        """Begin the trajectory anew with ``count`` legs."""
        self._tick, self._count = -1, count

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2); called once per control period."""
        self._tick = min(self._tick + 1, len(self.position) - 1)
        behind = self.position[self._tick] - measurement.q[:, 0]
        slower = self.velocity[self._tick] - measurement.qd[:, 0]
        torque: Array = self._stiffness * behind + self._damping * slower
        return torque

    def internals(self) -> dict[str, Array]:
        """Return the targets of the last ``act``, each (n,)."""
        targets = {"position_command_rad": self.position, "velocity_command_rad_s": self.velocity}
        return {
            f"{joint}_{kind}": np.full(self._count, rows[max(self._tick, 0), column])
            for kind, rows in targets.items()
            for column, joint in enumerate(JOINTS)
        }
