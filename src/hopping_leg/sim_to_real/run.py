"""Record, identify, train and hop; what is done is not redone."""

from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

from hopping_leg.sim_to_real.board import Board
from hopping_leg.sim_to_real.fitting import Identify
from hopping_leg.sim_to_real.hopping import Hop
from hopping_leg.sim_to_real.methods import Method
from hopping_leg.sim_to_real.recording import Record
from hopping_leg.sim_to_real.study import Study, TwinFile
from hopping_leg.sim_to_real.tables import tabulate
from hopping_leg.sim_to_real.training import Train
from hopping_leg.sim_to_real.work import Job, work

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
    work_through((records(study), fits(study), trainings(study), hops(study)), at_once)
    return tabulate(study, fits(study), trainings(study), hops(study))


def work_through(stages: Sequence[Sequence[Job]], at_once: int) -> None:
    """Do what is not done of some stages, one stage after the other."""
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


def _all(study: Study) -> Iterable[tuple[int, Method, TwinFile]]:
    return ((s, m, t) for s in study.seeds for m in study.methods for t in study.twins)
