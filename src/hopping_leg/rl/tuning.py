"""Search a recipe's numbers with Optuna: each trial is a training, its score that of `hop train`.

The study lives in a database, a SQLite file unless another is named. Every process that is given
the same study takes part in it, and a killed one leaves its trial to the next, which goes on from
the training's checkpoint where it can reach it.
"""

import dataclasses
import math
import shutil
import time
import warnings
from pathlib import Path
from typing import Any

import optuna
from optuna.exceptions import ExperimentalWarning
from optuna.importance import get_param_importances
from optuna.pruners import MedianPruner
from optuna.samplers import TPESampler
from optuna.storages import RDBStorage, fail_stale_trials
from optuna.study import Study
from optuna.trial import FrozenTrial, Trial, TrialState
from sqlalchemy import Connection, Engine, event
from sqlalchemy.exc import SQLAlchemyError

from hopping_leg.errors import PhysicsError, UsageError
from hopping_leg.io import plain, versions
from hopping_leg.rl import policy_evaluation, recipes, run_folder
from hopping_leg.rl.recipe import Recipe
from hopping_leg.rl.search_space import Tuning, defaults
from hopping_leg.rl.train import train
from hopping_leg.robot import load_robot
from hopping_leg.sim import compile_physics
from hopping_leg.workers import ProcessWorkers, RayWorkers

FOLDER, ERROR = "folder", "error"
"""Attributes of a trial: number of the trial whose folder it goes on in; why it failed."""


def record(study: Study) -> dict[str, Any]:
    """Return all trials, the best, and each number's importance (PED-ANOVA), as JSON values."""
    trials = study.get_trials(deepcopy=False)
    done = [t for t in trials if t.state is TrialState.COMPLETE]
    best = min(done, key=lambda t: float(t.value or 0.0)) if done else None
    importance = {}
    if len(done) >= 4 and len({trial.value for trial in done}) > 1:
        importance = {k: float(share) for k, share in get_param_importances(study).items()}
    return {
        "trials": [_row(trial) for trial in trials],
        "best": None if best is None else _row(best),
        "importance": importance,
        "versions": versions("hopping-leg", "optuna", "torch", "mujoco"),
    }


def _row(trial: FrozenTrial) -> dict[str, Any]:
    began, ended = trial.datetime_start, trial.datetime_complete or None
    return {
        "number": trial.number,
        "state": trial.state.name.lower(),
        "score_m": trial.value if trial.state is TrialState.COMPLETE else None,
        "snapshots_m": [trial.intermediate_values[k] for k in sorted(trial.intermediate_values)],
        "params": trial.params,
        "minutes": (ended - began).total_seconds() / 60 if began and ended else None,
        "goes_on_from": trial.user_attrs.get(FOLDER),
        "error": trial.user_attrs.get(ERROR),
    }


_FAILURES = (PhysicsError, ValueError, FloatingPointError)
"""What a training with bad numbers may end in; the study goes on."""


class _SurplusError(Exception):
    """A trial more than the study wants."""


_CAUGHT = (*_FAILURES, _SurplusError)

_ENDED = (TrialState.COMPLETE, TrialState.PRUNED)
_BEGUN = (*_ENDED, TrialState.RUNNING)
_LOOK_EVERY = 1.0  # s, for the last trials of others

_PATIENCE = 60.0
"""How long a worker waits for others to let go of SQLite's file, s."""


def conditions(tuning: Tuning) -> dict[str, Any]:
    """Return what all trials of a study share, as JSON values; ``UsageError`` without a space."""
    if tuning.recipe not in recipes.SPACES:
        raise UsageError(
            f"Recipe '{tuning.recipe}' has no search space; valid: {', '.join(recipes.SPACES)}."
        )
    return {
        "recipe": tuning.recipe,
        "robot_digest": load_robot(tuning.robot).digest,
        "steps": tuning.steps,
        "snapshots": tuning.snapshots,
        "training_seed": tuning.seed,
        "selection_seeds": [policy_evaluation.FIRST_SEED, *policy_evaluation.FINAL_SEEDS],
        "fixed": list(tuning.set),
        "space": {n: dataclasses.asdict(d) for n, d in recipes.SPACES[tuning.recipe].items()},
    }


