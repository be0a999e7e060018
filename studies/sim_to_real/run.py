"""The study's two experiments: train and hop on twins, or predict a shipped policy's hops."""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tyro
from rich.console import Console

from hopping_leg.cli.options import Heights, at_least
from hopping_leg.cli.reproduce import show_transfer
from hopping_leg.controllers.registry import load_policy
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.statistics import median_interval
from hopping_leg.robot import (
    DriveMismatch,
    GroundMismatch,
    Latency,
    MassScale,
    ModelMismatch,
    Robot,
)
from hopping_leg.sim_to_real.methods import DEFAULT, FORETOLD, Method, choose_methods
from hopping_leg.sim_to_real.stages import HopOnTwin, HopTrial
from hopping_leg.sim_to_real.study import Study, find_twins
from hopping_leg.sim_to_real.transfer import (
    about,
    fit_row,
    fits,
    hops,
    records,
    transfer,
    work_through,
)

Without = Callable[[ModelMismatch], ModelMismatch]

_SEED = 0
"""Of the bootstrap."""


def _drives(*names: str) -> Without:
    """Return what makes attributes of both drives neutral."""
    neutral = {name: getattr(DriveMismatch(), name) for name in names}

    def without(reality: ModelMismatch) -> ModelMismatch:
        hip, knee = (dataclasses.replace(d, **neutral) for d in (reality.hip, reality.knee))
        return dataclasses.replace(reality, hip=hip, knee=knee)

    return without


EFFECTS: dict[str, Without] = {
    "latency": lambda reality: dataclasses.replace(reality, latency=Latency()),
    "motor": lambda reality: _drives("torque_gain", "torque_lag", "torque_limit", "ripple")(
        dataclasses.replace(reality, voltage=1.0)
    ),
    "losses": _drives("efficiency", "stiction"),
    "backlash": _drives("backlash"),
    "belt": _drives("stiffness", "stiffness_damping"),
    "sensors": _drives("sensor"),
    "masses": lambda reality: dataclasses.replace(
        reality, mass=MassScale(), ground=GroundMismatch()
    ),
}
"""Effects of ``[reality]`` by name, and what takes each away."""


@dataclass(frozen=True)
class HopWithout(HopOnTwin):
    """A policy tried on a twin that lacks one effect."""

    effect: str

    @property
    def name(self) -> str:
        """What is done."""
        return f"{super().name}, without {self.effect}"

    @property
    def leg(self) -> Robot:
        """The twin without the effect."""
        robot = self.twin.robot
        return dataclasses.replace(robot, reality=EFFECTS[self.effect](robot.reality))

    @property
    def file(self) -> Path:
        """File of the result."""
        path = super().file
        return path.with_name(f"{path.stem}-without-{self.effect}.json")


def effect_rows(hops: Sequence[HopOnTwin], without: Sequence[HopWithout]) -> list[dict[str, Any]]:
    """Return the errors with every effect and with each taken away, one row each.

    Args:
        hops: On the twins as they are.
        without: On the twins with one effect less.
    """
    kinds = {"all effects": list(hops)}
    for job in without:
        kinds.setdefault(f"without {job.effect}", []).append(job)
    return [_row(kind, jobs) for kind, jobs in kinds.items()]


def _row(kind: str, jobs: Sequence[HopOnTwin]) -> dict[str, Any]:
    rows = [row for job in jobs for row in job.rows()]
    twins = dict.fromkeys(row["twin"] for row in rows)
    errors = [np.array([r["median_abs_error_m"] for r in rows if r["twin"] == t]) for t in twins]
    low, high = median_interval(errors, _SEED)
    stds = [row["std_m"] for row in rows if row["hops"]]
    return {
        "twin": kind,
        "median_abs_error_m": float(np.median(np.concatenate(errors))),
        "median_abs_error_low_m": low,
        "median_abs_error_high_m": high,
        "worst_abs_error_m": float(np.max(np.concatenate(errors))),
        "median_std_m": float(np.median(stds)) if stds else None,
        "skipped_hops": sum(row["skipped_hops"] for row in rows),
    }


