"""What every physics engine offers: many legs of one robot, stepped at the control rate."""

from abc import ABC, abstractmethod

import numpy as np

from hopping_leg.arrays import Array, IntArray
from hopping_leg.errors import UsageError
from hopping_leg.robot import CONTROL_RATE, Robot, kinematics
from hopping_leg.sim.stepper import LOADS

__all__ = ["CONTROL_RATE", "Simulator"]


class Simulator(ABC):
    """Simulations of one robot, advanced by one control period at a time.

    ``state`` (n, 6) is a live view of the true state (x, q1, q2 and their rates), and so are its
    parts ``height``, ``height_rate`` (n,), ``q`` and ``qd`` (n, 2), in m, m/s, rad and rad/s.
    One ``step`` lasts ``1 / rate``, Hz, which is a whole number of physics steps ``timestep``, s.

    Raises:
        UsageError: The physics step does not divide the control period.
    """

    state: Array
    height: Array
    height_rate: Array
    q: Array
    qd: Array

    def __init__(self, robot: Robot, count: int, rate: float, timestep: float) -> None:
        self.substeps = _substeps(rate, timestep)
        self.robot, self.count, self.rate, self.timestep = robot, count, rate, timestep
        self.geometry: kinematics.Geometry = robot
        """Lengths of the legs."""
        self.period = 1 / rate

    def _show(self, state: Array) -> None:
        """Name the parts of the state, which is changed in place from here on."""
        self.state = state
        self.height, self.height_rate = state[:, 0], state[:, 3]
        self.q, self.qd = state[:, 1:3], state[:, 4:6]

    @property
    def measured_q(self) -> Array:
        """Joint angles that the encoders report, rad, (n, 2)."""
        return self.q

    @property
    def measured_qd(self) -> Array:
        """Joint velocities that the encoders report, rad/s, (n, 2)."""
        return self.qd

    @property
    @abstractmethod
    def measured_torque(self) -> Array:
        """What the motors' torque measurement reports now, N m at the joints, (n, 2)."""

    @property
    def loads(self) -> Array:
        """What the last control period was for the motors, (n, 8), ``LOADS``; NaN if unknown."""
        return np.full((self.count, len(LOADS)), np.nan)

    def reseed(self, rng: np.random.Generator) -> None:  # noqa: B027
        """Take the legs' own randomness, if any, from here on from another source."""

    def forget(self, ids: IntArray | slice) -> None:  # noqa: B027
        """Let legs begin anew in their state: no command under way, clean readings."""

    @abstractmethod
    def place(self, ids: IntArray | slice, height: Array | float, q: Array) -> None:
        """Put legs at rest at a base height, m, (k,), and joint angles, rad, (k, 2) or (2,)."""

    @abstractmethod
    def step(self, torque: Array) -> Array:
        """Hold joint torques for one control period; return what the motors gave, N m, (n, 2)."""

    def stand(self, ids: IntArray | slice, q: Array, clearance: Array | float = 0.0) -> None:
        """Put legs at rest in a posture with the foot ``clearance`` above the ground, m, (k,).

        A foot on the ground touches it by a nanometre, so that no rounding decides.
        """
        self.place(ids, kinematics.stance_height(self.robot, q) + clearance - 1e-9, q)

    def foot_clearance(self) -> Array:
        """Return the gap between each foot and the ground, m, (n,)."""
        return kinematics.foot_clearance(self.geometry, self.height, self.q)

    def knee_clearance(self) -> Array:
        """Return the gap between each knee and the ground, m, (n,)."""
        return kinematics.knee_clearance(self.geometry, self.height, self.q)

    def base_clearance(self) -> Array:
        """Return the gap between each base and the ground, m, (n,)."""
        return kinematics.base_clearance(self.geometry, self.height)


def _substeps(rate: float, timestep: float) -> int:
    for name, value in (("control rate", rate), ("physics step", timestep)):
        if not 0 < value < np.inf:
            raise UsageError(f"The {name} is {value} but must be positive and finite.")
    substeps = round(1 / (rate * timestep))
    if substeps < 1 or abs(substeps * timestep * rate - 1) > 1e-9:
        raise UsageError(
            f"A physics step of {timestep} s does not divide the control period of"
            f" {1 / rate} s; take e.g. {1 / (rate * max(substeps, 1)):g} s."
        )
    return substeps