def tune(tuning: Tuning, workers: int | None = None, ray: str | None = None) -> dict[str, Any]:
    """Search until the study has all its trials; return them, see ``record``.

    ``workers`` are processes on this machine, one by default, or tasks of the Ray cluster at
    ``ray``, ``local`` for one on this machine, one per CPU. Raises ``UsageError`` where the
    database cannot be used or reached, holds another study, or there is no such cluster.
    """
    cluster = None if ray is None else _reach(tuning, ray, workers)
    if tuning.study is None or "://" not in tuning.study:
        Path(tuning.storage.removeprefix("sqlite:///")).parent.mkdir(parents=True, exist_ok=True)
    study = open_study(tuning)
    if cluster is not None:
        # Workers start in folders of their own.
        robot = tuning.robot
        robot = str(Path(robot).resolve()) if robot.endswith(".toml") else robot
        here = dataclasses.replace(
            tuning, study=tuning.storage, out=tuning.folder.resolve(), robot=robot
        )
        cluster.map(work, ((here, k) for k in range(cluster.count)))
    else:
        compile_physics()
        with ProcessWorkers(workers or 1) as processes:
            processes.map(work, ((tuning, k) for k in range(processes.count)))
    return {**conditions(tuning), "robot": tuning.robot, **record(study)}


def work(tuning: Tuning, worker: int = 0) -> None:
    """Take trials of a study until it has all of them; any process on any machine may.

    The last ones that others train are waited for: one that gives no sign of life is taken up.
    """
    study = open_study(tuning, worker)
    while _trials(study, *_ENDED) < tuning.trials:
        if _trials(study, *_BEGUN) < tuning.trials:
            study.optimize(lambda trial: _run_trial(trial, tuning), n_trials=1, catch=_CAUGHT)
        else:
            time.sleep(_LOOK_EVERY)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ExperimentalWarning)
                fail_stale_trials(study)


def open_study(tuning: Tuning, worker: int = 0) -> Study:
    """Return the study, new or as it stands; ``UsageError`` where the database cannot be used."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    wanted = conditions(tuning)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ExperimentalWarning)
            storage = _open_storage(tuning)
            study = optuna.create_study(
                storage=storage,
                study_name=tuning.recipe,
                direction="minimize",
                load_if_exists=True,
                pruner=MedianPruner(n_startup_trials=tuning.startup),
            )
    except (SQLAlchemyError, ImportError) as error:
        raise UsageError(
            f"Cannot use the database {tuning.storage}: {str(error).splitlines()[0]}."
        ) from error
    for name, value in wanted.items():
        stored = study.user_attrs.get(name)
        if stored is None:
            study.set_user_attr(name, value)
        elif stored != plain(value):
            raise UsageError(
                f"The study in {tuning.storage} was begun with another '{name}'; go on with the"
                " options that it began with, or name another --study."
            )
    # Each call draws anew: with the same seed a resumed search would repeat its first trials.
    begun = len(study.get_trials(deepcopy=False))
    study.sampler = TPESampler(
        n_startup_trials=tuning.startup,
        constant_liar=True,
        seed=10_007 * begun + 97 * worker + tuning.seed,
    )
    if not begun:
        study.enqueue_trial(
            defaults(_recipe(tuning), recipes.SPACES[tuning.recipe]), skip_if_exists=True
        )
    return study


def _open_storage(tuning: Tuning) -> RDBStorage:
    """Return the study's database, in which a trial is given to one worker only."""
    storage = RDBStorage(
        tuning.storage,
        engine_kwargs={"connect_args": {"timeout": _PATIENCE}} if tuning.in_file else None,
        heartbeat_interval=tuning.heartbeat,
        grace_period=3 * tuning.heartbeat,
        heartbeat_stale_trial_callback=_take_up,
    )
    if tuning.in_file:
        _lock_before_reading(storage.engine)
    return storage


