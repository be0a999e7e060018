"""Evaluate controllers: load what is judged, run the paper's trials, measure, compare."""

import functools
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hopping_leg.controllers import Controller, RolloutConfig
from hopping_leg.controllers.command_schedule import check_heights, within
from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.registry import load_controller
from hopping_leg.errors import UsageError
from hopping_leg.evaluate import prediction, result, trials
from hopping_leg.io import versions
from hopping_leg.robot import JOINTS, TIMESTEP, Robot, braking_times
from hopping_leg.sim import NO_NOISE


@dataclass(frozen=True)
class Entry:
    """A controller to be judged."""

    label: str
    """Name in all tables."""
    controller: Controller
    notes: tuple[str, ...] = ()
    """What a reader of the results must know about it."""

    @property
    def command_range(self) -> tuple[float, float] | None:
        """Heights it was made for, m, or None for any."""
        return getattr(self.controller, "command_range", None)

    def reaches(self, heights: Iterable[float]) -> bool:
        """Tell whether it was made for all of some heights, m."""
        valid = self.command_range
        return valid is None or all(within(height, valid) for height in heights)


def load_entries(names: Sequence[str], robot: Robot, rate: float) -> list[Entry]:
    """Load every controller that is named, for the leg that it shall drive and a rate, Hz.

    Names are shipped ones or ``.onnx`` files; ``LABEL=FILE`` gives a file another name in all
    tables. PolicyError says that a file is unreadable or does not fit, UsageError that there is no
    such controller.
    """
    entries = []
    for text in dict.fromkeys(names):
        label, _, source = (text, "", text) if Path(text).exists() else text.rpartition("=")
        controller = load_controller(source, robot, rate=rate, simulated=True)
        label = label or source
        note = controller.stranger(robot, label) if isinstance(controller, Policy) else ""
        entries.append(Entry(label, controller, notes=(note,) if note else ()))
    return entries


def check_entries(entries: Sequence[Entry], commands: Sequence[float]) -> None:
    """Refuse by a UsageError what has no name of its own or was not made for the commands, m."""
    labels = [entry.label for entry in entries]
    if not labels:
        raise UsageError("No controller was named; try `hop evaluate energy-shaping`.")
    for entry in entries:
        if labels.count(entry.label) > 1:
            raise UsageError(f"Controller '{entry.label}' was named twice; name each one once.")
        if entry.command_range:
            check_heights(commands, entry.command_range, entry.label)


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
    robots: Sequence[Robot] = (),
    on_progress: Callable[[str, float], None] = lambda _label, _share: None,
) -> EvaluationRun:
    """Run all trials of some kinds of all entries, on a floor of ``FLOORS``, and measure them.

    Commands are heights of the fixed trials and the sequence, m; the paper's by default. A trial
    has ``repeats`` realisations of noise and delay, which follow from the seed; where ``robots``
    are given, what the leg may be whatever controllers believe, each hops once instead, which
    predicts how a leg hops. ``on_progress`` is called with a label and the share done of its runs.

    Raises:
        UsageError: A command is out of reach or out of an entry's range, a name is taken twice,
            or there is nothing to do.
    """
    repeats = len(robots) or repeats
    heights = trials.choose_commands(setup.robot, commands, repeats)
    check_entries(entries, heights if commands is not None else ())
    for entry in entries:
        if not any(entry.reaches([height]) for height in heights):
            check_entries([entry], heights)
    planned = [t for t in trials.paper_trials(setup.robot, heights) if t.kind in kinds]
    world = replace(setup, robot=trials.floor_robot(setup.robot, floor))
    notes, runs = _note_setup(setup), list[trials.Run]()
    for entry in entries:
        fitting = [t for t in planned if entry.reaches(height for height, _ in t.steps)]
        own = trials.run_trials(
            entry.label, entry.controller, world, fitting, repeats=repeats, seed=seed,
            robots=[trials.floor_robot(robot, floor) for robot in robots],
            on_progress=functools.partial(on_progress, entry.label),
        )  # fmt: skip
        notes += entry.notes
        if entry.command_range and (left_out := [t for t in planned if t not in fitting]):
            low, high = entry.command_range
            names = ", ".join(
                f"{t.kind} {t.steps[0][0]:g} m" if len(t.steps) == 1 else t.kind for t in left_out
            )
            notes += [f"{entry.label} was made for {low:g} to {high:g} m; left out: {names}."]
        notes += _note_stopped(entry.label, own, setup)
        runs += own
    measured = result.tabulate(runs, seed, world.robot)
    conditions = {
        **setup_conditions(setup),
        "floor": floor,
        "floor_meaning": trials.FLOORS[floor],
        "contact_time_constant_s": world.robot.contact.time_constant,
        "contact_damping_ratio": world.robot.contact.damping_ratio,
        "seed": seed,
        "seeds": repeats,
    }
    told = replace(measured, notes=notes, conditions=conditions)
    told = replace(told, predictions=prediction.predict(runs) if robots else [])
    return EvaluationRun(replace(told, versions=software_versions()), runs)


def _note_setup(setup: RolloutConfig) -> list[str]:
    """Say so where the physics step is coarse, or noise and delay come from two sides."""
    notes = []
    if setup.timestep > TIMESTEP:
        notes.append(
            f"The physics step of {setup.timestep:g} s is coarser than {TIMESTEP:g} s; heights may"
            " be wrong: `python -m studies.physics_step` measures by how much."
        )
    if setup.robot.reality != setup.robot.reality.in_training and setup.disturbance != NO_NOISE:
        notes.append(
            f"{setup.robot.name} brings latency, noise and losses of its own, and the paper's noise"
            " and delay came on top; --no-noise meets it as it is."
        )
    return notes


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
