"""What policies are trained on before they meet a twin, and what they hop beside."""

from collections.abc import Sequence
from dataclasses import dataclass

from hopping_leg.controllers.registry import ENERGY_SHAPING, ENERGY_SHAPING_TUNED
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.rl.recipes import Randomise


@dataclass(frozen=True)
class Method:
    """Where a policy is trained.

    Attributes:
        name: On the command line and in the results.
        meaning: A phrase for tables.
        fit: Name of the fit to recordings of the twin whose result is simulated; empty for none.
        search: Search of that fit, as in `hop identify`.
        belt: Whether the fit and training know a belt, with assumed backlash and jitter.
        robot: Robot that is trained on without a fit; None takes the one that the twin extends.
        ranges: What every leg in training draws for itself, around the robot.
        truth: Whether the twin's own file is the robot, [reality] left out but for the delay:
            what a perfect fit would find.
        untrained: Controller that hops as it is; empty where there is a training. It is told the
            robot that the fit gives, or else the one that the twin extends.
        tuned: Whether the gains of an untrained energy shaping are searched anew on that robot.
    """

    name: str
    meaning: str
    fit: str = ""
    search: str = "least-squares"
    belt: bool = False
    robot: str | None = None
    ranges: Randomise = "none"
    truth: bool = False
    untrained: str = ""
    tuned: bool = False


METHODS = {
    method.name: method
    for method in (
        Method("identified", "identified from both recordings", fit="identified"),
        Method("identified-belt", "identified, with the knee's belt", "identified-belt", belt=True),
        Method("two-pass", "the paper's two passes of CMA-ES", "two-pass", "two-pass"),
        Method("cad", "CAD defaults"),
        Method("table-1", "the paper's Table I", robot="legv2-paper"),
        Method("randomised", "domain randomisation over the twins' ranges", ranges="twins"),
        Method("truth", "true parameters: what a perfect fit would find", truth=True),
        Method(ENERGY_SHAPING, "energy shaping, shipped gains", untrained=ENERGY_SHAPING),
        Method(
            ENERGY_SHAPING_TUNED,
            "energy shaping, tuned on other twins",
            untrained=ENERGY_SHAPING_TUNED,
        ),
        Method(
            "energy-shaping-identified",
            "energy shaping, tuned on what is identified with the belt",
            fit="identified-belt",
            belt=True,
            untrained=ENERGY_SHAPING,
            tuned=True,
        ),
    )
}
"""Every method by name."""

DEFAULT = ("identified", "cad", "table-1", "randomised")
"""What policies are trained on, and what they hop beside, unless asked otherwise."""


def choose_methods(names: Sequence[str]) -> tuple[Method, ...]:
    """Return methods by name, each once, and both energy shapings; UsageError without any."""
    for name in names:
        if name not in METHODS:
            raise UsageError(unknown_name("method", name, METHODS))
    if not names:
        raise UsageError(f"No method is left; name some of: {', '.join(METHODS)}.")
    return tuple(
        METHODS[name] for name in dict.fromkeys((*names, ENERGY_SHAPING, ENERGY_SHAPING_TUNED))
    )
