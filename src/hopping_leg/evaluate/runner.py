"""Evaluate controllers: run the paper's trials, measure, compare."""

import functools
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from hopping_leg.controllers import RolloutConfig
from hopping_leg.evaluate import aggregation, motor_load, result, trials
from hopping_leg.evaluate.entries import Entry, check_entries
from hopping_leg.io import versions
from hopping_leg.robot import JOINTS, TIMESTEP, braking_times
from hopping_leg.sim import NO_NOISE


@dataclass(frozen=True)
class EvaluationRun:
    """An evaluation with the runs behind it."""

    evaluation: result.Evaluation
    runs: list[trials.Run]


def evaluate(
    entries: Sequence[Entry],
    setup: RolloutConfig,
    *,
    commands: Sequence[float] | None = None,
    repeats: int = 5,
    seed: int = 1000,
    floor: str = "soft",
    kinds: Collection[str] = trials.KINDS,
    on_progress: Callable[[str, float], None] = lambda _label, _share: None,
) -> EvaluationRun:
    """Run all trials of all entries and measure them.

    Args:
        entries: What is judged.
        setup: The world; its robot stands on ``floor``.
        commands: Heights of the fixed trials and the sequence, m; the paper's by default.
        repeats: Realisations of noise and delay per trial.
        seed: All of them follow from it.
        floor: One of ``FLOORS``.
        kinds: Which kinds of trial to run.
        on_progress: Called with a label and the share done of its runs.

    Raises:
        UsageError: A command is out of reach or out of an entry's range, a name is taken twice,
            or there is nothing to do.
    """
    trials.check_repeats(repeats)
    heights = trials.choose_commands(setup.robot, commands)
    check_entries(entries, heights if commands is not None else ())
    for entry in entries:
        if not any(entry.reaches([height]) for height in heights):
            check_entries([entry], heights)
    planned = [t for t in trials.paper_trials(setup.robot, heights) if t.kind in kinds]
    world = replace(setup, robot=trials.floor_robot(setup.robot, floor))
    notes = _note_setup(setup)
    runs: list[trials.Run] = []
    for entry in entries:
        fitting = [t for t in planned if entry.reaches(height for height, _ in t.steps)]
        own = trials.run_trials(
            entry.label,
            entry.controller,
            world,
            fitting,
            repeats=repeats,
            seed=seed,
            on_progress=functools.partial(on_progress, entry.label),
        )
        notes += entry.notes
        notes += _note_left_out(entry, [t for t in planned if t not in fitting])
        notes += _note_stopped(entry.label, own, setup)
        runs += own
    measured = aggregation.tabulate(runs, [c.label for c in entries], seed, world.robot)
    members = {
        group: [row for c in entries if c.group == group for row in measured.rows(c.label)]
        for group in dict.fromkeys(c.group for c in entries if c.group)
    }
    evaluation = replace(
        measured,
        groups=[
            row for g, rows in members.items() for row in aggregation.pool_group(g, rows, seed)
        ],
        conditions={
            **setup_conditions(setup),
            "floor": floor,
            "floor_meaning": trials.FLOORS[floor],
            "contact_time_constant_s": world.robot.contact.time_constant,
            "contact_damping_ratio": world.robot.contact.damping_ratio,
            "motors": motor_load.constants(world.robot),
            "seed": seed,
            "seeds": repeats,
        },
        versions=software_versions(),
        notes=notes,
    )
    return EvaluationRun(evaluation, runs)


def _note_setup(setup: RolloutConfig) -> list[str]:
    """Say so where the physics step is coarse, or noise and delay come from two sides."""
    notes = []
    if setup.timestep > TIMESTEP:
        notes.append(
            f"The physics step of {setup.timestep:g} s is coarser than {TIMESTEP:g} s; heights may"
            " be wrong: `python -m studies.physics_step` measures by how much."
        )
    if not setup.robot.reality.only_delays and setup.disturbance != NO_NOISE:
        notes.append(
            f"{setup.robot.name} brings latency, noise and losses of its own, and the paper's noise"
            " and delay came on top; --no-noise meets it as it is."
        )
    return notes


def _note_left_out(entry: Entry, left_out: Sequence[trials.Trial]) -> list[str]:
    if not left_out or entry.command_range is None:
        return []
    low, high = entry.command_range
    names = ", ".join(
        f"{t.kind} {t.steps[0][0]:g} m" if len(t.steps) == 1 else t.kind for t in left_out
    )
    return [f"{entry.label} was made for {low:g} to {high:g} m; left out: {names}."]


def _note_stopped(label: str, runs: Sequence[trials.Run], setup: RolloutConfig) -> list[str]:
    """Say so where the supervisor of the real leg would not let a controller hop on."""
    robot, stopped = setup.robot, 0
    lower, upper = robot.of_joints("stop_lower"), robot.of_joints("stop_upper")
    for run in runs:
        q, qd = (
            np.stack([run.trace.column(f"{joint}_{what}") for joint in JOINTS], axis=1)
            for what in ("position_rad", "velocity_rad_s")
        )
        ahead = q + braking_times(robot, setup.rate) * qd
        low, high = np.minimum(q, ahead), np.maximum(q, ahead)
        stopped += bool(((low < lower) | (high > upper)).any())
    if not stopped:
        return []
    return [
        f"{label} brings a joint to a mechanical stop, or too fast to be braked before it, in"
        f" {stopped} of {len(runs)} runs; the supervisor of `hop deploy` would stop the leg there."
    ]


def setup_conditions(setup: RolloutConfig) -> dict[str, Any]:
    """Return what results depend on of what controllers believe, as JSON values."""
    return {
        "robot": setup.robot.name,
        "robot_digest": setup.robot.digest,
        "disturbance": asdict(setup.disturbance),
        "soft_limits": asdict(setup.soft_limits) if setup.soft_limits else None,
        "timestep_s": setup.timestep,
        "rate_hz": setup.rate,
        "start_length_m": setup.standing_length,
    }


def software_versions() -> dict[str, str]:
    """Return the versions that the numbers may depend on."""
    return versions("hopping-leg", "mujoco", "numpy", "scipy", "onnxruntime")
