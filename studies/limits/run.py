"""What limits accuracy: the same controllers with noise, delay and soft ground taken away in turn.

A controller that is shown the true state says what is left to gain by seeing more; what scatters
with a single disturbance on says which of them costs how much.
"""

import functools
import itertools
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hopping_leg.cli.options import Heights, at_least, mm
from hopping_leg.controllers import RolloutConfig
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.entries import Entry, check_labels, check_range, fingerprint
from hopping_leg.evaluate.result import Summary
from hopping_leg.evaluate.result_files import ResultCache
from hopping_leg.evaluate.robustness.axes import times
from hopping_leg.evaluate.runner import evaluate, software_versions
from hopping_leg.io import safe_file_name
from hopping_leg.rl.checkpoint import list_checkpoints, read_checkpoint
from hopping_leg.rl.distillation.teacher_student import Teacher
from hopping_leg.rl.recipes import recipe_of
from hopping_leg.rl.resumable import restore_learner
from hopping_leg.robot import Robot, load_robot
from hopping_leg.sim import NO_NOISE, NoiseAndDelay

_FULL = NoiseAndDelay()


@dataclass(frozen=True)
class Condition:
    """What disturbs the controllers.

    Attributes:
        name: In tables and file names.
        disturbance: Noise and delay.
        floor: ``soft``, the robot's contact, or ``stiff``.
        slowness: Of a soft ground, times the robot's contact time constant; nobody is told.
    """

    name: str
    disturbance: NoiseAndDelay
    floor: str = "soft"
    slowness: float = 1.0


CONDITIONS = (
    Condition("all of it", _FULL),
    Condition("no joint noise", replace(_FULL, joint_noise=0.0)),
    Condition("no torque noise", replace(_FULL, torque_noise=0.0)),
    Condition("no delay", replace(_FULL, delay_probability=0.0)),
    Condition("joint noise alone", replace(NO_NOISE, joint_noise=_FULL.joint_noise)),
    Condition("torque noise alone", replace(NO_NOISE, torque_noise=_FULL.torque_noise)),
    Condition("delay alone", replace(NO_NOISE, delay_probability=_FULL.delay_probability)),
    Condition("nothing", NO_NOISE),
    Condition("all of it, stiff ground", _FULL, floor="stiff"),
    Condition("all of it, ground twice as slow", _FULL, slowness=2.0),
    Condition("nothing, ground twice as slow", NO_NOISE, slowness=2.0),
)
"""The paper's noise and delay, with one less, one alone, none, and on other ground."""

_PER_COMMAND = ("command_m", "median_error_m", "std_m", "hops", "skipped_hops")


@dataclass(frozen=True)
class LimitsStudy:
    """What is tried."""

    robot: Robot
    commands: Sequence[float]
    """Desired heights, m."""
    seeds: int = 5
    """Realisations of noise and delay per command."""
    seed: int = 1000
    """All of them follow from it."""
    threads: int = 0
    """Of the physics."""
    conditions: Sequence[Condition] = CONDITIONS

    def asked(self, entry: Entry, condition: Condition) -> dict[str, Any]:
        """Return all that a result depends on, as JSON values."""
        return {
            "controller": fingerprint(entry.controller),
            "condition": asdict(condition),
            "robot": self.robot.digest,
            "commands_m": self.commands,
            "seeds": self.seeds,
            "seed": self.seed,
            "versions": software_versions(),
        }


def measure_limits(
    entries: Sequence[Entry],
    study: LimitsStudy,
    cache: ResultCache,
    on_done: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, Any]:
    """Let every entry hop under every condition.

    Args:
        entries: What is judged, ``PrivilegedController`` controllers among them.
        study: Where.
        cache: Keeps each result.
        on_done: Called with (parts done, parts in all).

    Returns:
        ``rows``, one per entry and condition, over all commands, and ``commands``, one per
        command of these.

    Raises:
        UsageError: A command is out of a entry's range, or a name is taken twice.
    """
    check_labels(entries)
    for entry in entries:
        check_range(entry, study.commands)
    parts = list(itertools.product(entries, study.conditions))
    rows, commands = [], []
    for done, (entry, condition) in enumerate(parts, 1):
        place = {"controller": entry.label, "condition": condition.name}
        kept = cache.load_or_run(
            safe_file_name(f"{entry.label}-{condition.name}"),
            f"{entry.label}: {condition.name}",
            study.asked(entry, condition),
            functools.partial(_hop, entry, study, condition),
        )
        rows.append(place | kept["row"])
        commands += [place | row for row in kept["commands"]]
        on_done(done, len(parts))
    return {
        "rows": rows,
        "commands": commands,
        "seeds": study.seeds,
        "seed": study.seed,
        "commands_m": study.commands,
        "robot": study.robot.name,
        "versions": software_versions(),
    }


