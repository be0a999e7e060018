"""The whole study: record, identify, train, hop; each stage's jobs first from earlier runs."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from hopping_leg.evaluate.transfer.board import Board
from hopping_leg.evaluate.transfer.effects import EFFECTS, HopWithout, effect_rows
from hopping_leg.evaluate.transfer.fitting import Identify
from hopping_leg.evaluate.transfer.hopping import Hop
from hopping_leg.evaluate.transfer.methods import Method
from hopping_leg.evaluate.transfer.prediction import Foretell, Meet, prediction_rows
from hopping_leg.evaluate.transfer.recording import Record
from hopping_leg.evaluate.transfer.study import Study, TwinFile
from hopping_leg.evaluate.transfer.tables import tabulate
from hopping_leg.evaluate.transfer.training import Train
from hopping_leg.evaluate.transfer.work import Job, work

J = TypeVar("J", bound=Job)


def transfer(study: Study, at_once: int = 1) -> dict[str, Any]:
    """Run a study, or what is left of it, and return its numbers.

    Args:
        study: What is compared on which twins.
        at_once: Jobs that run at the same time, each in a process of its own.

    Raises:
        UsageError: The folder holds results of other options.
    """
    stages: Sequence[Sequence[Job]] = (
        records(study),
        fits(study),
        trainings(study),
        [*hops(study), *without(study), *foretold(study), *met(study)],
    )
    total = sum(job.weight for stage in stages for job in stage)
    with Board(total, own_bars=at_once == 1) as board:
        for stage in stages:
            work(stage, at_once, board)
    result = tabulate(study, fits(study), trainings(study), hops(study))
    result["prediction"] = prediction_rows(foretold(study), met(study))
    if study.effects:
        first = [job for job in hops(study) if job.method == study.methods[0]]
        result["effects"] = effect_rows(first, without(study))
    return result


def records(study: Study) -> list[Record]:
    """Return the recordings that the methods need."""
    rigs = {rig for method in study.compared if method.fit for rig in method.fit.rigs}
    return [Record(study, twin, rig) for twin in study.twins for rig in sorted(rigs)]


def fits(study: Study) -> list[Identify]:
    """Return all identifications, those of the first method first."""
    return [Identify(study, t, m) for m in study.compared if m.fit for t in study.twins]


def trainings(study: Study) -> list[Train]:
    """Return all trainings; several twins may share one."""
    every = (Train(study, t, m, s) for s, m, t in _all(study))
    return list({_folder(train): train for train in every}.values())


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
    methods = [m for m in study.compared if not m.randomised]
    return [Foretell(study, twin, method) for method in methods for twin in study.twins]


def met(study: Study) -> list[Meet]:
    """Return the same policy's hops on the twins."""
    return [Meet(study, twin) for twin in study.twins]


def _all(study: Study) -> Iterable[tuple[int, Method, TwinFile]]:
    return ((s, m, t) for s in study.seeds for m in study.methods for t in study.twins)


def _folder(train: Train) -> Path:
    return train.study.training(train.twin, train.method, train.seed)
