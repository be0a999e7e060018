"""Evaluate controllers: run the paper's trials, measure, compare."""

import functools
import itertools
import platform
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from typing import Any

import numpy as np

from hopping_leg.control import Controller, Setup
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.metrics import Window, measure, pooled_apexes, skipped_in_run
from hopping_leg.evaluate.pooling import pool_group, summarise
from hopping_leg.evaluate.result import Comparison, Evaluation, Group, Staircase, Summary
from hopping_leg.evaluate.runs import FLOORS, Run, floor_robot, run_trials
from hopping_leg.evaluate.statistics import compare
from hopping_leg.evaluate.trials import KINDS, Trial, check_reach, paper_trials, within

Bounds = tuple[float, float]


@dataclass(frozen=True)
class Candidate:
    """A controller to be judged.

    Attributes:
        label: Its name in all tables.
        controller: What is run.
        command_range: Heights it was made for, m, or None for any.
        group: Name shared by policies of one recipe that differ in the training seed.
        notes: What a reader of the results must know about it.
    """

    label: str
    controller: Controller
    command_range: Bounds | None = None
    group: str | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Judged:
    """An evaluation with the runs behind it."""

    evaluation: Evaluation
    runs: list[Run]


def evaluate(
    candidates: Sequence[Candidate],
    setup: Setup,
    *,
    commands: Sequence[float] | None = None,
    repeats: int = 5,
    seed: int = 1000,
    floor: str = "soft",
    kinds: Collection[str] = KINDS,
    on_progress: Callable[[str, float], None] = lambda _label, _share: None,
) -> Judged:
    """Run all trials of all candidates and measure them.

    Args:
        candidates: What is judged.
        setup: The world; its robot stands on ``floor``.
        commands: Heights of the fixed trials and the sequence, m; the paper's by default.
        repeats: Realisations of noise and delay per trial.
        seed: All of them follow from it.
        floor: One of ``FLOORS``.
        kinds: Which kinds of trial to run.
        on_progress: Called with a label and the share done of its runs.

    Raises:
        UsageError: A command is out of reach or out of a candidate's range, a name is taken twice,
            or there is nothing to do.
    """
    _check(candidates, setup, commands, repeats)
    trials = [t for t in paper_trials(setup.robot, commands) if t.kind in kinds]
    world = replace(setup, robot=floor_robot(setup.robot, floor))
    notes: list[str] = []
    runs: list[Run] = []
    for candidate in candidates:
        fitting = [t for t in trials if within(t, candidate.command_range)]
        notes += candidate.notes
        notes += _note_left_out(candidate, trials, fitting)
        runs += run_trials(
            candidate.label,
            candidate.controller,
            world,
            fitting,
            repeats=repeats,
            seed=seed,
            on_progress=functools.partial(on_progress, candidate.label),
        )
    tables = [
        _tables(c.label, world, [r for r in runs if r.controller == c.label], seed)
        for c in candidates
    ]
    summary = [row for table in tables for row in table.summary]
    return Judged(
        Evaluation(
            summary=summary,
            sequence=[row for table in tables for row in table.sequence],
            ladder=[row for table in tables for row in table.ladder],
            staircase=[table.staircase for table in tables if table.staircase],
            neighbours=[table.neighbours for table in tables],
            groups=_groups(candidates, summary, seed),
            distributions=[entry for table in tables for entry in table.distributions],
            conditions=_conditions(world, setup, floor, repeats, seed),
            versions=software_versions(),
            notes=notes,
        ),
        runs,
    )


def _check(
    candidates: Sequence[Candidate], setup: Setup, commands: Sequence[float] | None, repeats: int
) -> None:
    labels = [c.label for c in candidates]
    if not labels:
        raise UsageError("No controller was named; try `hop evaluate energy-shaping`.")
    twice = sorted({label for label in labels if labels.count(label) > 1})
    if twice:
        raise UsageError(f"Controller '{twice[0]}' was named twice; name each one once.")
    if repeats < 1:
        raise UsageError(f"{repeats} seeds are too few; give --seeds 1 or more.")
    if commands is not None:
        check_reach(setup.robot, commands)
    for candidate in candidates:
        bounds = candidate.command_range
        outside = [
            trial.steps[0][0]
            for trial in paper_trials(setup.robot, commands)
            if trial.kind == "fixed" and not within(trial, bounds)
        ]
        if outside and bounds is not None:
            raise UsageError(
                f"'{candidate.label}' cannot be asked for {outside[0]:g} m: it was trained for"
                f" {bounds[0]:g} to {bounds[1]:g} m; choose --commands within that range."
            )


