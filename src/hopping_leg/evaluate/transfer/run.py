"""Whole studies: record, identify, then train and hop, or foretell; what is done is not redone."""

from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

from hopping_leg.errors import UsageError
from hopping_leg.evaluate.transfer.board import Board
from hopping_leg.evaluate.transfer.effects import EFFECTS, HopWithout, effect_rows
from hopping_leg.evaluate.transfer.fitting import Identify
from hopping_leg.evaluate.transfer.hopping import Hop
from hopping_leg.evaluate.transfer.methods import FORETOLD, Method
from hopping_leg.evaluate.transfer.prediction import POLICY, Foretell, Meet, prediction_rows
from hopping_leg.evaluate.transfer.recording import Record
from hopping_leg.evaluate.transfer.study import Study, TwinFile
from hopping_leg.evaluate.transfer.tables import about, fit_row, tabulate
from hopping_leg.evaluate.transfer.training import Train
from hopping_leg.evaluate.transfer.work import Job, work

J = TypeVar("J", bound=Job)


def transfer(study: Study, at_once: int = 1) -> dict[str, Any]:
    """Run a study, or what is left of it, and return its numbers.

    Args:
        study: What is compared on which twins.
        at_once: Jobs that run at the same time, each in a process of its own.

    Raises:
        UsageError: The folder holds results of other options, or there is no such recipe.
    """
    for training in trainings(study):
        training.recipe()
    _work((records(study), fits(study), trainings(study), [*hops(study), *without(study)]), at_once)
    result = tabulate(study, fits(study), trainings(study), hops(study))
    if study.effects:
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
    _work((records(study), fits(study), [*foretold(study), *met(study)]), at_once)
    return {
        **about(study),
        "policy": POLICY,
        "methods": prediction_rows(foretold(study), met(study)),
        "identification": [fit_row(fit) for fit in fits(study)],
    }


def _work(stages: Sequence[Sequence[Job]], at_once: int) -> None:
    total = sum(job.weight for stage in stages for job in stage)
    with Board(total, own_bars=at_once == 1) as board:
        for stage in stages:
            work(stage, at_once, board)


def records(study: Study) -> list[Record]:
    """Return the recordings that the methods need."""
    rigs = {rig for method in study.methods if method.fit for rig in method.fit.rigs}
    return [Record(study, twin, rig) for twin in study.twins for rig in sorted(rigs)]


def fits(study: Study) -> list[Identify]:
    """Return all identifications, those of the first method first; several may share one."""
    every = (Identify(study, t, m) for m in study.methods if m.fit for t in study.twins)
    return list({study.fitted(fit.twin, fit.method): fit for fit in every}.values())


def trainings(study: Study) -> list[Train]:
    """Return all trainings; several twins may share one."""
    every = (Train(study, t, m, s) for s, m, t in _all(study))
    return list({train.path: train for train in every}.values())


def hops(study: Study) -> list[Hop]:
    """Return all trials."""
    return [Hop(study, t, m, s) for s, m, t in _all(study)]


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


def _all(study: Study) -> Iterable[tuple[int, Method, TwinFile]]:
    return ((s, m, t) for s in study.seeds for m in study.methods for t in study.twins)
