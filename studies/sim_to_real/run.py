"""The study's two experiments: train and hop on twins, or predict a shipped policy's hops."""

import dataclasses
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.cli.options import Heights, at_least, say, show_table
from hopping_leg.controllers import Controller
from hopping_leg.controllers.registry import ENERGY_SHAPING, load_controller
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.statistics import LEAST_TWINS, twins_note
from hopping_leg.evaluate.tables import millimetres
from hopping_leg.rl.run_folder import read_result
from hopping_leg.robot import (
    DriveMismatch,
    GroundMismatch,
    Latency,
    MassScale,
    ModelMismatch,
    Robot,
    load_robot,
)
from studies.sim_to_real.jobs import work_through
from studies.sim_to_real.policies import HopTrial
from studies.sim_to_real.study import (
    DEFAULT,
    FORETOLD,
    Method,
    Study,
    about,
    choose_methods,
    find_twins,
)
from studies.sim_to_real.tables import Row, median_over_twins, overall, tabulate
from studies.sim_to_real.twins import Twin, simulated
from studies.sim_to_real.zero_shot import ZeroShot

Without = Callable[[ModelMismatch], ModelMismatch]


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
class HopWithout(HopTrial):
    """A policy tried on a twin that lacks one effect."""

    effect: str = ""

    @property
    def name(self) -> str:
        """What is done."""
        return f"{super().name}, without {self.effect}"

    @property
    def leg(self) -> Robot:
        """The twin without the effect."""
        robot = self.twin.robot
        return dataclasses.replace(robot, reality=EFFECTS[self.effect](robot.reality))


def without(hop: HopTrial, effect: str) -> HopWithout:
    """Return a trial on the same twin, one effect taken away."""
    fields = {field.name: getattr(hop, field.name) for field in dataclasses.fields(hop)}
    file = hop.file.with_name(f"{hop.file.stem}-without-{effect}.json")
    return HopWithout(**{**fields, "file": file}, effect=effect)


def effect_rows(hops: Sequence[HopTrial], less: Sequence[HopWithout]) -> list[Row]:
    """Return the errors with every effect and with each taken away, one row each, by method.

    Args:
        hops: On the twins as they are.
        less: On the twins with one effect less.
    """
    kinds: dict[tuple[str, str], list[Row]] = {}
    for hop in hops:
        kinds.setdefault((hop.method, "all effects"), []).extend(hop.rows())
    for hop in less:
        kinds.setdefault((hop.method, f"without {hop.effect}"), []).extend(hop.rows())
    return [
        {
            "method": method,
            "twin": kind,
            **median_over_twins(rows, "median_abs_error_m"),
            "worst_abs_error_m": max(row["median_abs_error_m"] for row in rows),
            "median_std_m": _median([row["std_m"] for row in rows if row["hops"]]),
            "skipped_hops": sum(row["skipped_hops"] for row in rows),
            "missed_runs": sum(row["missed_runs"] for row in rows),
        }
        for (method, kind), rows in kinds.items()
    ]


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if values else None


HOPPERS = ("fast", ENERGY_SHAPING)
"""What hops are foretold of: a policy, which no hop corrects, so that its apexes tell most of the
leg, and energy shaping, which no simulation has trained."""


@dataclass(frozen=True)
class Meet(HopTrial):
    """A shipped controller, named as the method, on a twin."""

    @property
    def name(self) -> str:
        """What is done."""
        return f"hop on {self.twin.name}, shipped {self.method}"

    @property
    def controller(self) -> Controller:
        """The shipped controller, of the believed leg."""
        return load_controller(self.method, load_robot(self.twin.believed), other="accept")


@dataclass(frozen=True)
class Foretell(Meet):
    """A shipped controller in what a method believes a twin to be: the robot ``source``."""

    believer: Method | None = None
    source: str = ""

    @property
    def name(self) -> str:
        """What is done."""
        assert self.believer is not None
        return f"foretell {self.twin.name}, {self.believer.name}, {self.method}"

    @property
    def leg(self) -> Robot:
        """The method's simulation."""
        return simulated(self.source)


