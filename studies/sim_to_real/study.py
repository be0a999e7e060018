"""What a study was asked for, its jobs, and where policies are trained before they meet a twin."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

from hopping_leg import io
from hopping_leg.controllers.energy_shaping.gains import load_gains
from hopping_leg.controllers.registry import ENERGY_SHAPING
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.evaluate import runner
from hopping_leg.identify import cost, optimizers, plan
from hopping_leg.identify.pipeline import IdentifyOptions
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.recording_format import Rig
from hopping_leg.rl.recipe import Recipe
from hopping_leg.rl.recipes import Randomise, change, get_recipe, randomise
from hopping_leg.robot import Robot, load_robot
from hopping_leg.sim.randomization import RANDOMIZABLE, Range
from studies.energy_shaping.tune import Tune
from studies.sim_to_real.jobs import StoredJob
from studies.sim_to_real.policies import COMMANDS, FIRST_SEED, HopTrial, TrainPolicy
from studies.sim_to_real.twins import (
    RIGS,
    SHORTEST,
    IdentifyTwin,
    RecordTwin,
    Twin,
    disturbance_of,
    drawn_twin,
    given_twin,
)

Search = Literal["least-squares", "two-pass", "one-pass"]


@dataclass(frozen=True)
class Fit:
    """How the simulation is fitted to recordings of the twin.

    Attributes:
        name: Of its files; methods may share a fit.
        rigs: Whose recordings are used.
        search: ``least-squares`` on positions and torques, the paper's ``two-pass`` CMA-ES on
            positions, or ``one-pass``, the same over all parameters at once.
    """

    name: str = "identified"
    rigs: tuple[Rig, ...] = RIGS
    search: Search = "least-squares"


@dataclass(frozen=True)
class Method:
    """Where a policy is trained.

    Attributes:
        name: On the command line and in the results.
        meaning: A phrase for tables.
        fit: How the twin is identified; None if it is not.
        robot: Robot that is trained on without a fit; None takes the one that the twin extends.
        ranges: What every leg in training draws for itself, around the robot; ``intervals`` of
            the fit, or those of ``hop train``.
        truth: Whether the twin's own file is the robot, [reality] left out but for the delay:
            what a perfect fit would find.
        untrained: Controller that hops as it is; empty where there is a training. It is told the
            robot that the fit gives, or else the one that the twin extends.
        tuned: Whether the gains of an untrained energy shaping are searched anew on that robot.
    """

    name: str
    meaning: str
    fit: Fit | None = None
    robot: str | None = None
    ranges: Randomise | Literal["intervals"] = "none"
    truth: bool = False
    untrained: str = ""
    tuned: bool = False


METHODS = {
    method.name: method
    for method in (
        Method("identified", "identified from both recordings", Fit()),
        Method(
            "identified-posterior",
            "identified, every leg drawn from the intervals of the fit",
            Fit(),
            ranges="intervals",
        ),
        Method("cad", "CAD defaults"),
        Method("table-1", "the paper's Table I", robot="legv2-paper"),
        Method("randomised", "domain randomisation over the twins' ranges", ranges="twins"),
        Method(
            "identified-surprises", "identified, every leg surprising", Fit(), ranges="surprises"
        ),
        Method("cad-surprises", "CAD defaults, every leg surprising", ranges="surprises"),
        Method("rail-only", "identified from the rail alone", Fit("rail-only", rigs=("rail",))),
        Method(
            "fixed-base-only",
            "identified with the base clamped",
            Fit("fixed-base-only", rigs=("fixed-base",)),
        ),
        Method("two-pass", "the paper's two passes of CMA-ES", Fit("two-pass", search="two-pass")),
        Method("one-pass", "the same CMA-ES in one pass", Fit("one-pass", search="one-pass")),
        Method("truth", "true parameters: what a perfect fit would find", truth=True),
        Method(ENERGY_SHAPING, "energy shaping, shipped gains", untrained=ENERGY_SHAPING),
        Method(
            "energy-shaping-tuned",
            "energy shaping, tuned on what both recordings identify",
            Fit(),
            untrained=ENERGY_SHAPING,
            tuned=True,
        ),
        Method("universal", "`universal`, told the CAD's robot", untrained="universal"),
        Method(
            "universal-identified",
            "`universal`, told what both recordings identify",
            Fit(),
            untrained="universal",
        ),
    )
}
"""Every method by name."""

DEFAULT = ("identified", "cad", "table-1", "randomised", ENERGY_SHAPING)
"""What policies are trained on, and what they hop beside, unless asked otherwise."""

FORETOLD = (
    "identified", "cad", "table-1", "rail-only", "fixed-base-only", "two-pass", "one-pass", "truth",
)  # fmt: skip
"""Whose predictions are compared unless asked otherwise, ablations of identification among them."""


def choose_methods(names: Sequence[str]) -> tuple[Method, ...]:
    """Return methods by name.

    Raises:
        UsageError: There is no such method, one is named twice, or none is named.
    """
    for name in names:
        if name not in METHODS:
            raise UsageError(unknown_name("method", name, METHODS))
        if list(names).count(name) > 1:
            raise UsageError(f"The method '{name}' is named twice; name it once.")
    if not names:
        raise UsageError(f"No method is left; name some of: {', '.join(METHODS)}.")
    return tuple(METHODS[name] for name in names)


def about(twins: tuple[Twin, ...], seconds: float, repeats: int) -> dict[str, Any]:
    """Return what results begin with: the twins and how they were met."""
    return {
        "twins": [
            {
                "name": twin.name,
                "robot_digest": twin.robot.digest,
                "believed": twin.believed,
                "paper_disturbance": disturbance_of(twin.robot).delay_probability > 0,
            }
            for twin in twins
        ],
        "recording_seconds": seconds,
        "evaluation_seed": FIRST_SEED,
        "evaluation_seeds": repeats,
        "versions": runner.software_versions(),
    }


def find_twins(words: Sequence[str], folder: Path) -> tuple[Twin, ...]:
    """Return twins that were asked for; drawn ones are written to a folder.

    A single number draws so many twins, with seeds 0, 1, ...; other words are shipped robots or
    robot files.

    Raises:
        UsageError: The number is not positive, or two twins share a name.
        RobotError: There is no such robot.
    """
    if len(words) == 1 and words[0].lstrip("+-").isdigit():
        count = int(words[0])
        if count < 1:
            raise UsageError(f"{count} twins are too few; give 1 or more.")
        return tuple(drawn_twin(seed, folder) for seed in range(count))
    found = tuple(given_twin(word) for word in words)
    names = [twin.name for twin in found]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice or not found:
        reason = f"Two twins are called '{twice[0]}'" if twice else "No twin was named"
        raise UsageError(f"{reason}; give a number, or robot files with different names.")
    return found


@dataclass(frozen=True)
class SearchTwin(IdentifyTwin):
    """A twin identified by one of the searches that are compared."""

    search: Search = "least-squares"
    generations: int = 100

    @property
    def asked(self) -> dict[str, Any]:
        """Recordings and search."""
        generations = None if self.search == "least-squares" else self.generations
        return {**super().asked, "search": self.search, "generations": generations}

    def options(self, recordings: list[Recording], believed: Robot) -> IdentifyOptions:
        """Return how the twin is identified."""
        options = super().options(recordings, believed)
        effort = replace(options.effort, cma=optimizers.CmaOptions(generations=self.generations))
        if self.search != "one-pass":
            return replace(options, search=self.search, effort=effort)
        names = plan.make_plan(recordings, believed, search="two-pass").parameters.names
        return replace(
            options, search="cma", parameters=tuple(names), scoring=cost.Scoring(), effort=effort
        )


@dataclass(frozen=True)
class TrainOnIntervals(TrainPolicy):
    """Training on an identified robot, whose legs draw each fitted number from its interval."""

    @property
    def trained(self) -> Recipe:
        """The recipe with the intervals of the fit, which stands beside the robot's file."""
        content = json.loads(Path(self.source).with_suffix(".json").read_text(encoding="utf-8"))
        return self.recipe.replace({"task.randomised": interval_ranges(content["parameters"])})


