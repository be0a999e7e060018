"""The main job: the whole paper in miniature, from a leg that is not known to hops on it.

A twin plays the real leg. It is recorded, identified from the recordings, a policy is trained from
scratch on what was identified and hops on the twin without tuning, beside one that was trained on
the CAD's robot and beside energy shaping. Then the paper's trials judge it in its own simulation,
beside the shipped policies. A run that was interrupted or killed goes on where it was when the same
command is called again. Many twins and other ways to identify and train are a study of their own:
`python -m studies.sim_to_real` in a checkout.

Examples:
  hop reproduce --quick                         # does everything work here?
  hop reproduce
  hop reproduce --seed 1 --out runs/second
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from hopping_leg import io
from hopping_leg.cli import options
from hopping_leg.errors import UsageError
from hopping_leg.robot import Robot, load_robot
from hopping_leg.terminal import Progress

if TYPE_CHECKING:
    from hopping_leg.evaluate import EvaluationRun
    from hopping_leg.identify.recording import Recording

COMMANDS = (0.25, 0.27, 0.29, 0.31, 0.33, 0.35)  # Apex heights at which the twin is tried, m

_RECORDED = 30.0  # s on each rig
_FIRST_SEED = 1000  # of noise on the twin; it chose nothing
_INERTIA_FACTOR = 10.0  # the paper's Table I has nine times the CAD's inertia of the shank

NOTHING_MEANT = (
    "This was a quick run: fit, training and trials were cut so short that its numbers mean"
    " nothing. It shows only that every step works; leave out --quick for numbers."
)


@dataclass(frozen=True)
class Reproduce:
    """What to reproduce and where to keep it."""

    out: Path | None = None
    """Folder for transfer.html, report.html, both with a JSON file beside them, traces/, and
    recordings, robots and trainings; default: runs/reproduce or runs/quick."""
    seed: int = 0
    """Seed of the trainings; the trials' seeds follow from another number."""
    quick: bool = False
    """Take every step as shortly as can be, to see that it works; the numbers mean nothing."""


def run(args: Reproduce) -> None:
    """Record, identify, train, hop on the twin, evaluate, report."""
    from hopping_leg.cli import evaluate
    from hopping_leg.controllers.registry import ENERGY_SHAPING, shipped_policies
    from hopping_leg.evaluate import tables
    from hopping_leg.evaluate.report import write_report
    from hopping_leg.locks import hold_folder
    from hopping_leg.sim.randomization import draw_twin

    folder = args.out or Path("runs") / ("quick" if args.quick else "reproduce")
    notes = [NOTHING_MEANT] if args.quick else []
    options.at_least(0, seed=args.seed)
    drawn = draw_twin(0)
    twin, believed = drawn.robot, str(drawn.tree["extends"])
    with hold_folder(folder, UsageError):
        _check_same(folder, {"seed": args.seed, "quick": args.quick})
        recordings = list(_record(twin, believed, folder))
        identified = _identify(recordings, believed, folder, quick=args.quick)
        policies = {
            name: (_train(robot, folder / "training", args), robot)
            for name, robot in {"identified": identified, "cad": believed}.items()
        }
        transfer = _hop(twin, believed, policies, quick=args.quick)
    policy, _ = policies["identified"]
    judged = transfer.evaluation
    io.write_json(folder / "transfer.json", {**judged.to_json(), "notes": notes})
    io.write_atomically(folder / "transfer.html", write_report(transfer))
    others = ("fast",) if args.quick else shipped_policies()
    evaluate.run(
        evaluate.Evaluate(
            (f"identified={policy}", *others, ENERGY_SHAPING),
            robot=identified,
            seeds=1 if args.quick else 5,
            out=folder,
            floor="soft" if args.quick else "both",
        ),
        notes,
    )
    options.say(f"On {twin.name}:")
    tables.print_evaluation(judged)
    options.say(
        *notes,
        f"Reports: {folder / 'transfer.html'} and {folder / 'report.html'}",
        f"Identified robot: {identified}",
        f"Policy: {policy} (its model card lies beside it)",
    )