def _lock_before_reading(engine: Engine) -> None:
    """Let SQLite's transactions lock the file before they read.

    Optuna locks the row of a waiting trial, reads that it still waits and takes it. SQLite has no
    locks of rows: two workers would find the same trial waiting, and train in the same folder.
    """

    def begin_by_hand(connection: Any, _record: Any) -> None:  # noqa: ANN401
        connection.isolation_level = None

    def begin(connection: Connection) -> None:
        connection.exec_driver_sql("BEGIN IMMEDIATE")

    event.listen(engine, "connect", begin_by_hand)
    event.listen(engine, "begin", begin)
    engine.dispose()  # what was connected before begins as before


def _run_trial(trial: Trial, tuning: Tuning) -> float:
    """Train with a trial's numbers; return the score of the policy it selects, m."""
    if _trials(trial.study, *_BEGUN, before=trial.number) >= tuning.trials:
        raise _SurplusError  # others asked for the last one at the same time
    space = recipes.SPACES[tuning.recipe]
    values = {name: found.suggest(trial, name) for name, found in space.items()}
    recipe = _recipe(tuning).replace(values)
    folder = tuning.folder / f"trial-{trial.user_attrs.get(FOLDER, trial.number):04d}"
    if (folder / "policy.onnx").exists():
        return float(run_folder.read_result(folder)["selected"]["score_m"])

    def watch(steps: int, score: float) -> None:
        trial.report(score, steps * tuning.snapshots // tuning.steps)
        if steps < tuning.steps and trial.should_prune():
            raise optuna.TrialPruned

    try:
        robot = load_robot(tuning.robot)
        train(recipe, robot, tuning.seed, folder, resume=True, quiet=True, on_snapshot=watch)
    except KeyboardInterrupt:
        _take_up(trial.study, trial)
        raise
    except optuna.TrialPruned:
        shutil.rmtree(folder / "checkpoints", ignore_errors=True)
        raise
    except _FAILURES as error:
        trial.set_user_attr(ERROR, f"{type(error).__name__}: {error}")
        raise
    return float(run_folder.read_result(folder)["selected"]["score_m"])


def _reach(tuning: Tuning, address: str, workers: int | None) -> RayWorkers:
    """Return the cluster; refuse a file as database where others than this machine would work."""
    cluster = RayWorkers(address, workers)
    if tuning.in_file and cluster.elsewhere:
        raise UsageError(
            f"{', '.join(cluster.elsewhere)} cannot share the study in {tuning.storage}: SQLite is"
            " for one machine; name a database that all reach, e.g. --study"
            " postgresql://host/tuning."
        )
    return cluster


def _take_up(study: Study, trial: FrozenTrial | Trial) -> None:
    """Let the next process go on with a trial that was cut off."""
    folder = trial.user_attrs.get(FOLDER, trial.number)
    study.enqueue_trial(trial.params, user_attrs={FOLDER: folder})


def _trials(study: Study, *states: TrialState, before: float = math.inf) -> int:
    """Return how many trials before a number are in a state, or failed without being cut off."""
    trials = (t for t in study.get_trials(deepcopy=False) if t.number < before)
    return sum(t.state in states or ERROR in t.user_attrs for t in trials)


def _recipe(tuning: Tuning) -> Recipe:
    """Return the recipe with what all trials share."""
    recipe = recipes.get_recipe(tuning.recipe).replace(
        steps=tuning.steps, eval_every=max(tuning.steps // tuning.snapshots, 1)
    )
    return recipes.change(recipe, tuning.set)