def _note_left_out(
    candidate: Candidate, trials: Sequence[Trial], fitting: Sequence[Trial]
) -> list[str]:
    left_out = [t for t in trials if t not in fitting]
    if not left_out or candidate.command_range is None:
        return []
    low, high = candidate.command_range
    names = ", ".join(
        f"{t.kind} {t.steps[0][0]:g} m" if len(t.steps) == 1 else t.kind for t in left_out
    )
    return [f"{candidate.label} was made for {low:g} to {high:g} m; left out: {names}."]


@dataclass(frozen=True)
class _Tables:
    """All rows of one controller."""

    summary: list[Summary]
    sequence: list[Summary]
    ladder: list[Summary]
    staircase: Staircase | None
    neighbours: Comparison
    distributions: list[dict[str, Any]]


def _tables(label: str, world: Setup, runs: Sequence[Run], seed: int) -> _Tables:
    windows = {kind: _windows(runs, kind) for kind in ("fixed", "sequence", "ladder")}
    pooled = _by_command(windows["fixed"] + windows["sequence"])

    def rows(groups: dict[float, list[Window]]) -> list[Summary]:
        return [summarise(label, world.robot.name, c, w, seed) for c, w in groups.items()]

    apexes = {command: pooled_apexes(group) for command, group in pooled.items()}
    steps = list(apexes)
    return _Tables(
        summary=rows(pooled),
        sequence=rows(_by_command(windows["sequence"])),
        ladder=rows(_by_command(windows["ladder"])),
        staircase=_staircase(label, [r for r in runs if r.trial.kind == "staircase"]),
        neighbours=Comparison(
            label,
            [compare(a, apexes[a], b, apexes[b]) for a, b in itertools.pairwise(steps)],
        ),
        distributions=[
            {"controller": label, "command_m": c, "apexes_m": np.round(a, 5).tolist()}
            for c, a in apexes.items()
        ],
    )


def _windows(runs: Sequence[Run], kind: str) -> list[Window]:
    return [w for run in runs if run.trial.kind == kind for w in measure(run.trace)]


def _by_command(windows: Sequence[Window]) -> dict[float, list[Window]]:
    commands = sorted({w.command for w in windows})
    return {c: [w for w in windows if w.command == c] for c in commands}


def _staircase(label: str, runs: Sequence[Run]) -> Staircase | None:
    if not runs:
        return None
    measured = [measure(run.trace) for run in runs]
    steps = [list(group) for group in zip(*measured, strict=True)]
    medians = np.array([_median(pooled_apexes(step)) for step in steps])
    per_run = np.array([[_median(w.apex) for w in run] for run in measured])
    return Staircase(
        controller=label,
        commands_m=[step[0].command for step in steps],
        median_apexes_m=medians.tolist(),
        monotone=bool((np.diff(medians) > 0).all()),
        monotone_runs=int((np.diff(per_run, axis=1) > 0).all(axis=1).sum()),
        runs=len(runs),
        skipped_hops=sum(skipped_in_run(run.trace) for run in runs),
    )


def _median(values: Any) -> float:  # noqa: ANN401
    return float(np.median(values)) if len(values) else float("nan")


def _groups(candidates: Sequence[Candidate], summary: Sequence[Summary], seed: int) -> list[Group]:
    names = list(dict.fromkeys(c.group for c in candidates if c.group))
    rows: list[Group] = []
    for name in names:
        members = {c.label for c in candidates if c.group == name}
        if len(members) > 1:
            rows += pool_group(name, [s for s in summary if s.controller in members], seed)
    return rows


def _conditions(world: Setup, setup: Setup, floor: str, repeats: int, seed: int) -> dict[str, Any]:
    return {
        "robot": setup.robot.name,
        "robot_digest": setup.robot.digest,
        "floor": floor,
        "floor_meaning": FLOORS[floor],
        "contact_time_constant_s": world.robot.contact.time_constant,
        "contact_damping_ratio": world.robot.contact.damping_ratio,
        "disturbance": asdict(setup.disturbance),
        "seed": seed,
        "seeds": repeats,
        "timestep_s": setup.timestep,
        "rate_hz": setup.rate,
        "start_length_m": setup.start_length,
    }


def software_versions() -> dict[str, str]:
    """Return the versions that the numbers may depend on."""
    names = ("hopping-leg", "mujoco", "numpy", "scipy", "onnxruntime")
    return {"python": platform.python_version(), **{name: version(name) for name in names}}
