"""The shooting controller: knows the true state and plans on the stepper."""

from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array, IntArray
from hopping_leg.controllers.protocol import Measurement
from hopping_leg.controllers.shooting import hop_law
from hopping_leg.errors import UsageError
from hopping_leg.robot import GRAVITY, Robot
from hopping_leg.sim import CONTROL_RATE, LegSimulator, Simulator, stepper
from hopping_leg.sim.leg_table import leg_table

_WEIGHTS = (0.2, 14.0)
"""Least and greatest push-off force over the weight."""

_TICKS = 200
"""Control periods after which a simulated hop is given up."""

_TRIES = 8
"""Simulations per push and control period at most."""


@dataclass(frozen=True)
class HopShape:
    """What a hop is like beside its push-off force; lengths are shares of the stretched leg's."""

    flight_length: float = 0.66
    """From hip to foot in flight."""
    clearance: float = 0.15
    """Least gap between the foot in flight and the ground at the apex."""
    stroke: float = 0.34
    """By how much the leg shortens on landing."""
    least_force: float = 2.0
    """Least force on landing, over the weight."""
    liftoff: float = 0.74
    """Height of the hip above the ground, less the foot, at which the push ends: with a longer leg
    the knee would be too fast for its motor."""
    least_push: float = 0.1
    """What the lowest hops end the push above the length in flight."""
    taper: float = 0.1
    """Way over which the push fades."""
    sideways: tuple[float, float] = (200.0, 5.0)
    """Stiffness, N/m, and damping, N s/m, that keep the foot below the hip on the ground."""
    hip: tuple[float, float] = (10.0, 0.3)
    """Stiffness, N m/rad, and damping, N m s/rad, of the hip in flight."""
    knee: tuple[float, float] = (8.0, 0.25)
    """Of the knee."""
    slew: float = 4.0
    """By how much a torque may change in a control period, N m."""

    def hops(self, robot: Robot, command: Array) -> Array:
        """Return the numbers of hops to heights, m, (n, 4), the push-off force a first guess."""
        reach = robot.thigh.length + robot.shank.length
        foot, weight = robot.foot.radius, robot.mass * GRAVITY
        flight = np.minimum(self.flight_length * reach, command - foot - self.clearance * reach)
        drop = np.maximum(command - foot - flight, 0.0)
        landing = np.maximum(1 + drop / (self.stroke * reach), self.least_force) * weight
        liftoff = np.minimum(flight + self.least_push * reach + drop / 8, self.liftoff * reach)
        return np.stack([landing, 1.2 * landing, liftoff, flight], axis=1)


class Shooting:
    """Controls simulated legs whose true state it sees: what a perfect estimate would be worth.

    Everything but the push-off force follows from the command. While a leg pushes, the force is the
    one with which a simulation of the hop's rest, on the leg's true parameters, ends at the
    commanded apex; it is found anew in every control period.

    Args:
        robot: The leg.
        shape: What hops are like.
        rate: Control rate, Hz.
        timestep: Physics step of the simulated hops, s.
    """

    name = "shooting"

    def __init__(
        self,
        robot: Robot,
        shape: HopShape | None = None,
        *,
        rate: float = CONTROL_RATE,
        timestep: float = 1e-3,
    ) -> None:
        self.robot, self.shape, self.timestep = robot, shape or HopShape(), timestep
        reach = robot.thigh.length + robot.shank.length
        shape = self.shape
        self._settings = np.array(
            [shape.taper * reach, *shape.sideways, *shape.hip, *shape.knee, shape.slew]
        )
        self._limits = np.array(_WEIGHTS) * robot.mass * GRAVITY
        self._steps = round(1 / (rate * timestep))

    def watch(self, legs: Simulator) -> None:
        """Take the legs, live.

        Raises:
            UsageError: They are of another engine than the stepper.
        """
        if not isinstance(legs, LegSimulator):
            raise UsageError("Shooting plans on the engine stepper; leave --engine out.")
        self._legs = legs

    def reset(self, count: int) -> None:
        """Forget everything; the next measurement has ``count`` rows."""
        self._phase = np.full(count, float(hop_law.LANDING))
        self._torque = np.zeros((count, 2))
        self._hops = np.full((count, hop_law.NUMBERS), np.nan)
        self._command = np.full(count, np.nan)
        self._scratch = np.zeros(count, stepper.MEMORY)
        self._table = leg_table([self.robot] * count, self.timestep)

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2)."""
        return self.torque(measurement.command[:, 0])

    def torque(self, command: Array) -> Array:
        """Return joint torques for desired apexes, m, (n,), in the true state, N m, (n, 2)."""
        legs = self._legs
        changed = command != self._command
        if changed.any():
            push = self._hops[:, 1].copy()
            self._hops[changed] = self.shape.hops(self.robot, command[changed])
            self._hops[:, 1] = np.where(np.isfinite(push), push, self._hops[:, 1])
            self._command = command.copy()
        state = np.ascontiguousarray(legs.state)
        hop_law.set_phases(self._table, state, self._phase, self._hops)
        acceleration, motor = legs.solution
        legs.in_parallel(
            lambda first, last: hop_law.plan(
                self._table, self._settings, state, acceleration, motor, self._phase, command,
                self._hops, self._torque, self._limits, self._scratch, first, last, _TRIES,
                self._steps, self.timestep, _TICKS,
            )
        )  # fmt: skip
        hop_law.set_torques(
            self._table, self._settings, state, self._phase, self._hops, self._torque
        )
        return self._torque.copy()

    def begin(self, rows: IntArray) -> None:
        """Let some legs begin anew, from rest."""
        self._torque[rows] = 0.0

    def take_applied(self, torque: Array) -> None:
        """Take what was commanded instead of what ``torque`` returned, N m, (n, 2)."""
        self._torque[:] = torque

    def state(self) -> dict[str, Array]:
        """Return what is remembered from tick to tick."""
        return {
            "phase": self._phase.copy(),
            "torque": self._torque.copy(),
            "hops": self._hops.copy(),
            "command": self._command.copy(),
        }

    def restore(self, state: dict[str, Array]) -> None:
        """Go on from a ``state``."""
        self._phase[:], self._torque[:] = state["phase"], state["torque"]
        self._hops[:], self._command[:] = state["hops"], state["command"]

    def internals(self) -> dict[str, Array]:
        """Return the phase and the push-off force, N."""
        return {"phase": self._phase, "push_force_n": self._hops[:, 1]}