def prediction_rows(foretold: Sequence[Foretell], met: Sequence[Meet]) -> list[Row]:
    """Return how far each method's predicted apexes are off, one row per controller and method.

    A leg that does not hop counts with the height in which it stands.

    Args:
        foretold: In each method's simulation of every twin, done.
        met: On every twin, done.

    Returns:
        Medians over twins and commands, intervals over twins; ``errors_m`` are predicted minus
        measured apexes by twin and command, m.
    """
    true = {(job.method, job.twin.name): _apexes(job) for job in met}
    kinds: dict[tuple[str, Method], dict[str, Array]] = {}
    for job in foretold:
        assert job.believer is not None
        error = _apexes(job) - true[job.method, job.twin.name]
        kinds.setdefault((job.method, job.believer), {})[job.twin.name] = error
    rows = []
    for (hopper, method), errors in kinds.items():
        absolute = [
            {"twin": twin, "median_abs_error_m": abs(e)} for twin in errors for e in errors[twin]
        ]
        rows.append({
            "controller": hopper,
            "method": method.name,
            "meaning": method.meaning,
            **median_over_twins(absolute, "median_abs_error_m"),
            "worst_abs_error_m": float(max(row["median_abs_error_m"] for row in absolute)),
            "median_error_m": float(np.median(np.concatenate(list(errors.values())))),
            "errors_m": {name: error.tolist() for name, error in errors.items()},
        })  # fmt: skip
    return rows


def _apexes(job: Meet) -> Array:
    """Return the median apex at every command, m."""
    return np.array([row["command_m"] + row["median_error_m"] for row in job.rows()])


def transfer(study: Study, at_once: int) -> Row:
    """Run a study, or what is left of it, and return its numbers.

    If the study asks for it, policies also hop on twins that lack one effect at a time.

    Raises:
        UsageError: The folder holds results of other options, or there is no such recipe.
    """
    made = [*study.trainings(), *study.tunings()]
    rounds = (study.records(), study.fits(), made, study.hops())
    work_through(rounds, at_once)
    meanings = {method.name: method.meaning for method in study.methods}
    trials = [row for hop in study.hops() for row in hop.rows()]
    result = {
        **about(study.twins, study.seconds, study.repeats),
        "training_seeds": list(study.seeds),
        "recipe": study.recipe,
        "recipe_changes": list(study.changes),
        "training_steps": study.steps,
        **tabulate(meanings, trials),
        **best_in_own_simulation(study, trials),
        "identification": [fit.row() for fit in study.fits()],
        "trainings": [training.row() for training in study.trainings()],
    }
    if study.effects:
        shown = (study.methods[0].name, ENERGY_SHAPING)
        hops = [hop for hop in study.hops() if hop.method in shown]
        less = [without(hop, effect) for effect in EFFECTS for hop in hops]
        work_through([less], at_once)
        result["effects"] = effect_rows(hops, less)
    return result


def best_in_own_simulation(study: Study, trials: Sequence[Row]) -> Row:
    """Return methods and comparison over one policy per method and twin.

    It is the one that hops best in the simulation that it was trained in: what someone gets who
    trains several times and chooses without having met the leg.
    """
    if len(study.seeds) == 1:
        return {}
    best = {}
    for method, twin in itertools.product(study.methods, study.twins):
        seeds = study.seeds[:1] if method.untrained else study.seeds
        scores = {seed: _own_score(study, twin, method, seed) for seed in seeds}
        best[method.name, twin.name] = min(scores, key=scores.__getitem__)
    chosen = [row for row in trials if row["seed"] == best[row["method"], row["twin"]]]
    meanings = {method.name: method.meaning for method in study.methods}
    return {"best_in_own_simulation": overall(meanings, chosen)}


def _own_score(study: Study, twin: Twin, method: Method, seed: int) -> float:
    """Return the score of a policy where it was trained, m; less is better."""
    if method.untrained:
        return 0.0
    result = read_result(study.training(twin, method, seed).folder)
    return float(result["selected"]["score_m"])


def predict(study: Study, at_once: int = 1) -> Row:
    """Compare what the methods' simulations foretell, without a training; return the numbers.

    Args:
        study: Which methods on which twins; what it says of trainings is not used.
        at_once: Jobs that run at the same time, each in a process of its own.

    Raises:
        UsageError: A method has no simulation of its own, or the folder holds results of other
            options.
    """
    for method in study.methods:
        if method.ranges != "none" or method.untrained:
            reason = "has no simulation" if method.untrained else "trains on many simulations"
            raise UsageError(
                f"The method '{method.name}' {reason}, so that none foretells; name"
                f" others, e.g. {', '.join(FORETOLD)}."
            )
    work_through((study.records(), study.fits(), [*foretold(study), *met(study)]), at_once)
    return {
        **about(study.twins, study.seconds, study.repeats),
        "methods": prediction_rows(foretold(study), met(study)),
        "identification": [fit.row() for fit in study.fits()],
        "notes": twins_note(len(study.twins)),
    }


def foretold(study: Study) -> list[Foretell]:
    """Return what each method's simulation says of the shipped controllers' hops."""
    return [
        Foretell(
            **_trial(study, twin, hopper, f"-{method.name}"),
            believer=method,
            source=study.source(twin, method),
        )
        for hopper in HOPPERS
        for method in study.methods
        for twin in study.twins
    ]