def _hop(entry: Entry, study: LimitsStudy, condition: Condition) -> dict[str, Any]:
    robot = times(study.robot, condition.slowness, "contact.time_constant")
    setup = RolloutConfig(robot, condition.disturbance, threads=study.threads)
    judged = evaluate(
        [entry],
        setup,
        commands=study.commands,
        repeats=study.seeds,
        seed=study.seed,
        floor=condition.floor,
        kinds=("fixed",),
    )
    summary = judged.evaluation.summary
    rows = [{name: getattr(row, name) for name in _PER_COMMAND} for row in summary]
    return {"row": condense(summary), "commands": rows}


def condense(summary: Sequence[Summary]) -> dict[str, Any]:
    """Return numbers over all commands; if one gave no hops, no std."""
    errors = np.abs([row.median_error_m for row in summary])
    stds = np.array([row.std_m for row in summary])
    hopped = all(row.hops for row in summary)
    return {
        "mean_abs_median_error_m": float(errors.mean()),
        "worst_abs_median_error_m": float(errors.max()),
        "mean_std_m": float(stds.mean()) if hopped else None,
        "worst_std_m": float(stds.max()) if hopped else None,
        "rms_hip_torque_nm": float(np.mean([row.rms_hip_torque_nm for row in summary])),
        "rms_knee_torque_nm": float(np.mean([row.rms_knee_torque_nm for row in summary])),
        "hop_rate_hz": float(np.mean([row.hop_rate_hz for row in summary])),
        "skipped_hops": sum(row.skipped_hops for row in summary),
        "body_contacts": sum(row.body_contacts for row in summary),
    }


_SHOWN = ("worst_abs_median_error_m", "mean_std_m", "worst_std_m")


@dataclass(frozen=True)
class Limits:
    """Take noise, delay and soft ground away in turn, and give a controller the true state."""

    controllers: tuple[str, ...] = ("precise", "adaptive", "recurrent", "energy-shaping")
    """Names or .onnx files."""
    teacher: Path | None = None
    """Folder of a run of `precise`: its teacher, which is shown the true state, joins them."""
    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    commands: Heights = (0.22, 0.25, 0.28, 0.31, 0.34, 0.37, 0.40)
    """Apex heights, m."""
    seeds: int = 5
    """Realisations of noise and delay per command."""
    seed: int = 1000
    """All of them follow from it; choose one that selected nothing."""
    threads: int = 0
    """Threads of the physics, 0 for all cores; results do not depend on it."""
    folder: Path = Path("runs/bench-limits")
    """Where each result is kept; what is there is not done again."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        from hopping_leg.evaluate.entries import Entry, load_entries
        from hopping_leg.evaluate.result_files import ResultCache
        from hopping_leg.sim import CONTROL_RATE

        at_least(1, seeds=self.seeds)
        at_least(0, threads=self.threads, seed=self.seed)
        robot = load_robot(self.robot)
        entries = load_entries(self.controllers, robot, CONTROL_RATE)
        if self.teacher is not None:
            teacher = teacher_of_run(self.teacher, robot)
            entries.append(Entry(teacher.name, teacher, teacher.command_range))
        study = LimitsStudy(
            robot, self.commands, seeds=self.seeds, seed=self.seed, threads=self.threads
        )
        with Progress(transient=True) as bar:
            task = bar.add_task("hopping", total=None)
            result = measure_limits(
                entries,
                study,
                ResultCache(self.folder, lambda words: bar.update(task, description=words)),
                lambda done, total: bar.update(task, completed=done, total=total),
            )
        table = Table("controller", "with", "worst |error|, mm", "mean std, mm", "worst", "skipped")
        for row in result["rows"]:
            numbers = [mm(row[name]) for name in _SHOWN]
            table.add_row(row["controller"], row["condition"], *numbers, str(row["skipped_hops"]))
        Console().print(table)
        return result


def teacher_of_run(run: Path, robot: Robot) -> Teacher:
    """Return the teacher as the newest checkpoint of a run has it.

    Args:
        run: Folder of a run of ``adaptive`` or of another recipe whose teacher learns by PPO.
        robot: The leg that it was trained on.

    Raises:
        UsageError: The run has no teacher, no checkpoint, or another robot.
    """
    file = run / "config.json"
    found = list_checkpoints(run / "checkpoints")
    if not file.exists() or not found:
        raise UsageError(f"{run} holds no run with a checkpoint; train one with `hop train`.")
    config = json.loads(file.read_text(encoding="utf-8"))
    recipe = recipe_of(config["recipe"], config["options"]).fit(robot)
    if recipe.distillation is None or recipe.distillation.teacher != "ppo":
        raise UsageError(
            f"The run in {run} is of recipe '{recipe.name}', which has no teacher that learns; take"
            " one of 'adaptive', or the controller shooting."
        )
    if config["robot_digest"] != robot.digest:
        raise UsageError(
            f"The run in {run} was trained on {config['robot']}, not on this {robot.name}; give the"
            " robot that it was trained on."
        )
    model = recipe.make_model(recipe.make_env(robot, config["seed"]), config["seed"])
    restore_learner(model, read_checkpoint(found[-1])["model"])
    return Teacher(model.policy, robot, recipe.task)