def _check_same(folder: Path, asked: dict[str, object]) -> None:
    """Refuse a folder that holds a run of other options."""
    file = folder / "options.json"
    if file.exists() and io.parse_json(file.read_bytes(), str(file)) != asked:
        raise UsageError(f"{folder} holds a run with other options; give another --out.")
    io.write_json(file, asked)


def _record(twin: Robot, believed: str, folder: Path) -> "Iterator[Recording]":
    """Play the paper's trajectories on the twin, clamped and on the rail; yield the recordings."""
    from hopping_leg.identify import excitation, paper_excitation, play_excitation
    from hopping_leg.identify.recording import load_recording

    templates = (
        ("fixed-base", paper_excitation.fixed_base(swings=(10.0,), duration=_RECORDED)),
        ("rail", paper_excitation.moving_base(duration=_RECORDED)),
    )
    robot = load_robot(believed)
    for seed, (rig, template) in enumerate(templates):
        file = folder / "recordings" / f"{rig}.parquet"
        if not file.exists():
            made = excitation.make_excitation(paper_excitation.adapt(template, robot), robot)
            play_excitation.play(made, twin, believed=believed, seed=seed).save(file)
        yield load_recording(file)


def _identify(recordings: "list[Recording]", believed: str, folder: Path, *, quick: bool) -> str:
    """Fit the believed robot to the recordings; return the identified robot's file."""
    from hopping_leg.identify.optimizers import SearchOptions
    from hopping_leg.identify.pipeline import IdentifyOptions, identify
    from hopping_leg.identify.result import save_robot

    file = folder / "identified.toml"
    if file.exists():
        return str(file)
    start = load_robot(believed)
    links = {"thigh.inertia": start.thigh.inertia, "shank.inertia": start.shank.inertia}
    bounds = {name: (v / _INERTIA_FACTOR, v * _INERTIA_FACTOR) for name, v in links.items()}
    effort = SearchOptions(tolerance=1e-3)
    if quick:
        effort = replace(effort, rounds=1, evaluations=2)
    asked = IdentifyOptions(bounds=bounds, effort=effort)
    with Progress("preparing") as bar:
        found = identify(
            recordings,
            start,
            options=asked,
            report=lambda stage, share, cost: bar.show(stage, share, f"cost {cost:.5g}"),
        )
    save_robot(found, file, believed)
    return str(file)


def _train(source: str, folder: Path, args: Reproduce) -> Path:
    from hopping_leg.rl.recipes.fast import FAST
    from hopping_leg.rl.train import train

    recipe, folder = FAST.replace({"steps": 1}) if args.quick else FAST, folder / Path(source).stem
    policy = folder / "policy.onnx"
    if not policy.exists():
        train(recipe, load_robot(source), args.seed, folder, resume=True, threads=2)
    return policy


def _hop(
    twin: Robot, believed: str, policies: dict[str, tuple[Path, str]], *, quick: bool
) -> "EvaluationRun":
    """Let policies, told the robots of their trainings, and energy shaping hop on the twin."""
    from hopping_leg.controllers import RolloutConfig
    from hopping_leg.controllers.registry import ENERGY_SHAPING, load_controller
    from hopping_leg.evaluate import runner
    from hopping_leg.evaluate.runner import Entry
    from hopping_leg.sim import NO_NOISE

    told: dict[str, tuple[str | Path, str]] = {**policies}
    told[ENERGY_SHAPING] = ENERGY_SHAPING, believed
    entries = [
        Entry(name, load_controller(what, load_robot(robot)))
        for name, (what, robot) in told.items()
    ]
    with Progress(parts=len(entries)) as bar:
        return runner.evaluate(
            entries,
            RolloutConfig(twin, NO_NOISE),  # a twin brings its own
            commands=COMMANDS,
            repeats=1 if quick else 3,
            seed=_FIRST_SEED,
            kinds=("fixed",),
            on_progress=partial(bar.show, about=f", {twin.name}"),
        )