def met(study: Study) -> list[Meet]:
    """Return the same controllers' hops on the twins."""
    return [Meet(**_trial(study, twin, hopper)) for hopper in HOPPERS for twin in study.twins]


def _trial(study: Study, twin: Twin, hopper: str, more: str = "") -> dict[str, Any]:
    return {
        "file": study.folder / "predictions" / f"{twin.name}-{hopper}{more}.json",
        "twin": twin,
        "method": hopper,
        "commands": study.commands,
        "repeats": study.repeats,
    }


@dataclass(frozen=True)
class Experiment:
    """What is compared on which twins, and where it is kept."""

    twins: tuple[str, ...] = (str(LEAST_TWINS),)
    """How many twins to draw, or robot files that extend what is believed of them; intervals over
    twins need 20."""
    methods: tuple[str, ...] | None = None
    """What policies are trained on, the others being compared with the first; or what foretells.
    Valid: identified, cad, table-1, rail-only, fixed-base-only, two-pass, one-pass, truth; not to
    foretell, as each leg in training differs, identified-posterior, randomised,
    identified-surprises, cad-surprises; and, not trained, energy-shaping, energy-shaping-tuned,
    universal, universal-identified.
    Default: identified, cad, table-1, randomised and energy-shaping; or all that can foretell."""
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
    folder: Path = Path("runs/transfer")
    """Folder for recordings, robots, trainings and trials; what is there is not done again."""
    json: Path | None = None
    """Write every number to this file."""

    def study(self, methods: tuple[str, ...]) -> Study:
        """Return the study of some methods; drawn twins are written."""
        at_least(1, jobs=self.jobs)
        return Study(
            self.folder,
            find_twins(self.twins, self.folder / "twins"),
            choose_methods(methods),
            seeds=self.seeds,
            recipe=self.recipe,
            changes=self.set,
            steps=self.steps,
            seconds=self.seconds,
            generations=self.generations,
            commands=self.commands,
            repeats=self.repeats,
            effects=self.effects,
        )


@dataclass(frozen=True)
class Transfer(Experiment):
    """Train on what is known of each twin, and hop on it."""

    def measure(self) -> dict[str, Any]:
        """Run the experiment, print the tables, return every number."""
        asked = DEFAULT if self.methods is None else self.methods
        asked = asked if not asked or ENERGY_SHAPING in asked else (*asked, ENERGY_SHAPING)
        result = transfer(self.study(asked), self.jobs)
        show_transfer(result)
        if best := result.get("best_in_own_simulation"):
            say("\nOf several trainings, those alone that hop best in their own simulation:")
            show_overall(best)
        return result


@dataclass(frozen=True)
class Prediction(Experiment):
    """Let each method's simulation foretell a shipped policy's hops on the twins."""

    def measure(self) -> dict[str, Any]:
        """Run the experiment, print the numbers and return them."""
        result = predict(self.study(self.methods or FORETOLD), self.jobs)
        show_predictions(result)
        return result


def show_transfer(result: dict[str, Any]) -> None:
    """Print the tables of sim-to-real trials."""
    rows = []
    for row in result["rows"]:
        low, high = (millimetres(row[f"median_abs_error_{end}_m"]) for end in ("low", "high"))
        error, skipped = millimetres(row["median_abs_error_m"]), row["skipped_hops"]
        hops = f"{skipped}/{row['hops'] + skipped}"
        command, signed = millimetres(row["command_m"]), millimetres(row["median_error_m"])
        rows.append((row["method"], command, error, f"{low}-{high}", signed, hops))
    show_table(("trained on", "command, mm", "|error|, mm", "95 %", "error, mm", "skipped"), rows)
    show_overall(result)
    say(*(f"Note: {note}" for note in result["notes"]))


def show_overall(result: dict[str, Any]) -> None:
    """Print the methods' errors over all commands."""
    for row in result["methods"]:
        say(
            f"{row['method']}: {millimetres(row['median_abs_error_m'])} mm over all commands,"
            f" {row['ordered']} of {row['policies']} policies in order"
        )
    for row in result["comparison"]:
        say(
            f"{row['method']} errs {row['ratio']:.1f} times as much as {row['over']}"
            f" ({row['ratio_low']:.1f} to {row['ratio_high']:.1f})"
        )


def show_predictions(result: dict[str, Any]) -> None:
    """Print how far off each method's predictions are."""
    for row in result["methods"]:
        error, low, high = (
            millimetres(row[f"median_abs_error{end}_m"]) for end in ("", "_low", "_high")
        )
        say(
            f"{row['method']} foretells apexes of {row['controller']} to {error} mm"
            f" ({low} to {high})"
        )
    say(*(f"Note: {note}" for note in result["notes"]))


Options = Transfer | Prediction | ZeroShot
