"""The paper's two passes: friction, damping and armature first, then everything within bounds.

"The parameters that can be roughly estimated during modeling, i.e. link inertia and solver
parameters, are fixed in a first optimization pass. In a second pass, we optimize all dynamic and
solver parameters while placing bounds on the friction, damping, and armature parameters derived
from the first pass."
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from hopping_leg.identify.least_squares import Found
from hopping_leg.identify.leg_hypothesis import LegHypothesis
from hopping_leg.identify.parameters import ParameterSet, choose, narrowed
from hopping_leg.identify.recording_format import Rig

JOINT_PARAMETERS = tuple(
    f"{joint}.{name}" for joint in ("hip", "knee") for name in ("friction", "damping", "armature")
)
"""Table I, hip and knee."""
RAIL_PARAMETERS = ("rail.friction", "rail.damping")
"""Table I, rail."""
INERTIAS = ("thigh.inertia", "shank.inertia")
"""Table I, link inertias, fixed in the first pass."""
SOLVER_PARAMETERS = ("contact.time_constant", "contact.damping_ratio")
"""Table I, the contact's, fixed in the first pass."""

Search = Callable[[str, ParameterSet], Found]
"""From the pass's name and its parameters to where the search ended."""


@dataclass(frozen=True)
class TwoPass:
    """Both passes' parameters and results."""

    first_parameters: ParameterSet
    first: Found
    second_parameters: ParameterSet
    second: Found

    @property
    def best(self) -> LegHypothesis:
        """What the second pass found."""
        return self.second_parameters.hypotheses(self.second.vector[None])[0]


def pass_names(rigs: Sequence[Rig]) -> tuple[list[str], list[str]]:
    """Return the parameters of the first pass and those that the second one adds.

    Args:
        rigs: Of the recordings; without a moving base nothing is known of rail and contact.
    """
    moving = any(rig != "fixed-base" for rig in rigs)
    first = [*JOINT_PARAMETERS, *(RAIL_PARAMETERS if moving else ())]
    return first, [*INERTIAS, *(SOLVER_PARAMETERS if moving else ())]


def two_pass(
    base: LegHypothesis,
    rigs: Sequence[Rig],
    search: Search,
    *,
    further: Sequence[str] = (),
    start: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    factor: float = 2.0,
) -> TwoPass:
    """Identify as the paper does.

    Args:
        base: Where both passes start.
        rigs: Of the recordings.
        search: CMA-ES, least squares or both; called as ``search("first", parameters)``.
        further: Parameters beyond Table I that both passes fit, e.g. the drives' gains.
        start: Starting values that differ from the hypothesis's.
        bounds: Bounds that differ from the widest ones.
        factor: The second pass keeps the first one's parameters within this factor.

    Raises:
        UsageError: A parameter does not exist or bounds exclude its start.
    """
    names, added = pass_names(rigs)
    every, start = {**(bounds or {})}, {**(start or {})}
    first_names = [*names, *(n for n in further if n not in names and n not in added)]
    first_set = choose(base, first_names, bounds=every, start=start)
    first = search("first", first_set)
    found = first_set.values(first.vector)
    kept = narrowed(first_set, found, factor, names)
    for p in kept.parameters:
        start[p.name], every[p.name] = p.start, (p.low, p.high)
    second_set = choose(base, [*first_names, *added], bounds=every, start=start)
    return TwoPass(first_set, first, second_set, search("second", second_set))
