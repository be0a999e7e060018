"""The simulated leg that the drives turn: motors' side in, motors' side out.

The motors give what they can, up to their peak torque: what the software allows is for the host to
keep. A latency of commands in ``[reality]`` is left to the wire, as drives act on their own sensors
without it.
"""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.deploy.drive_link import joint_transforms
from hopping_leg.io import replace_at
from hopping_leg.robot import model as robot_model
from hopping_leg.robot.model_mismatch import STANDING_NOISE, SensorMismatch
from hopping_leg.robot.parameters import JOINTS, Robot
from hopping_leg.sim import LegSimulator

TIMESTEP = 5e-4  # Period of the drives' control, s; the physics steps more often within it
_LIFTED = 1e-3  # Way of a joint in such a period while somebody brings the leg back, rad


class EmulatedLeg:
    """One leg, stepped by one physics step at a time, from joint angles, rad, (2,), on the ground.

    What the robot's ``reality`` says holds; where that names no noise of a sensor it has
    ``STANDING_NOISE``, as no real one is without. All noise follows from the seed.
    """

    def __init__(self, robot: Robot, q: Array, seed: int) -> None:
        self.transforms = joint_transforms(robot)
        self.wiring = [1.0, 1.0]  # Joint angles as the drives believe them over the true ones
        free = replace_at(robot, "reality.latency.command", 0.0)
        free = replace_at(free, "reality.latency.jitter", 0.0)
        for joint, noise in zip(JOINTS, STANDING_NOISE, strict=True):
            peak = getattr(robot, joint).motor.peak_torque
            free = replace_at(free, f"{joint}.motor.torque_limit", peak)
            if getattr(robot.reality, joint).sensor == SensorMismatch():
                free = replace_at(free, f"reality.{joint}.sensor", noise)
        self._legs = LegSimulator(
            free, 1, rate=1 / TIMESTEP, timestep=robot_model.TIMESTEP, threads=1
        )
        self._legs.rng = np.random.default_rng(seed)
        self._start = np.asarray(q, np.float64)
        self._legs.stand(slice(None), self._start)

    @property
    def height(self) -> float:
        """Height of the base above the ground, m."""
        return float(self._legs.height[0])

    @property
    def foot_clearance(self) -> float:
        """Gap between foot and ground, m."""
        return float(self._legs.foot_clearance()[0])

    @property
    def q(self) -> Array:
        """True joint angles, rad, (2,)."""
        return np.array(self._legs.q[0])

    def sensed(self, joint: int) -> tuple[float, float, float]:
        """Return what one motor's sensors see: position, rev, velocity, rev/s, torque, N m."""
        transform, legs, ratio = self.transforms[joint], self._legs, self.wiring[joint]
        return (
            transform.motor_position(ratio * float(legs.measured_q[0, joint])),
            transform.motor_velocity(ratio * float(legs.measured_qd[0, joint])),
            transform.motor_torque(float(legs.measured_torque[0, joint]) / ratio),
        )

    def hold(self) -> None:
        """Stay at the start for a physics step, or near it; sensors report with other noise."""
        if (way := self._start - self._legs.q[0]).any():
            self._legs.stand(slice(None), self._legs.q[0] + np.clip(way, -_LIFTED, _LIFTED))
        self._legs.read_sensors()

    def step(self, motor_torque: tuple[float, float]) -> None:
        """Go on by one physics step with torques at the motors' outputs, N m."""
        wires = zip(self.transforms, self.wiring, motor_torque, strict=True)
        torques = [wire.joint_torque(torque) * ratio for wire, ratio, torque in wires]
        self._legs.step(np.array([torques]))
