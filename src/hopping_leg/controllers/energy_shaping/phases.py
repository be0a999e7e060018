"""The state machine of the paper's Fig. 3, and touchdown without a sensor.

Touchdown: the ground pushes the leg together, or the flight PD resists it.
"""

from enum import IntEnum

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.controllers.energy_shaping.gains import ShapingGains
from hopping_leg.controllers.energy_shaping.virtual_leg import LegView, leg_force
from hopping_leg.robot import Robot, kinematics

PUSH_LIMIT = 0.4  # longest push, s: a leg without lift-off by then gives up and tries afresh
FLIGHT_LIMIT = 0.5  # longest flight, s: that of a jump by 0.3 m; beyond it, touchdown was missed
BRAKE_LIMIT = 0.25  # longest touchdown, s: the velocity of an overdamped leg never turns


class Phase(IntEnum):
    """What a leg is doing; the value is recorded in traces."""

    LIFTOFF = 0
    """Pushes off, on the ground."""
    FLIGHT = 1
    """Moves to the landing posture, in the air."""
    TOUCHDOWN = 2
    """Brakes the fall, on the ground."""


class Phases:
    """Phase of each leg, the one of value 0 at first, and the time spent in it.

    Attributes:
        phase: Values of ``Phase`` or another enumeration, (n,).
        clock: Time since the phase began, s, (n,).
    """

    def __init__(self, count: int) -> None:
        self.phase = np.zeros(count, np.int64)
        self.clock = np.zeros(count)

    def tick(self, period: float) -> None:
        """Let a control period pass, s."""
        self.clock = self.clock + period

    def are(self, phase: IntEnum) -> BoolArray:
        """Return which legs are in a phase, (n,)."""
        answer: BoolArray = self.phase == phase
        return answer

    def enter(self, who: BoolArray, phase: IntEnum, since: Array | float = 0.0) -> None:
        """Put legs into a phase that began ``since`` seconds ago, (n,)."""
        self.phase = np.where(who, int(phase), self.phase)
        self.clock = np.where(who, since, self.clock)


_MEMORY = 3


class TouchdownDetector:
    """Watches how n legs deviate from the planned retraction.

    ``debounced`` judges the median of three ticks: one noisy sample cannot fake a touchdown.
    """

    def __init__(self, robot: Robot, count: int, *, debounced: bool) -> None:
        self._robot, depth = robot, _MEMORY if debounced else 1
        self._excess = np.zeros((depth, count))
        self._resisting = np.zeros((depth, count))

    def update(self, leg: LegView, planned: Array, torque: Array, gains: ShapingGains) -> BoolArray:
        """Return which legs meet the ground, (n,): a soft one gives way, a stiff one resists.

        Planned are the joint velocities of the retraction, rad/s; torques are those of the flight
        PD, N m, (n, 2) each; the gains hold the thresholds.
        """
        along = kinematics.jacobian(self._robot, leg.q)[:, 0]
        excess = leg.rate - np.einsum("ni,ni->n", along, planned)
        force = leg_force(self._robot, leg.q, torque)
        for history, newest in ((self._excess, excess), (self._resisting, force)):
            history[1:] = history[:-1].copy()
            history[0] = newest
        yields: BoolArray = np.median(self._excess, axis=0) < gains.touchdown_rate
        resists: BoolArray = np.median(self._resisting, axis=0) > gains.touchdown_force
        return yields | resists
