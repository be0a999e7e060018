"""Run the paper's trials for controllers and report how well they hop.

Every controller hops from standing, with the paper's noise and delay: 15 s at each command, 15 s
through all commands in turn, 30 s up a staircase, 15 s at each rung of a ladder. Errors are apex
minus command; negative is too low.

Examples:
  hop evaluate fast energy-shaping
  hop evaluate fast energy-shaping --out runs/first
  hop evaluate 'runs/*/policy.onnx' --commands 0.25,0.30 --json result.json
  hop evaluate mine=policy.onnx energy-shaping --suite robustness --json robustness.json
  hop evaluate fast energy-shaping --suite skills --json skills.json
  hop evaluate energy-shaping --robot my_leg.toml --seeds 20 --floor stiff
  hop evaluate fast --engine pybullet --floor soft --seeds 2
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import tyro
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from hopping_leg.cli.command_line import command_line
from hopping_leg.cli.options import Heights
from hopping_leg.cli.robustness import judge_robustness
from hopping_leg.cli.skills import judge_skills, print_skills
from hopping_leg.controllers import RolloutConfig
from hopping_leg.errors import UsageError
from hopping_leg.evaluate import Candidate, Judged, evaluate
from hopping_leg.evaluate.candidates import load_candidates
from hopping_leg.evaluate.report import render_videos, write_report
from hopping_leg.evaluate.robustness.tables import print_robustness
from hopping_leg.evaluate.runs import save_traces
from hopping_leg.evaluate.terminal import print_tables
from hopping_leg.evaluate.trials import KINDS
from hopping_leg.io import write_atomically
from hopping_leg.robot import load_robot
from hopping_leg.sim import CONTROL_RATE, NO_NOISE, Engine, NoiseAndDelay


@dataclass(frozen=True)
class Evaluate:
    """What is judged, where and how often."""

    controllers: tyro.conf.Positional[tuple[str, ...]]
    """Names (energy-shaping, paper, fast, ...), .onnx files, a quoted pattern of them, or Python
    classes as FILE.py:CLASS; LABEL=FILE chooses the name in all tables."""
    suite: Literal["paper", "robustness", "skills"] = "paper"
    """The paper's trials; how far the world may change before a controller fails; or skills beyond
    the paper: so many hops and stop, stairs, soft landings."""
    axes: tuple[str, ...] = ()
    """Of the robustness suite: axes by name; default: all, and changes in the middle of a run."""
    robot: str = "legv2-paper"
    """A shipped robot or a .toml file."""
    commands: Heights | None = None
    """Apex heights of the fixed trials and the sequence, m; default 0.25,0.30,0.35, scaled to the
    leg's length."""
    seeds: int = 5
    """Realisations of noise and delay per trial."""
    seed: int = 1000
    """All of them follow from it; choose one that selected nothing."""
    out: Path | None = None
    """Folder for evaluation.json, report.html and traces/, instead of naming each; the robustness
    suite leaves robustness.json, robustness.svg and all that a killed run goes on from, the skills
    suite skills.json."""
    json: Path | None = None
    """File for every number."""
    report: Path | None = None
    """File for the report, one self-contained HTML page."""
    traces: Path | None = None
    """Folder for the runs as Parquet, for `hop plot` and your own tools."""
    floor: Literal["soft", "stiff", "both"] = "both"
    """The robot's own contact (soft), the engine's default (stiff), or all trials on the first and
    the fixed ones on the second."""
    engine: Engine = "mujoco"
    """What computes the physics; pybullet needs the extra `bullet` and is much slower."""
    noise: bool = True
    """The paper's sensor noise, torque noise and delay."""
    timestep: float = 5e-4
    """Physics step, s."""
    rate: float = CONTROL_RATE
    """Control rate, Hz."""
    threads: int = 0
    """Threads of the physics, 0 for all cores; results do not depend on it."""
    video: bool = True
    """Put a short video of each controller into the report, where OpenGL is to be had."""


