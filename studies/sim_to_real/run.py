"""The study's two experiments: train and hop on twins, or predict a shipped policy's hops."""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tyro
from rich.console import Console

from hopping_leg.arrays import Array
from hopping_leg.cli.options import Heights, at_least
from hopping_leg.cli.reproduce import show_transfer
from hopping_leg.controllers import Controller
from hopping_leg.controllers.registry import ENERGY_SHAPING, load_controller
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.statistics import LEAST_TWINS, median_interval, twins_note
from hopping_leg.evaluate.tables import millimetres
from hopping_leg.robot import (
    DriveMismatch,
    GroundMismatch,
    Latency,
    MassScale,
    ModelMismatch,
    Robot,
    load_robot,
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
    """Return the errors with every effect and with each taken away, one row each, by method.

    Args:
        hops: On the twins as they are.
        without: On the twins with one effect less.
    """
    kinds: dict[tuple[str, str], list[HopOnTwin]] = {}
    for job in hops:
        kinds.setdefault((job.method.name, "all effects"), []).append(job)
    for less in without:
        kinds.setdefault((less.method.name, f"without {less.effect}"), []).append(less)
    return [_row(method, kind, jobs) for (method, kind), jobs in kinds.items()]


def _row(method: str, kind: str, jobs: Sequence[HopOnTwin]) -> dict[str, Any]:
    rows = [row for job in jobs for row in job.rows()]
    twins = dict.fromkeys(row["twin"] for row in rows)
    errors = [np.array([r["median_abs_error_m"] for r in rows if r["twin"] == t]) for t in twins]
    low, high = median_interval(errors, _SEED, LEAST_TWINS)
    stds = [row["std_m"] for row in rows if row["hops"]]
    return {
        "method": method,
        "twin": kind,
        "median_abs_error_m": float(np.median(np.concatenate(errors))),
        "median_abs_error_low_m": low,
        "median_abs_error_high_m": high,
        "worst_abs_error_m": float(np.max(np.concatenate(errors))),
        "median_std_m": float(np.median(stds)) if stds else None,
        "skipped_hops": sum(row["skipped_hops"] for row in rows),
        "missed_runs": sum(row["missed_runs"] for row in rows),
    }


HOPPERS = ("fast", ENERGY_SHAPING)
"""What hops are foretold of: a policy, which no hop corrects, so that its apexes tell most of the
leg, and energy shaping, which no simulation has trained."""


@dataclass(frozen=True)
class Meet(HopTrial):
    """A shipped controller on a twin."""

    hopper: str

    @property
    def name(self) -> str:
        """What is done."""
        return f"hop on {self.twin.name}, shipped {self.hopper}"

    @property
    def file(self) -> Path:
        """File of the result."""
        return self.study.folder / "predictions" / f"{self.twin.name}-{self.hopper}.json"

    @property
    def controller(self) -> Controller:
        """The shipped controller, of the believed leg."""
        return load_controller(self.hopper, load_robot(self.twin.believed), other="accept")


@dataclass(frozen=True)
class Foretell(Meet):
    """A shipped controller in what a method believes a twin to be."""

    method: Method

    @property
    def name(self) -> str:
        """What is done."""
        return f"foretell {self.twin.name}, {self.method.name}, {self.hopper}"

    @property
    def leg(self) -> Robot:
        """The method's simulation."""
        return self.study.simulated(self.twin, self.method)

    @property
    def file(self) -> Path:
        """File of the result."""
        name = f"{self.twin.name}-{self.hopper}-{self.method.name}.json"
        return self.study.folder / "predictions" / name


def prediction_rows(foretold: Sequence[Foretell], met: Sequence[Meet]) -> list[dict[str, Any]]:
    """Return how far each method's predicted apexes are off, one row per controller and method.

    A leg that does not hop counts with the height in which it stands.

    Args:
        foretold: In each method's simulation of every twin, done.
        met: On every twin, done.

    Returns:
        Medians over twins and commands, intervals over twins; ``errors_m`` are predicted minus
        measured apexes by twin and command, m.
    """
    true = {(job.hopper, job.twin.name): _apexes(job) for job in met}
    kinds: dict[tuple[str, Method], dict[str, Array]] = {}
    for job in foretold:
        error = _apexes(job) - true[job.hopper, job.twin.name]
        kinds.setdefault((job.hopper, job.method), {})[job.twin.name] = error
    rows = []
    for (hopper, method), errors in kinds.items():
        absolute = [np.abs(error) for error in errors.values()]
        low, high = median_interval(absolute, _SEED, LEAST_TWINS)
        rows.append({
            "controller": hopper,
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


def _apexes(job: Meet) -> Array:
    """Return the median apex at every command, m."""
    return np.array([row["command_m"] + row["median_error_m"] for row in job.measured()])


def transfer_and_effects(study: Study, at_once: int) -> dict[str, Any]:
    """Run the transfer; if the study asks for it, also on twins that lack one effect at a time."""
    result = transfer(study, at_once)
    if study.effects:
        work_through([without(study)], at_once)
        shown = [job for job in hops(study) if job.method in _dissected(study)]
        result["effects"] = effect_rows(shown, without(study))
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
        if method.randomised or method.controller:
            reason = "trains on many simulations" if method.randomised else "has no simulation"
            raise UsageError(
                f"The method '{method.name}' {reason}, so that none foretells; name"
                f" others, e.g. {', '.join(FORETOLD)}."
            )
    work_through((records(study), fits(study), [*foretold(study), *met(study)]), at_once)
    return {
        **about(study),
        "methods": prediction_rows(foretold(study), met(study)),
        "identification": [fit_row(fit) for fit in fits(study)],
        "notes": twins_note(len(study.twins)),
    }


def without(study: Study) -> list[HopWithout]:
    """Return the trials on twins that lack one effect, if they were asked for."""
    return [
        HopWithout(study, hop.twin, hop.method, hop.seed, effect)
        for effect in (EFFECTS if study.effects else ())
        for hop in hops(study)
        if hop.method in _dissected(study)
    ]


def _dissected(study: Study) -> list[Method]:
    """Return the methods whose losses by each effect are told: the first, and energy shaping."""
    return [m for m in study.methods if m == study.methods[0] or m.controller]


def foretold(study: Study) -> list[Foretell]:
    """Return what each method's simulation says of the shipped controllers' hops."""
    return [
        Foretell(study, twin, hopper, method)
        for hopper in HOPPERS
        for method in study.methods
        for twin in study.twins
    ]


def met(study: Study) -> list[Meet]:
    """Return the same controllers' hops on the twins."""
    return [Meet(study, twin, hopper) for hopper in HOPPERS for twin in study.twins]


@dataclass(frozen=True)
class Experiment:
    """What is compared on which twins, and where it is kept."""

    experiment: tyro.conf.Positional[Literal["transfer", "prediction"]] = "transfer"
    """Train and hop on the twins, or foretell hops."""
    twins: tuple[str, ...] = (str(LEAST_TWINS),)
    """How many twins to draw, or robot files that extend what is believed of them; intervals over
    twins need 20."""
    methods: tuple[str, ...] | None = None
    """What policies are trained on, the others being compared with the first; or what foretells.
    Valid: identified, cad, table-1, randomised, identified-surprises, cad-surprises (these three
    not to foretell), rail-only, fixed-base-only, two-pass, one-pass, truth. Default: the first
    four; or all that can foretell."""
    seeds: tuple[int, ...] = (0,)
    """Seeds of the trainings, one of each method and twin each."""
    recipe: str = Study.recipe
    """Recipe by which policies are trained, as in `hop train`."""
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
        study = Study(
            self.folder,
            find_twins(self.twins, self.folder / "twins"),
            tuple(choose_methods(self._methods())),
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

    def _methods(self) -> tuple[str, ...]:
        if self.experiment == "prediction":
            return self.methods or FORETOLD
        asked = DEFAULT if self.methods is None else self.methods
        return asked if not asked or ENERGY_SHAPING in asked else (*asked, ENERGY_SHAPING)


def show_predictions(result: dict[str, Any]) -> None:
    """Print how far off each method's predictions are."""
    console = Console()
    for row in result["methods"]:
        console.print(
            f"{row['method']} foretells apexes of {row['controller']} to"
            f" {millimetres(row['median_abs_error_m'])} mm"
            f" ({millimetres(row['median_abs_error_low_m'])} to"
            f" {millimetres(row['median_abs_error_high_m'])})",
            highlight=False,
        )
    for note in result["notes"]:
        console.print(f"Note: {note}", highlight=False)
