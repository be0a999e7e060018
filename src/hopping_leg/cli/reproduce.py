"""The main job: the whole paper in miniature, from a leg that is not known to hops on it.

A twin plays the real leg. It is recorded and identified, its belt too; a policy is trained from
scratch on what was identified and hops on the twin without tuning, beside one that was trained on
the CAD's robot and energy shaping tuned on other twins: that is said first. The paper's trials
judge it in its own simulation. A run that was killed goes on with the same command. In a checkout
`python -m studies.sim_to_real` does it on many twins.

Examples:
  hop reproduce --quick                         # does everything work here?
  hop reproduce
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hopping_leg import io
from hopping_leg.cli import options
from hopping_leg.errors import UsageError
from hopping_leg.robot import Robot, load_robot
from hopping_leg.terminal import Progress

if TYPE_CHECKING:
    from hopping_leg.evaluate import EvaluationRun
    from hopping_leg.identify.recording import Recording

COMMANDS = (0.25, 0.27, 0.29, 0.31, 0.33, 0.35)  # Apex heights at which the twin is tried, m

_RECORD_SECONDS = 30.0  # on each rig
_FIRST_SEED = 1000  # of noise on the twin; it chose nothing
_RECORDED = Path("studies/real_hops/results/real_hops.json")  # in a checkout, and rows of it:
_BOOM = "boom, 200 Hz", "torques as measured"
_INERTIA_FACTOR = 10.0  # the paper's Table I has nine times the CAD's inertia of the shank

NOTHING_MEANT = (
    "This was a quick run: every step works, but was cut so short that its numbers mean nothing;"
    " leave out --quick for numbers."
)


@dataclass(frozen=True)
class Reproduce:
    """What to reproduce and where to keep it."""

    out: Path | None = None
    """Folder for report.html, evaluation.json and traces/ of the hops on the twin, the same in
    simulation/, recordings, robots and trainings; default: runs/reproduce or runs/quick."""
    seed: int = 0
    """Seed of the trainings; the trials' seeds follow from another number."""
    quick: bool = False
    """Take every step as shortly as can be, to see that it works; the numbers mean nothing."""


def run(args: Reproduce) -> None:
    """Record, identify, train, hop on the twin, evaluate, report."""
    from hopping_leg.cli import evaluate
    from hopping_leg.controllers import registry
    from hopping_leg.locks import hold_folder
    from hopping_leg.sim.randomization import draw_twin

    folder = args.out or Path("runs") / ("quick" if args.quick else "reproduce")
    options.at_least(0, seed=args.seed)
    notes, drawn = [NOTHING_MEANT] if args.quick else [], draw_twin(0)
    twin, believed = drawn.robot, str(drawn.tree["extends"])
    with hold_folder(folder, UsageError):
        file, asked_for = folder / "options.json", {"seed": args.seed, "quick": args.quick}
        if file.exists() and io.parse_json(file.read_bytes(), str(file)) != asked_for:
            raise UsageError(f"{folder} holds a run with other options; give another --out.")
        io.write_json(file, asked_for)
        recordings = list(_record(twin, believed, folder))
        identified = _identify(recordings, believed, folder, quick=args.quick)
        told: dict[str, tuple[str | Path, str]] = {
            name: (_train(robot, folder / "training", args), robot)
            for name, robot in {"identified": identified, "cad": believed}.items()
        }
        told[registry.ENERGY_SHAPING_TUNED] = registry.ENERGY_SHAPING_TUNED, believed
        transfer = _hop(twin, told, quick=args.quick)
    policy, _ = told["identified"]
    said = [*notes, *_outcome(transfer)]
    evaluate.keep(evaluate.Evaluate((), out=folder), transfer, said)
    others = ("fast",) if args.quick else registry.shipped_policies()
    options.say(*said)
    asked = evaluate.Evaluate(
        (f"identified={policy}", *others, registry.ENERGY_SHAPING), robot=identified,
        seeds=1 if args.quick else 5, out=folder / "simulation",
        floor="soft" if args.quick else "both",
    )  # fmt: skip
    evaluate.keep(asked, evaluate.judge(asked), notes)
    options.say(
        f"Reports: {folder / 'report.html'}, {folder / 'simulation' / 'report.html'}",
        f"Identified robot, and its policy: {identified}, {policy}",
    )