def run(args: Evaluate, notes: Sequence[str] = ()) -> None:
    """Evaluate controllers, print the table, write what was asked for.

    Args:
        args: Options.
        notes: Sentences for table and report of the paper's trials, before those that arise.
    """
    command = command_line("hop evaluate", args)
    if args.suite == "paper":
        args = _with_folder(args)
    _check(args)
    robot = load_robot(args.robot)
    disturbance = NoiseAndDelay() if args.noise else NO_NOISE
    setup = RolloutConfig(
        robot,
        disturbance,
        rate=args.rate,
        timestep=args.timestep,
        threads=args.threads,
        engine=args.engine,
    )
    candidates = load_candidates(args.controllers, robot, args.rate)
    if args.suite == "robustness":
        with progress_bar() as bar:
            result = judge_robustness(args, candidates, setup, _bar_updater(bar), command)
        print_robustness(Console(), result)
        return
    if args.suite == "skills":
        with progress_bar() as bar:
            result = judge_skills(args, candidates, setup, _bar_updater(bar), command)
        print_skills(Console(), result)
        return
    judged = judge(candidates, setup, args)
    notes = [*notes, *judged.evaluation.notes]
    judged = replace(judged, evaluation=replace(judged.evaluation, command=command, notes=notes))
    if args.json:
        write_atomically(args.json, judged.evaluation.dumps())
    console = Console()
    print_tables(console, judged.evaluation)
    if args.traces:
        save_traces(judged.runs, args.traces)
    if args.report:
        videos = render_videos(judged, robot) if args.video else None
        write_atomically(args.report, write_report(judged, videos))
    for path in (args.json, args.report, args.traces):
        if path:
            console.print(f"Wrote {path}", highlight=False, soft_wrap=True)


def _check(args: Evaluate) -> None:
    """Refuse what cannot work before anything is simulated."""
    if args.axes and args.suite != "robustness":
        raise UsageError("--axes belongs to --suite robustness; give that, too.")
    for name, given in (("report", args.report), ("traces", args.traces)):
        if given and args.suite != "paper":
            raise UsageError(f"--{name} belongs to the paper's suite; leave it out.")
    if args.seed < 0:
        raise UsageError(f"A seed of {args.seed} has no meaning; give 0 or more.")
    for path in (args.json, args.report):
        if path and path.is_dir():
            raise UsageError(f"{path} is a folder; name a file.")
    for folder in (args.json and args.json.parent, args.report and args.report.parent, args.traces):
        if folder:
            folder.mkdir(parents=True, exist_ok=True)


def _with_folder(args: Evaluate) -> Evaluate:
    if args.out is None:
        return args
    return replace(
        args,
        json=args.json or args.out / "evaluation.json",
        report=args.report or args.out / "report.html",
        traces=args.traces or args.out / "traces",
    )


def judge(candidates: list[Candidate], setup: RolloutConfig, args: Evaluate) -> Judged:
    """Run all trials under a progress bar."""
    floors = ("soft", "stiff") if args.floor == "both" else (args.floor,)
    with progress_bar() as bar:
        judged = _on_floor(candidates, setup, args, floors[0], bar)
        if len(floors) == 1:
            return judged
        secondary = _on_floor(candidates, setup, args, floors[1], bar)
    return Judged(replace(judged.evaluation, secondary=secondary.evaluation), judged.runs)


def _on_floor(
    candidates: list[Candidate], setup: RolloutConfig, args: Evaluate, floor: str, bar: Progress
) -> Judged:
    whole = floor == "soft" or args.floor != "both"
    return evaluate(
        candidates,
        setup,
        commands=args.commands,
        repeats=args.seeds,
        seed=args.seed,
        floor=floor,
        kinds=KINDS if whole else ("fixed",),
        on_progress=_bar_updater(bar, f", {floor} floor"),
    )


def progress_bar() -> Progress:
    """Return a bar that shows share, elapsed and remaining time."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f}%"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
    )


def _bar_updater(bar: Progress, about: str = "") -> Callable[[str, float], None]:
    tasks: dict[str, tuple[int, float]] = {}

    def update(label: str, share: float) -> None:
        if label not in tasks:
            tasks[label] = (bar.add_task(f"{label}{about}", total=1.0), -1.0)
        task, shown = tasks[label]
        if share - shown > 0.005 or share >= 1:
            bar.update(bar.tasks[task].id, completed=share)
            tasks[label] = (task, share)

    return update
