"""The study's two experiments: train and hop on twins, or predict a shipped policy's hops."""

from typing import Any

from hopping_leg.errors import UsageError
from hopping_leg.sim_to_real.methods import FORETOLD
from hopping_leg.sim_to_real.study import Study
from hopping_leg.sim_to_real.transfer import (
    about,
    fit_row,
    fits,
    hops,
    records,
    transfer,
    work_through,
)
from studies.sim_to_real.effects import EFFECTS, HopWithout, effect_rows
from studies.sim_to_real.prediction import POLICY, Foretell, Meet, prediction_rows


def transfer_and_effects(study: Study, at_once: int) -> dict[str, Any]:
    """Run the transfer; if the study asks for it, also on twins that lack one effect at a time."""
    result = transfer(study, at_once)
    if study.effects:
        work_through([without(study)], at_once)
        first = [job for job in hops(study) if job.method == study.methods[0]]
        result["effects"] = effect_rows(first, without(study))
    return result


def predict(study: Study, at_once: int = 1) -> dict[str, Any]:
    """Compare what the methods' simulations foretell, without a training; return the numbers.

    Args:
        study: Which methods on which twins; what it says of trainings is not used.
        at_once: Jobs that run at the same time, each in a process of its own.

    Raises:
        UsageError: A method has no simulation of its own, or the folder holds results of other
            options.
    """
    for method in study.methods:
        if method.randomised:
            raise UsageError(
                f"The method '{method.name}' trains on many simulations, so that none foretells;"
                f" name others, e.g. {', '.join(FORETOLD)}."
            )
    work_through((records(study), fits(study), [*foretold(study), *met(study)]), at_once)
    return {
        **about(study),
        "policy": POLICY,
        "methods": prediction_rows(foretold(study), met(study)),
        "identification": [fit_row(fit) for fit in fits(study)],
    }


def without(study: Study) -> list[HopWithout]:
    """Return the trials on twins that lack one effect, if they were asked for."""
    return [
        HopWithout(study, twin, study.methods[0], seed, effect)
        for effect in (EFFECTS if study.effects else ())
        for seed in study.seeds
        for twin in study.twins
    ]


def foretold(study: Study) -> list[Foretell]:
    """Return what each method's simulation says of the shipped policy's hops."""
    return [Foretell(study, twin, method) for method in study.methods for twin in study.twins]


def met(study: Study) -> list[Meet]:
    """Return the same policy's hops on the twins."""
    return [Meet(study, twin) for twin in study.twins]
