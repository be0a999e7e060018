"""The whole benchmark: every controller on every axis, each result kept."""

import functools
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from hopping_leg.controllers import Controller, RolloutConfig
from hopping_leg.evaluate import runner, trials
from hopping_leg.evaluate.entries import Entry, check_labels, check_range, fingerprint
from hopping_leg.evaluate.result import ResultCache
from hopping_leg.evaluate.robustness import axes as all_axes
from hopping_leg.evaluate.robustness import outcome
from hopping_leg.evaluate.robustness.axes import AXES, JOINT, JOINT_LEVELS, NOMINAL
from hopping_leg.evaluate.robustness.trials import JOINT_POINTS, SECONDS, make_trials
from hopping_leg.io import safe_file_name

SCHEMA = 2
"""Version of the JSON, raised when a name changes its meaning."""


@dataclass(frozen=True)
class Suite:
    """What is run."""

    setup: RolloutConfig
    """What controllers believe, with the paper's noise and delay."""
    axes: tuple[str, ...]
    """Names of axes."""
    commands: tuple[float, ...]
    """Desired apex heights, m."""
    repeats: int
    """Realisations of noise, delay and perturbation per level and command."""
    seed: int
    """All randomness follows from it."""
    seconds: float = SECONDS
    """Duration of each trial, s."""

    @property
    def conditions(self) -> dict[str, Any]:
        """What all results depend on, as JSON values."""
        return {
            **runner.setup_conditions(self.setup),
            "commands_m": self.commands,
            "seeds": self.repeats,
            "seed": self.seed,
            "seconds": self.seconds,
        }

    def asked(self, controller: Controller, axis: str) -> dict[str, Any]:
        """Return all that a result depends on, as JSON values."""
        return {
            **self.conditions,
            "schema": SCHEMA,
            "controller": fingerprint(controller),
            "levels": _levels(axis),
            "versions": runner.software_versions(),
        }


def make_suite(
    setup: RolloutConfig,
    *,
    axes: Sequence[str] = (),
    commands: Sequence[float] | None = None,
    repeats: int = 5,
    seed: int = 1000,
    seconds: float = SECONDS,
) -> Suite:
    """Return a suite that can be run; without axes, on all.

    Commands are the paper's by default, scaled to the leg.

    Raises:
        UsageError: There is no such axis, or a command is out of reach.
    """
    for name in axes:
        if name != JOINT:
            all_axes.axis_named(name)
    trials.check_repeats(repeats)
    chosen = trials.choose_commands(setup.robot, commands)
    names = tuple(name for name in all_axes.axis_names() if not axes or name in axes)
    return Suite(setup, names, chosen, repeats, seed, seconds)


def run_suite(
    entries: Sequence[Entry],
    suite: Suite,
    cache: ResultCache,
    on_progress: Callable[[str, float], None] = lambda label, share: None,
) -> dict[str, Any]:
    """Let every controller meet every axis; the cache keeps the result of each pair.

    Returns:
        ``scores``, ``levels``, ``axes``, ``conditions``, ``versions`` and
        ``notes``, as JSON values.

    Raises:
        UsageError: A command is out of an entry's range, or a name is taken twice.
    """
    check_labels(entries)
    for entry in entries:
        check_range(entry, suite.commands)
    result: dict[str, Any] = {"schema": SCHEMA, "scores": [], "levels": []}
    parts = [NOMINAL, *suite.axes]
    for entry in entries:
        outcomes: dict[str, list[outcome.Outcome]] = {}
        for number, part in enumerate(parts):

            def tick(done: int, ticks: int, label: str = entry.label, number: int = number) -> None:
                on_progress(label, (number + done / ticks) / len(parts))

            kept = cache.load_or_run(
                f"{safe_file_name(entry.label)}-{part}",
                f"{entry.label}: {part}",
                suite.asked(entry.controller, part),
                functools.partial(_run_part, entry.controller, suite, part, tick),
            )
            outcomes[part] = [outcome.Outcome(**row) for row in kept["outcomes"]]
            on_progress(entry.label, (number + 1) / len(parts))
        for part, found in outcomes.items():
            result["levels"] += outcome.level_rows(entry.label, part, found)
        del outcomes[NOMINAL]
        result["scores"] += outcome.score_rows(entry.label, outcomes, suite.seed)
    return {
        **result,
        "axes": _axes(suite),
        "conditions": {
            **suite.conditions,
            "joint_points": JOINT_POINTS,
            "tolerance_m": outcome.TOLERANCE,
        },
        "versions": runner.software_versions(),
        "notes": [note for entry in entries for note in entry.notes],
    }


def _run_part(
    controller: Controller, suite: Suite, part: str, on_tick: Callable[[int, int], None]
) -> dict[str, Any]:
    setup, commands, repeats, seed = suite.setup, suite.commands, suite.repeats, suite.seed
    robot, rate, seconds = setup.robot, setup.rate, suite.seconds
    plan = make_trials(part, robot, commands, repeats, seed, rate=rate, seconds=seconds)
    return {"outcomes": [asdict(one) for one in outcome.run_axis(controller, setup, plan, on_tick)]}


def _axes(suite: Suite) -> list[dict[str, Any]]:
    rows = [
        {name: value for name, value in vars(axis).items() if name != "alter"}
        for axis in AXES
        if axis.name in suite.axes
    ]
    if JOINT in suite.axes:
        meaning = "all axes at once, this share of the way to points of their moderate ranges"
        row = {"name": JOINT, "meaning": meaning, "unit": "1", "neutral": 0.0}
        row |= {"levels": JOINT_LEVELS, "moderate": (0.0, 1.0), "leaderboard": ""}
        rows.append(row)
    return rows


def _levels(axis: str) -> Any:  # noqa: ANN401
    """Return the numbers of an axis that its results depend on."""
    if axis == JOINT:
        return [JOINT_POINTS, JOINT_LEVELS, *((one.name, one.moderate) for one in AXES)]
    return [one.levels for one in AXES if one.name == axis]
