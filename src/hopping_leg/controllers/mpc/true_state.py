"""MPC in the true state of simulated legs, by shooting on the stepper.

Everything but the push-off force follows from the command. While a leg pushes, the force is the one
with which a simulation of the hop's rest ends at the commanded apex; it is found anew in every
control period.
"""

from dataclasses import astuple, dataclass, fields, replace

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.controllers.mpc import hop_law
from hopping_leg.controllers.protocol import Measurement
from hopping_leg.robot import GRAVITY, Robot
from hopping_leg.sim import CONTROL_RATE, LegSimulator, stepper
from hopping_leg.sim.leg_table import leg_table

_TICKS = 200  # Control periods after which a simulated hop is given up
_FIRST_PUSH = 2.5  # Push-off force with which planning begins, over the weight


@dataclass(frozen=True)
class Planning:
    """How hops are simulated, and how often."""

    timestep: float = 1e-3
    """Physics step, s."""
    elastic_timestep: float = 2.5e-4
    """Physics step on the ground of a leg with an elastic transmission, s."""
    simulations: int = 5
    """Simulations per plan at most."""
    tolerance: float = 1e-4
    """Error of the apex that is good enough, m."""
    every: int = 1
    """Control periods between two plans of a push."""


@dataclass(frozen=True)
class HopShape:
    """What hops are like, on any leg: see ``hop_law`` for the units.

    The defaults come of a search on rigid legs, but for ``squat_per_drop``, which is less than it
    found, for the knee of a leg with a belt to stay off the ground.
    """

    flight_length: float = 0.68
    """Length from hip to foot in flight."""
    clearance: float = 0.2
    """Least gap between the foot in flight and the ground at the apex."""
    knee_gap: float = 0.04
    """Least gap between knee and ground."""
    squat: float = 0.61
    """Height of the hip, less the foot's radius, at which landing ends."""
    squat_per_drop: float = 0.2
    """By how much lower it ends per height that the leg falls."""
    liftoff: float = 0.81
    """Height of the hip at which the push ends at most: with a longer leg the knee would be too
    fast for its motor."""
    least_push: float = 0.12
    """What the lowest hops end the push above the length in flight."""
    liftoff_per_drop: float = 0.13
    """How much further hops end it per height that they fall."""
    taper: float = 0.16
    """Way over which the push fades."""
    braking: float = 0.81
    """Deceleration of the landing from which on the leg brakes, over that of the whole way."""
    most_landing: float = 7.12
    """Largest force on landing."""
    fold: float = 0.3
    """Force at most with which a leg that stands folds; a negative one pulls the hip down."""
    lean_from: float = 2.0
    """Push-off force beyond which the foot also pushes forward."""
    lean: float = 0.093
    """By how much of the force, per force beyond that."""
    most_lean: float = 0.22
    """Largest share of the force with which it does."""
    sideways_stiffness: float = 3.24
    """Stiffness that keeps the foot below the hip on the ground."""
    sideways_damping: float = 0.47
    """Damping of the same."""
    hip_stiffness: float = 2.44
    """Stiffness of the hip in flight."""
    hip_damping: float = 0.5
    """Damping of the same."""
    knee_stiffness: float = 1.35
    """Stiffness of the knee in flight."""
    knee_damping: float = 0.44
    """Damping of the same."""
    slew: float = 0.9
    """By how much a torque may change in a control period."""


_SHAPE = np.dtype([(field.name, np.float64) for field in fields(HopShape)])


class TrueStateMpc:
    """Controls simulated legs whose true state it sees: what a perfect estimate would be worth.

    Plans are on the leg's true parameters, at a control rate in Hz. Legs that differ are planned
    for each as it is.
    """

    name = "mpc-true-state"

    def __init__(
        self,
        robot: Robot,
        shape: HopShape | None = None,
        planning: Planning | None = None,
        *,
        rate: float = CONTROL_RATE,
    ) -> None:
        self.robot, self.planning, self.period = robot, planning or Planning(), 1 / rate
        self._shapes = np.array([astuple(shape or HopShape())], _SHAPE)

    def watch(self, legs: LegSimulator) -> None:
        """Take the legs, live."""
        self._legs = legs

    def reset(self, count: int) -> None:
        """Forget everything; the next measurement has ``count`` rows."""
        self._phase = np.full(count, float(hop_law.LANDING))
        self._torque = np.zeros((count, 2))
        self._scratch = np.zeros(2 * count, stepper.MEMORY)
        self._hops = np.zeros(count, hop_law.HOP)
        self._hops["push"] = _FIRST_PUSH * self.robot.mass * GRAVITY
        self._known: tuple[Robot, ...] = ()

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2)."""
        return self.torque(measurement.command[:, 0])

    def torque(self, command: Array) -> Array:
        """Return joint torques for desired apexes, m, (n,), in the true state, N m, (n, 2)."""
        legs, how = self._legs, self.planning
        if legs.robots is not self._known:
            self._plan_for(legs.robots)
        state, memory = legs.state, legs.records
        legs.in_parallel(
            lambda first, last: hop_law.act(
                self._ground, self._air, self._shapes, state, memory, self._phase, command,
                self._hops, self._torque, self._scratch, self._steps, first, last, how.simulations,
                how.tolerance, how.every, self.period, round(self.period / how.timestep), _TICKS,
            )
        )  # fmt: skip
        return self._torque.copy()

    def _plan_for(self, robots: tuple[Robot, ...]) -> None:
        self._known, how = robots, self.planning
        self._air = leg_table([_rigid(robot) for robot in robots], how.timestep)
        self._ground = self._air.copy()
        self._steps = np.full(len(robots), round(self.period / how.timestep))
        elastic = np.flatnonzero(self._legs.table["elastic"].any(axis=1))
        if len(elastic):
            self._ground[elastic] = leg_table([robots[k] for k in elastic], how.elastic_timestep)
            self._steps[elastic] = round(self.period / how.elastic_timestep)

    @property
    def pushing(self) -> BoolArray:
        """Which legs push, (n,)."""
        pushing: BoolArray = self._phase == hop_law.PUSH
        return pushing

    @property
    def folding(self) -> BoolArray:
        """Which legs have to fold on the ground, (n,): they stand, or have pushed off."""
        legs = self._legs
        rests = (self._phase == hop_law.LANDING) & (np.abs(legs.height_rate) < hop_law.REST_SPEED)
        leaves = (self._phase == hop_law.FLIGHT) & (legs.foot_clearance() <= 0)
        folding: BoolArray = rests | leaves
        return folding

    def state(self) -> dict[str, Array]:
        """Return what is remembered from tick to tick."""
        remembered = {name: self._hops[name].copy() for name in ("push", "unplanned")}
        return {"phase": self._phase.copy(), **remembered}

    def restore(self, state: dict[str, Array]) -> None:
        """Go on from a ``state``."""
        self._phase[:] = state["phase"]
        for name in ("push", "unplanned"):
            self._hops[name] = state[name]

    def internals(self) -> dict[str, Array]:
        """Return the phase and the push-off force, N."""
        return {"phase": self._phase, "push_force_n": self._hops["push"]}


def _rigid(robot: Robot) -> Robot:
    """Return a robot without elastic transmissions, whose springs need a finer physics step."""
    reality = robot.reality
    hip, knee = (replace(j, stiffness=None, backlash=0.0) for j in (reality.hip, reality.knee))
    return replace(robot, reality=replace(reality, hip=hip, knee=knee))
