"""Run the paper's trials for controllers and report how well they hop.

Every controller hops from standing, with the paper's noise and delay: 15 s at each command, 15 s
through all commands in turn, 30 s up a staircase, 15 s at each rung of a ladder. Errors are apex
minus command; negative is too low.

`--suite robustness` asks how far the world may differ from what controllers believe before they
fail: every axis (payload, friction, delay, noise, pushes, ...) is changed alone in rising levels,
then all at once.

Examples:
  hop evaluate fast energy-shaping --out runs/first
  hop evaluate runs/*/policy.onnx --commands 0.25 0.30 --json result.json
  hop evaluate energy-shaping --robot my_leg.toml --seeds 20 --floor stiff
  hop evaluate fast energy-shaping --suite robustness --axes payload delay
  hop evaluate fast --robot leg.toml --posterior leg.json --json prediction.json
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro

from hopping_leg import io
from hopping_leg.cli import COMMAND, options
from hopping_leg.robot import CONTROL_RATE, TIMESTEP, SoftLimits, load_robot
from hopping_leg.terminal import Progress

if TYPE_CHECKING:
    from hopping_leg.controllers import RolloutConfig
    from hopping_leg.evaluate import Entry, EvaluationRun


@dataclass(frozen=True)
class Evaluate:
    """What is judged, where, under which conditions and how often."""

    controllers: tyro.conf.Positional[tuple[str, ...]]
    """Names (energy-shaping, paper, fast, ...), .onnx files, or Python classes as FILE.py:CLASS;
    LABEL=FILE chooses the name in all tables."""
    robot: options.OwnRobot = None
    commands: options.Heights | None = None
    """Apex heights, m; default 0.25,0.30,0.35, scaled to the leg's length."""
    seeds: int = 5
    """Realisations of noise and delay per trial; with --posterior one for each of its draws."""
    posterior: Path | None = None
    """JSON of `hop identify --posterior N`, with the suite paper: predict what the real leg does,
    for `hop report --prediction`, from fixed trials of every leg that was drawn."""
    seed: int = 1000
    """Seed of noise and delay; choose one that selected no policy."""
    json: options.JsonFile = None
    noise: bool = True
    """With the paper's sensor noise, torque noise and delay; --no-noise: without."""
    soft_limits: bool = True
    """Pull back joints that pass their soft limits; --no-soft-limits: let them pass."""
    timestep: float = TIMESTEP
    """Physics step, s."""
    rate: float = CONTROL_RATE
    """Control rate, Hz."""
    threads: int = 0
    """Threads of the physics, 0 for all cores; results do not depend on it."""
    suite: Literal["paper", "robustness"] = "paper"
    """The paper's trials, or those of changed worlds."""
    axes: tuple[str, ...] = ()
    """Axes of the suite robustness by name; default: all."""
    out: Path | None = None
    """Folder for evaluation.json, report.html (one self-contained page) and traces/."""
    traces: Path | None = None
    """Another folder for the runs as Parquet, for `hop report` and your own tools."""
    floor: Literal["soft", "stiff", "both"] = "both"
    """The robot's own contact (soft), MuJoCo's default (stiff), or all trials on the first and,
    where it is another, the fixed ones on the second."""


def load(args: Evaluate) -> "tuple[list[Entry], RolloutConfig]":
    """Return the controllers and how they are rolled out; a wrong option is a UsageError."""
    from hopping_leg.controllers import RolloutConfig
    from hopping_leg.controllers.registry import robot_of
    from hopping_leg.evaluate.runner import load_entries
    from hopping_leg.sim import NO_NOISE, NoiseAndDelay

    options.at_least(0, seed=args.seed)
    robot = load_robot(args.robot or robot_of(args.controllers))
    noise = NoiseAndDelay() if args.noise else NO_NOISE
    setup = RolloutConfig(
        robot, noise, SoftLimits() if args.soft_limits else None,
        rate=args.rate, timestep=args.timestep, threads=args.threads,
    )  # fmt: skip
    return load_entries(args.controllers, robot, args.rate), setup


def run(args: Evaluate) -> None:
    """Evaluate controllers, print the table, write what was asked for."""
    if args.suite == "robustness":
        _robustness(args, *load(args))
        return
    from hopping_leg.evaluate import prediction, tables

    judged = judge(args)
    tables.print_evaluation(judged.evaluation)
    if predictions := judged.evaluation.predictions:
        options.show_table(*prediction.shown(predictions))
    options.say_written(*keep(args, judged))


def keep(args: Evaluate, judged: "EvaluationRun", notes: Sequence[str] = ()) -> list[Path | None]:
    """Write what was asked for, notes before the evaluation's own; return the files."""
    from hopping_leg.evaluate.report import write_report

    notes = [*notes, *judged.evaluation.notes]
    evaluation = replace(judged.evaluation, command=COMMAND.get(), notes=notes)
    numbers, report, traces = args.json, None, args.traces
    if args.out is not None:
        numbers, traces = numbers or args.out / "evaluation.json", traces or args.out / "traces"
        report = args.out / "report.html"
    options.save_json(numbers, evaluation.to_json())
    if traces:
        for run in judged.runs:
            run.trace.save(traces / run.file_name)
    if report:
        io.write_atomically(report, write_report(replace(judged, evaluation=evaluation)))
    return [numbers, report, traces]


def judge(args: Evaluate) -> "EvaluationRun":
    """Let controllers hop as the options say."""
    from hopping_leg.evaluate import evaluate, trials
    from hopping_leg.identify.result import posterior_robots

    entries, setup = load(args)
    legs = posterior_robots(args.posterior, setup.robot) if args.posterior else ()
    once = legs or trials.floor_robot(setup.robot, "stiff") == setup.robot
    floors = ("soft", "stiff")[: 1 if once else 2] if args.floor == "both" else (args.floor,)
    with Progress(parts=len(entries) * len(floors)) as bar:
        own = partial(evaluate, entries, setup, repeats=args.seeds, seed=args.seed, robots=legs)
        judged = [
            own(
                commands=args.commands,
                floor=floor,
                kinds=("fixed",) if legs or floor != floors[0] else trials.KINDS,
                on_progress=partial(bar.show, about=f", {floor} floor"),
            )
            for floor in floors
        ]
    first = judged[0]
    secondary = judged[1].evaluation if len(judged) > 1 else None
    return replace(first, evaluation=replace(first.evaluation, secondary=secondary))


def _robustness(args: Evaluate, entries: "list[Entry]", setup: "RolloutConfig") -> None:
    from hopping_leg.evaluate import figures, tables, trials
    from hopping_leg.evaluate.robustness import Suite, run_suite
    from hopping_leg.evaluate.robustness_axes import axes_named
    from hopping_leg.figures import encode

    out = args.out or Path("runs/robustness")
    heights = trials.choose_commands(setup.robot, args.commands, args.seeds)
    suite = Suite(setup, heights, axes_named(args.axes), args.seeds, args.seed)
    with Progress(parts=len(entries)) as bar:
        result = {"command": COMMAND.get(), **run_suite(entries, suite, bar.show)}
    file, figure = args.json or out / "robustness.json", out / "robustness.svg"
    tables.print_robustness(result)
    options.save_json(file, result)
    io.write_atomically(figure, encode(figures.draw_robustness(result), "svg"))
    options.say_written(file, figure)