def interval_ranges(parameters: Sequence[dict[str, Any]]) -> tuple[Range, ...]:
    """Return the intervals of a fit as ranges, of the numbers that may differ from leg to leg.

    What the data say nothing about spans what the fit searched. Correlations are left out.
    """
    found = []
    for row in parameters:
        low, high = row["interval_low"], row["interval_high"]
        if low is None or high is None:  # not finite
            low, high = row["bound_low"], row["bound_high"]
        if row["name"] in RANDOMIZABLE:
            found.append(Range(row["name"], row["unit"], low, high, "95 % interval of the fit"))
    return tuple(found)


_SEARCH = Tune(start=ENERGY_SHAPING, threads=1)


@dataclass(frozen=True)
class TuneGains(StoredJob):
    """Gains of energy shaping, tuned in the simulation of the robot ``source``."""

    file: Path
    source: str

    @property
    def name(self) -> str:
        """What is done."""
        return f"tune {self.file.stem}"

    @property
    def asked(self) -> dict[str, Any]:
        """Robot, first gains and search."""
        return {
            "robot": load_robot(self.source).digest,
            "start": asdict(load_gains(ENERGY_SHAPING).gains),
            **{n: vars(_SEARCH)[n] for n in ("generations", "population", "seconds")},
        }

    def run(self, *, quiet: bool) -> None:
        """Search; a search that was killed goes on."""
        folder = self.file.with_suffix("")
        found = replace(_SEARCH, robot=self.source, out=folder).find()
        io.write_json(self.file.with_suffix(".json"), {"asked": self.asked, **found})
        (folder / "gains.toml").replace(self.file)


