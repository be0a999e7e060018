"""A chain of controllers, each of which takes over where the one before it cannot go on."""

from collections.abc import Callable

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers import registry
from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.protocol import Controller, Measurement
from hopping_leg.robot import Robot

_OUTSIDE_TICKS = 3
"""Ticks in a row in which inputs are outside the range of the training before it counts."""


class Fallback:
    """A policy with another controller behind it, for one leg; implements ``Controller``.

    It hands over, once and for good until ``reset``, where the policy raises an error, asks for a
    torque that is no number, or meets inputs far outside the range of its training
    (``Policy.outside``). ``report`` is called with the reason, a sentence. What the other
    controller raises ends the run.
    """

    def __init__(self, policy: Policy, other: Controller) -> None:
        self.policy, self.other, self.name = policy, other, policy.name
        self.report: Callable[[str], None] = lambda _: None
        self.reset(1)

    def reset(self, count: int) -> None:
        """Forget everything; the policy begins again. ``count`` must be 1."""
        self.policy.reset(count)
        self.other.reset(count)
        self._outside, self._active = 0, 0

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (1, 2)."""
        if self._active == 0:
            beyond = self.policy.outside(measurement)
            self._outside = self._outside + 1 if beyond else 0
            reason = beyond if self._outside >= _OUTSIDE_TICKS else ""
            if not reason:
                try:
                    torque = self.policy.act(measurement)
                    if np.isfinite(torque).all():
                        return torque
                    reason = "it asked for a torque that is no number"
                except Exception as error:  # the other controller goes on, whatever it was
                    reason = str(error).rstrip(".") or type(error).__name__
            self._active = 1
            self.report(f"{self.other.name} took over from {self.policy.name}: {reason}.")
        return self.other.act(measurement)

    def internals(self) -> dict[str, Array]:
        """Return which controller acts: 0 for the policy, 1 for the other."""
        return {"fallback": np.array([float(self._active)])}


def with_fallback(controller: Controller, robot: Robot) -> Controller:
    """Return a policy with what its robot's file names as ``hardware.fallback`` behind it.

    Other controllers, and policies for a robot that names none, are returned as they are.
    UsageError says that there is no such controller.
    """
    if not isinstance(controller, Policy) or not robot.hardware.fallback:
        return controller
    rate = controller.card.rate
    return Fallback(controller, registry.load_controller(robot.hardware.fallback, robot, rate=rate))