POLICY = "fast"
"""It corrects itself least, so that its apexes tell most of the leg, and hops on all of them."""


@dataclass(frozen=True)
class Meet(HopTrial):
    """The shipped policy on a twin."""

    @property
    def name(self) -> str:
        """What is done."""
        return f"hop on {self.twin.name}, shipped {POLICY}"

    @property
    def file(self) -> Path:
        """File of the result."""
        return self.study.folder / "predictions" / f"{self.twin.name}.json"

    @property
    def policy(self) -> bytes:
        """The shipped policy."""
        return load_policy(POLICY).content


@dataclass(frozen=True)
class Foretell(Meet):
    """The shipped policy in what a method believes a twin to be."""

    method: Method

    @property
    def name(self) -> str:
        """What is done."""
        return f"foretell {self.twin.name}, {self.method.name}"

    @property
    def leg(self) -> Robot:
        """The method's simulation."""
        return self.study.simulated(self.twin, self.method)

    @property
    def file(self) -> Path:
        """File of the result."""
        return self.study.folder / "predictions" / f"{self.twin.name}-{self.method.name}.json"


def prediction_rows(foretold: Sequence[Foretell], met: Sequence[Meet]) -> list[dict[str, Any]]:
    """Return how far each method's predicted apexes are off, one row per method.

    A leg that does not hop counts with an apex of zero.

    Args:
        foretold: In each method's simulation of every twin, done.
        met: On every twin, done.

    Returns:
        Medians over twins and commands, intervals over twins; ``errors_m`` are predicted minus
        measured apexes by twin and command, m.
    """
    true = {job.twin.name: _apexes(job) for job in met}
    rows = []
    for method in dict.fromkeys(job.method for job in foretold):
        errors = {
            job.twin.name: _apexes(job) - true[job.twin.name]
            for job in foretold
            if job.method == method
        }
        absolute = [np.abs(error) for error in errors.values()]
        low, high = median_interval(absolute, _SEED)
        rows.append({
            "method": method.name,
            "meaning": method.meaning,
            "median_abs_error_m": float(np.median(np.concatenate(absolute))),
            "median_abs_error_low_m": low,
            "median_abs_error_high_m": high,
            "worst_abs_error_m": float(np.max(np.concatenate(absolute))),
            "median_error_m": float(np.median(np.concatenate(list(errors.values())))),
            "errors_m": {name: error.tolist() for name, error in errors.items()},
        })  # fmt: skip
    return rows


def _apexes(job: Meet) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the median apex at every command, m."""
    return np.array([row["command_m"] + row["median_error_m"] for row in job.measured()])


def transfer_and_effects(study: Study, at_once: int) -> dict[str, Any]:
    """Run the transfer; if the study asks for it, also on twins that lack one effect at a time."""
    result = transfer(study, at_once)
    if study.effects:
        work_through([without(study)], at_once)
        first = [job for job in hops(study) if job.method == study.methods[0]]
        result["effects"] = effect_rows(first, without(study))
    return result


def predict(study: Study, at_once: int = 1) -> dict[str, Any]:
    """Compare what the methods' simulations foretell, without a training; return the numbers.

    Args:
        study: Which methods on which twins; what it says of trainings is not used.
        at_once: Jobs that run at the same time, each in a process of its own.

    Raises:
        UsageError: A method has no simulation of its own, or the folder holds results of other
            options.
    """
    for method in study.methods:
        if method.randomised:
            raise UsageError(
                f"The method '{method.name}' trains on many simulations, so that none foretells;"
                f" name others, e.g. {', '.join(FORETOLD)}."
            )
    work_through((records(study), fits(study), [*foretold(study), *met(study)]), at_once)
    return {
        **about(study),
        "policy": POLICY,
        "methods": prediction_rows(foretold(study), met(study)),
        "identification": [fit_row(fit) for fit in fits(study)],
    }


def without(study: Study) -> list[HopWithout]:
    """Return the trials on twins that lack one effect, if they were asked for."""
    return [
        HopWithout(study, twin, study.methods[0], seed, effect)
        for effect in (EFFECTS if study.effects else ())
        for seed in study.seeds
        for twin in study.twins
    ]


def foretold(study: Study) -> list[Foretell]:
    """Return what each method's simulation says of the shipped policy's hops."""
    return [Foretell(study, twin, method) for method in study.methods for twin in study.twins]


def met(study: Study) -> list[Meet]:
    """Return the same policy's hops on the twins."""
    return [Meet(study, twin) for twin in study.twins]


