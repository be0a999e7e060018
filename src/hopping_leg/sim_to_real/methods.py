"""What a policy is trained on before it meets the twin: the paper's method and its alternatives."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from hopping_leg.controllers.registry import ENERGY_SHAPING
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.identify.recording_format import Rig

Search = Literal["least-squares", "two-pass", "one-pass"]

Ranges = Literal["none", "twins", "surprises"]
"""From which every leg in training draws its own numbers, as in ``hop train --randomise``."""


@dataclass(frozen=True)
class Fit:
    """How the simulation is fitted to recordings of the twin.

    Attributes:
        name: Of its files; methods may share a fit.
        rigs: Whose recordings are used.
        search: ``least-squares`` on positions and torques, the paper's ``two-pass`` CMA-ES on
            positions, or ``one-pass``, the same over all parameters at once.
    """

    name: str = "identified"
    rigs: tuple[Rig, ...] = ("fixed-base", "rail")
    search: Search = "least-squares"


@dataclass(frozen=True)
class Method:
    """Where a policy is trained.

    Attributes:
        name: On the command line and in the results.
        meaning: A phrase for tables.
        fit: How the twin is identified; None if it is not.
        robot: Robot that is trained on without a fit; None takes the one that the twin extends.
        ranges: What every leg in training draws for itself, around the robot.
        truth: Whether the twin's own file is the robot, [reality] left out but for the delay:
            what a perfect fit would find.
        controller: Shipped controller that hops as it is, without a training.
    """

    name: str
    meaning: str
    fit: Fit | None = None
    robot: str | None = None
    ranges: Ranges = "none"
    truth: bool = False
    controller: str | None = None

    @property
    def randomised(self) -> bool:
        """Whether legs differ in training."""
        return self.ranges != "none"

    @property
    def of_twin(self) -> bool:
        """Whether every twin needs a training of its own."""
        return self.fit is not None or self.truth


METHODS = {
    method.name: method
    for method in (
        Method("identified", "identified from both recordings", Fit()),
        Method("cad", "CAD defaults"),
        Method("table-1", "the paper's Table I", robot="legv2-paper"),
        Method("randomised", "domain randomisation over the twins' ranges", ranges="twins"),
        Method(
            "identified-surprises", "identified, every leg surprising", Fit(), ranges="surprises"
        ),
        Method("cad-surprises", "CAD defaults, every leg surprising", ranges="surprises"),
        Method("rail-only", "identified from the rail alone", Fit("rail-only", rigs=("rail",))),
        Method(
            "fixed-base-only",
            "identified with the base clamped",
            Fit("fixed-base-only", rigs=("fixed-base",)),
        ),
        Method("two-pass", "the paper's two passes of CMA-ES", Fit("two-pass", search="two-pass")),
        Method("one-pass", "the same CMA-ES in one pass", Fit("one-pass", search="one-pass")),
        Method("truth", "true parameters: what a perfect fit would find", truth=True),
        Method(ENERGY_SHAPING, "energy shaping, tuned, untouched", controller=ENERGY_SHAPING),
    )
}
"""Every method by name."""

DEFAULT = ("identified", "cad", "table-1", "randomised", ENERGY_SHAPING)
"""What policies are trained on, and what they hop beside, unless asked otherwise."""

FORETOLD = (
    "identified", "cad", "table-1", "rail-only", "fixed-base-only", "two-pass", "one-pass", "truth",
)  # fmt: skip
"""Whose predictions are compared unless asked otherwise, ablations of identification among them."""


def choose_methods(names: Sequence[str]) -> list[Method]:
    """Return methods by name.

    Raises:
        UsageError: There is no such method, one is named twice, or none is named.
    """
    for name in names:
        if name not in METHODS:
            raise UsageError(unknown_name("method", name, METHODS))
        if list(names).count(name) > 1:
            raise UsageError(f"The method '{name}' is named twice; name it once.")
    if not names:
        raise UsageError(f"No method is left; name some of: {', '.join(METHODS)}.")
    return [METHODS[name] for name in names]
