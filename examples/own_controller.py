"""A controller of your own: hold the leg as a spring, and see that this alone does not hop."""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.robot import Robot, kinematics, load_robot
from hopping_leg.sim.channel import Measurement


class Spring:
    """Pulls the foot to 0.2 m below the hip through the transposed Jacobian."""

    name = "spring"

    def __init__(self, robot: Robot, rate: float = 200.0) -> None:
        self.robot, self.stiffness, self.damping = robot, 400.0, 10.0

    def reset(self, count: int) -> None:
        """Start anew; a spring has no memory."""

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2)."""
        q, qd = measurement.q[:, 0], measurement.qd[:, 0]  # the newest sample
        foot = kinematics.foot_position(self.robot, q)
        velocity = kinematics.foot_velocity(self.robot, q, qd)
        force = self.stiffness * (np.array([0.2, 0.0]) - foot) - self.damping * velocity
        return np.einsum("nij,ni->nj", kinematics.jacobian(self.robot, q), force)

    def internals(self) -> dict[str, Array]:
        """Return nothing else worth recording."""
        return {}


if __name__ == "__main__":
    robot = load_robot("legv2-paper")
    run = rollout(Spring(robot), RolloutConfig(robot), np.full((600, 4), 0.30), seed=0)
    height, clearance = run.data["height_m"][200:], run.data["foot_clearance_m"][200:]
    print(f"base between {height.min():.3f} and {height.max():.3f} m")
    print(f"foot off the ground {100 * (clearance > 0.003).mean():.0f} % of the time")