def _outcome(transfer: "EvaluationRun") -> list[str]:
    """Say what hops on the twin, which errs least, and how recorded hops come out in simulation."""
    from hopping_leg.evaluate import metrics, statistics

    found = []
    for name in transfer.evaluation.controllers:
        own = (run.trace for run in transfer.runs if run.controller == name)
        windows = [window for trace in own for window in metrics.measure(trace)]
        errors = [1e3 * abs(error) for error in metrics.errors_of(windows)]
        low, high = statistics.median_interval(errors, _FIRST_SEED)
        heights = len({window.command for window in windows if len(window.apex)})
        found.append((float(np.median(np.concatenate(errors))), low, high, name, heights))
    best, second, *_ = found = sorted(found)
    wins = f"{best[3]} wins" if best[2] < second[1] else "None wins clearly"
    hops = ", ".join(f"{name} {heights}" for *_, name, heights in found)
    listed = ", ".join(f"{name} {x:.1f} [{low:.1f}, {high:.1f}]" for x, low, high, name, _ in found)
    said = [f"On the twin hop, of {len(COMMANDS)} heights: {hops}."]
    said += [f"{wins}: median |apex - command| and its 95 % interval, mm: {listed}."]
    if _RECORDED.exists():
        rows = io.parse_json(_RECORDED.read_bytes(), str(_RECORDED))["rows"]
        rms = {r["robot"]: 1e3 * r["apex_rms_m"] for r in rows if (r["rig"], r["drive"]) == _BOOM}
        said.append(
            f"Hops of the real leg, {_BOOM[0]}: {rms['legv2-identified']:.0f} mm rms off in its"
            f" identified simulation, {rms['legv2']:.0f} in the CAD's (studies/real_hops)."
        )
    return said


def _record(twin: Robot, believed: str, folder: Path) -> "Iterator[Recording]":
    """Play the paper's trajectories on the twin, clamped and on the rail; yield the recordings."""
    from hopping_leg.identify import excitation, paper_excitation, play_excitation
    from hopping_leg.identify.recording import load_recording

    templates = (
        ("fixed-base", paper_excitation.fixed_base(swings=(10.0,), duration=_RECORD_SECONDS)),
        ("rail", paper_excitation.moving_base(duration=_RECORD_SECONDS)),
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
    origin = folder / "with-belt.toml"
    belt = Path(__file__).parents[1] / "identify" / "with_belt.toml"
    io.write_atomically(origin, belt.read_text(encoding="utf-8").format(believed).encode())
    start = load_robot(str(origin))
    links = {"thigh.inertia": start.thigh.inertia, "shank.inertia": start.shank.inertia}
    bounds = {name: (v / _INERTIA_FACTOR, v * _INERTIA_FACTOR) for name, v in links.items()}
    effort = SearchOptions(tolerance=1e-3, **({"rounds": 1, "evaluations": 2} if quick else {}))
    asked = IdentifyOptions(("+reality.knee.stiffness",), bounds=bounds, effort=effort)
    with Progress("preparing") as bar:
        found = identify(
            recordings, start, options=asked,
            report=lambda stage, share, cost: bar.show(stage, share, f"cost {cost:.5g}"),
        )  # fmt: skip
    save_robot(found, file, str(origin))
    return str(file)


def _train(source: str, folder: Path, args: Reproduce) -> Path:
    from hopping_leg.rl.recipes.fast import FAST
    from hopping_leg.rl.train import train

    recipe, folder = FAST.replace({"steps": 1}) if args.quick else FAST, folder / Path(source).stem
    policy = folder / "policy.onnx"
    if not policy.exists():
        train(recipe, load_robot(source), args.seed, folder, resume=True, threads=2)
    return policy


def _hop(twin: Robot, told: dict[str, tuple[str | Path, str]], *, quick: bool) -> "EvaluationRun":
    """Let controllers, each told another robot, hop on the twin."""
    from hopping_leg.controllers import RolloutConfig
    from hopping_leg.controllers.registry import load_controller
    from hopping_leg.evaluate import runner
    from hopping_leg.evaluate.runner import Entry
    from hopping_leg.sim import NO_NOISE

    entries = [
        Entry(name, load_controller(what, load_robot(robot)))
        for name, (what, robot) in told.items()
    ]
    with Progress(parts=len(entries)) as bar:
        return runner.evaluate(
            entries, RolloutConfig(twin, NO_NOISE),  # a twin brings its own
            commands=COMMANDS, repeats=1 if quick else 3, seed=_FIRST_SEED, kinds=("fixed",),
            on_progress=partial(bar.show, about=f", {twin.name}"),
        )  # fmt: skip