@dataclass(frozen=True)
class Study:
    """Options and folder of a study."""

    folder: Path
    twins: tuple[Twin, ...]
    methods: tuple[Method, ...]
    seeds: tuple[int, ...] = (0,)
    """Seeds of the trainings, one each."""
    recipe: str = "fast"
    """Recipe by which policies are trained."""
    changes: tuple[str, ...] = ()
    """Numbers of the recipe that differ from its defaults, each ``name=number``."""
    steps: int = 1_200_000
    """Control steps of experience of a training."""
    seconds: float = 60.0
    """Duration of each recording, s."""
    generations: int = 100
    """Generations of CMA-ES in each pass, for the methods that use it."""
    commands: tuple[float, ...] = COMMANDS
    """Apex heights at which the twins are tried, m."""
    repeats: int = 3
    """Runs of 15 s at each command."""
    effects: bool = False
    """Whether the first method's policies also meet the twins with one effect less at a time."""

    def __post_init__(self) -> None:
        for name in ("steps", "generations", "repeats"):
            if getattr(self, name) < 1:
                raise UsageError(f"'{name}' is {getattr(self, name)} but must be at least 1.")
        if not SHORTEST <= self.seconds < float("inf"):
            raise UsageError(
                f"Recordings of {self.seconds:g} s are too short; give at least {SHORTEST:g} s."
            )
        if not self.seeds or min(self.seeds) < 0 or len(set(self.seeds)) < len(self.seeds):
            raise UsageError(f"Training seeds {self.seeds} must be 0 or more, each given once.")

    def source(self, twin: Twin, method: Method) -> str:
        """Return the robot that a method simulates for a twin: its name or file."""
        if method.truth:
            return twin.source
        return str(self._fitted(twin, method.fit)) if method.fit else method.robot or twin.believed

    def training(self, twin: Twin, method: Method, seed: int) -> TrainPolicy:
        """Return a training; what does not depend on the twin is trained once."""
        name = f"{twin.name}-{method.name}"
        if not method.fit and not method.truth:
            name = Path(self.source(twin, method)).stem
            name += "" if method.ranges == "none" else f"-{method.ranges}"
        folder = self.folder / "training" / f"{name}-seed{seed}"
        recipe = change(get_recipe(self.recipe), [*self.changes, f"steps={self.steps}"])
        if method.ranges == "intervals":
            return TrainOnIntervals(folder, self.source(twin, method), recipe, seed)
        recipe = randomise(recipe, method.ranges)
        return TrainPolicy(folder, self.source(twin, method), recipe, seed)

    def hop(self, twin: Twin, method: Method, seed: int) -> HopTrial:
        """Return the trial of a method's policy on a twin."""
        policy = None
        if method.tuned:
            policy = self._tuning(twin, method).file
        elif not method.untrained:
            policy = self.training(twin, method, seed).folder / "policy.onnx"
        return HopTrial(
            self.folder / "trials" / f"{twin.name}-{method.name}-seed{seed}.json",
            twin,
            method.name,
            seed,
            policy,
            self.commands,
            self.repeats,
            method.untrained,
            self.source(twin, method) if method.untrained else "",
        )

    def records(self) -> list[RecordTwin]:
        """Return the recordings that the methods need."""
        rigs = {rig for method in self.methods if method.fit for rig in method.fit.rigs}
        return [
            RecordTwin(self._recording(twin, rig), twin, rig, self.seconds)
            for twin in self.twins
            for rig in sorted(rigs)
        ]

    def fits(self) -> list[SearchTwin]:
        """Return all identifications, those of the first method first; several may share one."""
        every = dict.fromkeys(
            (method.fit, twin) for method in self.methods if method.fit for twin in self.twins
        )
        return [
            SearchTwin(
                self._fitted(twin, fit),
                twin,
                tuple(self._recording(twin, rig) for rig in fit.rigs),
                fit.name,
                search=fit.search,
                generations=self.generations,
            )
            for fit, twin in every
        ]

    def trainings(self) -> list[TrainPolicy]:
        """Return all trainings; several twins may share one."""
        every = (self.training(t, m, s) for s, m, t in self._all() if not m.untrained)
        return list({training.folder: training for training in every}.values())

    def tunings(self) -> list[TuneGains]:
        """Return all searches of gains."""
        tuned = (method for method in self.methods if method.tuned)
        return [self._tuning(twin, method) for method in tuned for twin in self.twins]

    def _tuning(self, twin: Twin, method: Method) -> TuneGains:
        file = self.folder / "gains" / f"{twin.name}-{method.name}.toml"
        return TuneGains(file, self.source(twin, method))

    def hops(self) -> list[HopTrial]:
        """Return all trials; what is not trained has one for each twin."""
        first = self.seeds[0]
        return [self.hop(t, m, s) for s, m, t in self._all() if s == first or not m.untrained]

    def _all(self) -> Iterable[tuple[int, Method, Twin]]:
        return ((s, m, t) for s in self.seeds for m in self.methods for t in self.twins)

    def _recording(self, twin: Twin, rig: Rig) -> Path:
        return self.folder / "recordings" / f"{twin.name}-{rig}.parquet"

    def _fitted(self, twin: Twin, fit: Fit) -> Path:
        return self.folder / "robots" / f"{twin.name}-{fit.name}.toml"
