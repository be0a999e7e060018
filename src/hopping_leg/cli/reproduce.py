"""The main job: the whole paper in miniature, from a leg that is not known to hops on it.

A twin plays the real leg. It is recorded, identified from the recordings, a controller is trained
from scratch on what was identified, evaluated there beside the shipped controllers with the paper's
trials, and hops on the twin without tuning, beside a controller that was trained on the CAD's
robot. Takes less than five minutes on two idle cores. A run that was interrupted or killed goes on
where it was when the same command is called again. Many twins, the paper's sizes and other ways to
identify and train are a study of their own: `python -m studies.sim_to_real` in a checkout.

Examples:
  hop reproduce --quick                         # does everything work here?
  hop reproduce
  hop reproduce --seed 1 --out runs/second
"""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hopping_leg import errors, io
from hopping_leg.cli import evaluate, options
from hopping_leg.controllers.registry import ENERGY_SHAPING, shipped_policies
from hopping_leg.identify.optimizers import LeastSquaresOptions
from hopping_leg.sim_to_real.transfer import Transfer
from hopping_leg.sim_to_real.twins import USUAL_FIT, drawn_twin, given_twin

_GLANCE = LeastSquaresOptions(rounds=1, evaluations=2)
_MARK = "size.txt"
_JUDGING, _QUICK_JUDGING = 50.0, 10.0
"""Rough time that the evaluation and its report take, s."""

NOTHING_MEANT = (
    "This was a quick run: fit, training and trials were cut so short that its numbers mean"
    " nothing. It shows only that every step works; leave out --quick for numbers."
)


@dataclass(frozen=True)
class Reproduce:
    """What to reproduce and where to keep it."""

    out: Path | None = None
    """Folder for report.html, evaluation.json, transfer.json, traces/ and, in transfer/,
    recordings, robots, trainings and trials; default: runs/reproduce or runs/quick."""
    seed: int = 0
    """Seed of the trainings; the evaluation's seeds follow from another number."""
    twin: str | None = None
    """Robot file of the leg that plays the real one; default: one that is drawn."""
    steps: int = 1_200_000
    """Control steps of experience of each training."""
    jobs: int = 2
    """Recordings, trainings or trials at the same time; take the number of cores."""
    quick: bool = False
    """Take every step as shortly as can be, to see that it works; the numbers mean nothing."""
    json: Path | None = None
    """File for every number of the evaluation, besides evaluation.json."""

    @property
    def size(self) -> str:
        """Which of the two sizes."""
        return "quick" if self.quick else "usual"

    @property
    def folder(self) -> Path:
        """Where everything is kept."""
        return self.out or Path("runs") / self.size.replace("usual", "reproduce")


def run(args: Reproduce) -> None:
    """Record, identify, train, evaluate, transfer, report."""
    start = time.monotonic()
    _check(args)
    folder, notes = args.folder, [NOTHING_MEANT] if args.quick else []
    transfer = make_transfer(args)
    io.write_atomically(folder / _MARK, f"{args.size}\n".encode())
    judging = _QUICK_JUDGING if args.quick else _JUDGING
    result = transfer.run(args.jobs, args.jobs * judging)
    io.write_json(folder / "transfer.json", {**result, "notes": [*notes, *result["notes"]]})
    policy, robot = transfer.policy, transfer.identified
    others = ("fast",) if args.quick else shipped_policies()
    evaluate.run(
        evaluate.Evaluate(
            controllers=(f"identified={policy}", *others, ENERGY_SHAPING),
            robot=str(robot),
            seeds=1 if args.quick else 5,
            out=folder,
            json=args.json,
            floor="soft" if args.quick else "both",
            video=not args.quick,
        ),
        notes,
    )
    show_transfer(result)
    options.say(
        *notes,
        f"Done in {(time.monotonic() - start) / 60:.1f} minutes.",
        f"Report: {(folder / 'report.html').resolve()}",
        f"Transfer: {folder / 'transfer.json'}",
        f"Identified robot: {robot}",
        f"Policy: {policy} (its model card lies beside it)",
    )


def make_transfer(args: Reproduce) -> Transfer:
    """Return what is done with the twin."""
    from hopping_leg.rl.recipes.fast import FAST

    folder = args.folder / "transfer"
    return Transfer(
        folder,
        given_twin(args.twin) if args.twin else drawn_twin(0, folder / "twins"),
        FAST.replace({"steps": 1 if args.quick else args.steps}),
        args.seed,
        _GLANCE if args.quick else USUAL_FIT,
        repeats=1 if args.quick else 3,
    )


def _check(args: Reproduce) -> None:
    options.at_least(0, seed=args.seed)
    options.at_least(1, jobs=args.jobs, steps=args.steps)
    mark = args.folder / _MARK
    size = mark.read_text(encoding="utf-8", errors="replace").strip() if mark.exists() else ""
    if size not in ("", args.size):
        raise errors.UsageError(
            f"{args.folder} holds a run of the {size} size, not of the {args.size} one; give"
            " another --out."
        )


def show_transfer(result: dict[str, Any]) -> None:
    """Print the tables of sim-to-real trials."""
    rows = []
    for row in result["rows"]:
        low, high = (_mm(row[f"median_abs_error_{end}_m"]) for end in ("low", "high"))
        error, skipped = _mm(row["median_abs_error_m"]), row["skipped_hops"]
        hops = f"{skipped}/{row['hops'] + skipped}"
        command, signed = _mm(row["command_m"]), _mm(row["median_error_m"])
        rows.append((row["method"], command, error, f"{low}-{high}", signed, hops))
    options.show_table(
        ("trained on", "command, mm", "|error|, mm", "95 %", "error, mm", "skipped"), rows
    )
    show_overall(result)
    options.say(*(f"Note: {note}" for note in result["notes"]))


def show_overall(result: dict[str, Any]) -> None:
    """Print the methods' errors over all commands."""
    for row in result["methods"]:
        options.say(
            f"{row['method']}: {_mm(row['median_abs_error_m'])} mm over all commands,"
            f" {row['ordered']} of {row['policies']} policies in order"
        )
    for row in result["comparison"]:
        options.say(
            f"{row['method']} errs {row['ratio']:.1f} times as much as {row['over']}"
            f" ({row['ratio_low']:.1f} to {row['ratio_high']:.1f})"
        )


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.0f}" if metres == metres else "-"
