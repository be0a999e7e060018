"""A controller in RealAIGym's style: one leg, joints in, torques out; it bounces on a spring."""

import numpy as np

from hopping_leg.robot import Robot, kinematics


class Bouncer:
    """A virtual spring between hip and foot that pushes harder while the leg extends."""

    def __init__(self, robot: Robot, rate: float = 200.0) -> None:
        self.robot, self.desired_height = robot, 0.3

    def get_control_output(self, meas_pos, meas_vel, meas_tau, meas_time):  # noqa: ANN001, ANN201
        """Return the torques of hip and knee, N m."""
        down, forward = kinematics.foot_position(self.robot, meas_pos)
        rate, slip = kinematics.foot_velocity(self.robot, meas_pos, meas_vel)
        push = 50 * (self.desired_height / 0.3) ** 2 if rate > 0 and down < 0.24 else 0.0
        along = 800 * (0.2 - down) - 20 * rate + push
        sideways = -150 * forward - 5 * slip
        return kinematics.jacobian(self.robot, meas_pos).T @ np.array([along, sideways])


if __name__ == "__main__":
    from hopping_leg.controllers import RolloutConfig, rollout
    from hopping_leg.controllers.registry import load_controller
    from hopping_leg.robot import load_robot

    leg = load_robot("legv2-paper")
    bouncer = load_controller(f"{__file__}:Bouncer", leg)
    run = rollout(bouncer, RolloutConfig(leg), np.full((600, 2), 0.3), seed=0)
    clear = run.data["foot_clearance_m"][200:] > 0.003
    print(f"{bouncer.name}: foot off the ground {100 * clear.mean():.0f} % of the time")