@dataclass(frozen=True)
class Experiment:
    """What is compared on which twins, and where it is kept."""

    experiment: tyro.conf.Positional[Literal["transfer", "prediction"]] = "transfer"
    """Train and hop on the twins, or foretell hops."""
    twins: tuple[str, ...] = ("5",)
    """How many twins to draw, or robot files that extend what is believed of them."""
    methods: tuple[str, ...] | None = None
    """What policies are trained on, the others being compared with the first; or what foretells.
    Valid: identified, cad, table-1, randomised, identified-surprises, cad-surprises (these three
    not to foretell), rail-only, fixed-base-only, two-pass, one-pass, truth. Default: the first
    four; or all that can foretell."""
    seeds: tuple[int, ...] = (0,)
    """Seeds of the trainings, one of each method and twin each."""
    recipe: str = "adaptive"
    """Recipe by which policies are trained, as in `hop train`; `fast` is the quicker one, but
    corrects nothing of what no fit can find."""
    set: tuple[str, ...] = ()
    """Numbers of the recipe to change, as in `hop train`; not its steps."""
    steps: int = Study.steps
    """Control steps of experience of a training."""
    seconds: float = 60.0
    """Duration of each recording, s; the paper's are 240 s."""
    generations: int = 100
    """Generations of CMA-ES in each pass, for the methods two-pass and one-pass."""
    commands: Heights = Study.commands
    """Apex heights at which the twins are tried, m."""
    repeats: int = 3
    """Runs of 15 s at each command."""
    effects: bool = False
    """Let the first method's policies also meet the twins with one effect less at a time: what each
    effect costs."""
    jobs: int = 1
    """Recordings, fits, trainings or trials at the same time, each in its own process."""
    threads: int = 1
    """Threads of each job."""
    folder: Path = Path("runs/transfer")
    """Folder for recordings, robots, trainings and trials; what is there is not done again."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run the experiment, print the tables, return every number."""
        at_least(1, jobs=self.jobs)

        foretell = self.experiment == "prediction"
        usual = FORETOLD if foretell else DEFAULT
        study = Study(
            self.folder,
            find_twins(self.twins, self.folder / "twins"),
            tuple(choose_methods(self.methods or usual)),
            seeds=self.seeds,
            recipe=self.recipe,
            changes=self.set,
            steps=self.steps,
            seconds=self.seconds,
            generations=self.generations,
            commands=self.commands,
            repeats=self.repeats,
            effects=self.effects,
            threads=self.threads,
        )
        result = predict(study, self.jobs) if foretell else transfer_and_effects(study, self.jobs)
        (show_predictions if foretell else show_transfer)(result)
        return result


def show_predictions(result: dict[str, Any]) -> None:
    """Print how far off each method's predictions are."""
    console = Console()
    for row in result["methods"]:
        console.print(
            f"{row['method']} foretells apexes to {_mm(row['median_abs_error_m'])} mm"
            f" ({_mm(row['median_abs_error_low_m'])} to {_mm(row['median_abs_error_high_m'])})",
            highlight=False,
        )


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.0f}"
