"""Record a twin, identify it, train on that, hop on it: the paper's claim, tried once.

A twin plays the real leg. It brings latency, noise and losses of its own; the paper's disturbance
stays off there, as it would come on top. A twin without [reality] is met with the paper's
disturbance.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from hopping_leg import io, trace
from hopping_leg.arrays import Array
from hopping_leg.controllers import Controller, RolloutConfig
from hopping_leg.controllers.command_schedule import command_range
from hopping_leg.controllers.registry import ENERGY_SHAPING, load_controller
from hopping_leg.errors import UsageError
from hopping_leg.evaluate import entries, runner
from hopping_leg.evaluate.motor_load import MotorLoad
from hopping_leg.identify import excitation, play_excitation
from hopping_leg.identify.optimizers import LeastSquaresOptions
from hopping_leg.identify.paper_excitation import Strokes, adapt, fixed_base, moving_base
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.recording import Recording, load_recording
from hopping_leg.identify.recording_format import Rig
from hopping_leg.identify.result import Identified, as_json, save_robot
from hopping_leg.identify.search import SearchOptions
from hopping_leg.locks import hold_folder
from hopping_leg.robot import NO_MISMATCH, Latency, Robot, load_robot, parent_robot, shipped_robots
from hopping_leg.sim import NO_NOISE, Measurement, NoiseAndDelay
from hopping_leg.sim.randomization import RANDOMIZABLE, Range, draw_twin
from hopping_leg.sim_to_real.jobs import Job, StoredJob, work_through
from hopping_leg.sim_to_real.tables import tabulate

if TYPE_CHECKING:
    from hopping_leg.rl.recipe import Recipe
    from hopping_leg.rl.run_folder import RunFolder

RIGS: tuple[Rig, ...] = ("fixed-base", "rail")

SHORTEST = 30.0
"""Shortest recording, s: one swing of the leg per amplitude."""

_BOTH_SWINGS = 120.0
"""Recordings of so many seconds have room for both swing periods of the paper."""

COMMANDS = (0.25, 0.27, 0.29, 0.31, 0.33, 0.35)
"""Apex heights at which a twin is tried, m."""

FIRST_SEED = 1000
"""First seed of the trials; no seed from here on has chosen anything."""

USUAL_FIT = LeastSquaresOptions(tolerance=1e-3)
"""A round that lowers the cost by a smaller share ends the search."""

_INERTIA_FACTOR = 10.0
"""How far off the CAD's link inertias may be: the paper's Table I has nine times the shank's."""

MEANINGS = {
    "identified": "identified from both recordings",
    "cad": "CAD defaults",
    ENERGY_SHAPING: "energy shaping, shipped gains",
}
"""What a controller is trained on before it meets the twin, by the method's name."""


@dataclass(frozen=True)
class Twin:
    """A leg that plays the real one.

    Attributes:
        name: In results and file names.
        source: Shipped name or path of its robot file.
        believed: Robot that it extends: all that is known of it without a recording.
    """

    name: str
    source: str
    believed: str

    @property
    def robot(self) -> Robot:
        """The twin itself."""
        return load_robot(self.source)


def drawn_twin(seed: int, folder: Path) -> Twin:
    """Return a twin that is drawn at random; its robot file is written to a folder."""
    twin = draw_twin(seed)
    path = folder / f"{twin.robot.name}.toml"
    if not path.exists() or load_robot(path) != twin.robot:
        twin.save(path)
    return Twin(twin.robot.name, str(path), str(twin.tree["extends"]))


def given_twin(word: str) -> Twin:
    """Return a shipped robot, or one of a file, as a twin.

    Raises:
        UsageError: It extends no robot.
        RobotError: There is no such robot.
    """
    robot = load_robot(word)
    robot.require_leg()
    parent = parent_robot(word)
    if parent is None:
        raise UsageError(
            f"{word} extends no robot, so that nothing says what is believed of it before it is"
            " identified; let its file extend one, e.g. legv2."
        )
    return Twin(robot.name, word if word in shipped_robots() else str(Path(word)), parent)


def simulated(source: str) -> Robot:
    """Return a robot as training simulates it: of [reality] it has the loop's delay alone."""
    robot = load_robot(source)
    latency = Latency(command=robot.reality.latency.command)
    return replace(robot, reality=replace(NO_MISMATCH, latency=latency))


@dataclass(frozen=True)
class RecordTwin(StoredJob):
    """A twin recorded on a rig for ``seconds``."""

    file: Path
    twin: Twin
    rig: Rig
    seconds: float = SHORTEST

    weight: ClassVar[float] = 5.0

    @property
    def name(self) -> str:
        """What is done."""
        return f"record {self.twin.name}, {self.rig}"

    @property
    def asked(self) -> dict[str, Any]:
        """Twin and duration, s."""
        return {"robot_digest": self.twin.robot.digest, "seconds": self._template().duration}

    @property
    def stored(self) -> dict[str, Any]:
        """The recording's header."""
        return trace.Trace.load(self.file).header

    def run(self, *, quiet: bool) -> None:
        """Play the paper's trajectory and write the recording."""
        believed = load_robot(self.twin.believed)
        template = adapt(self._template(), believed)
        recording = play_excitation.play(
            excitation.make_excitation(template, believed),
            self.twin.robot,
            believed=self.twin.believed,
            seed=RIGS.index(self.rig),
        )
        recording.trace.header["seconds"] = template.duration
        recording.save(self.file)

    def _template(self) -> Strokes:
        if self.rig != "fixed-base":
            return moving_base(duration=self.seconds)
        swings = (10.0, 20.0) if self.seconds >= _BOTH_SWINGS else (10.0,)
        return fixed_base(swings=swings, duration=self.seconds)


@dataclass(frozen=True)
class IdentifyTwin(StoredJob):
    """A twin identified from recordings; beside the robot file, as .json, stands the fit.

    Attributes:
        file: Robot file.
        method: Its name in results.
        effort: How far least squares on positions and torques search.
    """

    file: Path
    twin: Twin
    recordings: tuple[Path, ...]
    method: str = "identified"
    effort: LeastSquaresOptions = USUAL_FIT

    weight: ClassVar[float] = 35.0
    on_all_cores: ClassVar[bool] = True

    @property
    def name(self) -> str:
        """What is done."""
        return f"identify {self.twin.name}, {self.method}"

    @property
    def asked(self) -> dict[str, Any]:
        """Recordings and search."""
        effort = None if self.effort == USUAL_FIT else asdict(self.effort)
        digests = [recording.digest for recording in self._load()]
        return {"recordings": digests, "least_squares": effort}

    def options(self, recordings: list[Recording], believed: Robot) -> IdentifyOptions:
        """Return how the twin is identified."""
        links = {"thigh.inertia": believed.thigh.inertia, "shank.inertia": believed.shank.inertia}
        bounds = {name: (v / _INERTIA_FACTOR, v * _INERTIA_FACTOR) for name, v in links.items()}
        return IdentifyOptions(bounds=bounds, effort=SearchOptions(least_squares=self.effort))

    def run(self, *, quiet: bool) -> None:
        """Identify and write the robot file; a fit that was killed goes on."""
        believed, recordings = load_robot(self.twin.believed), self._load()
        options, folder = self.options(recordings, believed), self.file.with_suffix("")
        identified = identify(recordings, believed, options=options, folder=folder, resume=True)
        content = {"asked": self.asked, **as_json(identified), "truth": self._truth(identified)}
        io.write_json(self.file.with_suffix(".json"), content)
        save_robot(identified, self.file, self.twin.believed)

    def row(self) -> dict[str, Any]:
        """Return how well the fit went: errors on data it has not seen, and its parameters."""
        found = json.loads(self.file.with_suffix(".json").read_text(encoding="utf-8"))
        before, after, truth = found["start_validation"], found["validation"], found["truth"]
        kept = ("name", "unit", "start", "value", "interval_low", "interval_high", "at_bound")
        errors = ("closed_loop_position_rms_rad", "closed_loop_torque_rms_nm")
        return {
            "method": self.method,
            "twin": self.twin.name,
            **{f"{name}_before": before[name] for name in errors},
            **{name: after[name] for name in errors},
            "parameters": [
                {**{key: row[key] for key in kept}, "truth": truth.get(row["name"])}
                for row in found["parameters"]
            ],
        }

    def _load(self) -> list[Recording]:
        return [load_recording(path) for path in self.recordings]

    def _truth(self, identified: Identified) -> dict[str, float]:
        """Return the twin's own values of what was fitted, where it has them."""
        robot = simulated(self.twin.source)
        truth, names = LegHypothesis(robot), identified.passes[-1].parameters.names
        values = {name: truth.get(name) for name in names if not name.startswith("drive.")}
        if "drive.delay" in names:
            values["drive.delay"] = robot.reality.latency.command
        return values


@dataclass(frozen=True)
class TrainPolicy(Job):
    """Training of a policy in the simulation of the robot ``source``; it has a folder.

    Attributes:
        folder: Of the training.
        source: Name or file of the robot.
        recipe: By which it is trained.
        seed: Of the training.
        intervals: Whether every leg draws each fitted number from its interval; they stand in the
            .json beside the robot's file.
    """

    folder: Path
    source: str
    recipe: "Recipe"
    seed: int = 0
    intervals: bool = False

    @property
    def weight(self) -> float:
        """Rough time, s."""
        return 10.0 + self.recipe.schedule.steps / 17_000

    @property
    def name(self) -> str:
        """What is done."""
        return f"train {self.folder.name}"

    @property
    def done(self) -> bool:
        """Whether the policy is there.

        Raises:
            UsageError: The folder holds another training.
        """
        if not (self.folder / "config.json").exists():
            return False
        run = self._run_folder()
        run.check_same()
        return run.policy.exists()

    def run(self, *, quiet: bool) -> None:
        """Train; a training that was killed goes on."""
        from hopping_leg.rl.train import train

        robot = simulated(self.source)
        train(self.trained, robot, self.seed, self.folder, resume=True, threads=1, quiet=quiet)

    def progress(self) -> tuple[float, str]:
        """Return the share done and what to show while it runs."""
        snapshots = sorted((self.folder / "snapshots").glob("*.onnx"))
        steps = int(snapshots[-1].stem) if snapshots else 0
        share = min(steps / self.recipe.schedule.steps, 1.0)
        return share, f"{steps / 1e6:.1f}M steps" if steps else "begun"

    def row(self) -> dict[str, Any]:
        """Return how the policy hops in the simulation that it was trained in.

        Raises:
            UsageError: The training is not finished.
        """
        from hopping_leg.rl.run_folder import read_result

        result = read_result(self.folder)
        errors = [trial["median_error_m"] for trial in result["selected"]["trials"]]
        worst = None if None in errors else max(map(abs, errors))
        return {
            "training": self.folder.name,
            "minutes": result["minutes"],
            "steps": result["steps"],
            "own_simulation_worst_abs_median_error_m": worst,
            "own_simulation_score_m": float(result["selected"]["score_m"]),
        }

    def _run_folder(self) -> "RunFolder":
        from hopping_leg.rl.run_folder import RunFolder

        robot = simulated(self.source)
        return RunFolder(self.folder, self.trained.fit(robot), robot, self.seed, None)

    @property
    def trained(self) -> "Recipe":
        """The recipe with the ranges of the fit's numbers, once there is a fit."""
        if not self.intervals:
            return self.recipe
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


_KEPT = ("command_m", "median_error_m", "median_abs_error_m", "std_m", "hops", "skipped_hops",
         "missed_runs", "hop_rate_hz", "flight_fraction", "body_contacts",
         *MotorLoad.__dataclass_fields__)  # fmt: skip


@dataclass(frozen=True)
class HopTrial(StoredJob):
    """A controller tried on a twin, ``repeats`` runs of 15 s at each command.

    Attributes:
        file: Where what was measured is kept.
        method: Name of what it was trained on.
        seed: Seed of its training.
        policy: Trained policy or gain file; None takes an untrained controller.
        untrained: Name of that; the default is energy shaping, tuned on the believed leg.
        told: Name or file of the robot that the controller is told; empty for the believed one.
    """

    file: Path
    twin: Twin
    method: str
    seed: int = 0
    policy: Path | None = None
    commands: tuple[float, ...] = COMMANDS
    repeats: int = 3
    untrained: str = ENERGY_SHAPING
    told: str = ""

    weight: ClassVar[float] = 8.0

    @property
    def name(self) -> str:
        """What is done."""
        return f"hop on {self.twin.name}, {self.method}, seed {self.seed}"

    @property
    def leg(self) -> Robot:
        """Leg that hops."""
        return self.twin.robot

    @property
    def controller(self) -> Controller:
        """What hops."""
        robot = load_robot(self.told or self.twin.believed)
        return load_controller(self.policy or self.untrained, robot, other="accept")

    @property
    def asked(self) -> dict[str, Any]:
        """Controller, leg and trials."""
        return {
            "policy": entries.fingerprint(self.controller),
            "twin": self.leg.digest,
            "commands": list(self.commands),
            "repeats": self.repeats,
        }

    def run(self, *, quiet: bool) -> None:
        """Try the controller at every command and write what was measured."""
        rows = hop(self.controller, self.leg, self.commands, self.repeats)
        io.write_json(self.file, {"asked": self.asked, "rows": rows})

    def rows(self) -> list[dict[str, Any]]:
        """Return what was measured, one row per command."""
        where = {"method": self.method, "twin": self.twin.name, "seed": self.seed}
        found = json.loads(self.file.read_text(encoding="utf-8"))["rows"]
        return [{**where, **row} for row in found]


def disturbance_of(robot: Robot) -> NoiseAndDelay:
    """Return what a leg is tried with on top of what it brings: nothing, if it brings anything."""
    return NoiseAndDelay() if robot.reality.neutral else NO_NOISE


class WithinRange:
    """A controller that is asked for the nearest command that it knows; a Controller."""

    def __init__(self, controller: Controller, robot: Robot) -> None:
        self.name, self._controller = controller.name, controller
        self._range = command_range(controller, robot)

    def reset(self, count: int) -> None:
        """Forget everything."""
        self._controller.reset(count)

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2)."""
        command = measurement.command.clip(*self._range)
        return self._controller.act(replace(measurement, command=command))

    def internals(self) -> dict[str, Array]:
        """Return what the controller shows."""
        return self._controller.internals()


def hop(
    controller: Controller, robot: Robot, commands: tuple[float, ...], repeats: int
) -> list[dict[str, Any]]:
    """Let a controller hop on a robot and return a row per command.

    Errors are apex minus command. A leg that never leaves the ground at a command counts as
    ``motionless``; its error is standing height minus command. A policy whose training reached less
    high is asked for the highest command that it knows.
    """
    judged = runner.evaluate(
        [entries.entry_of("policy", WithinRange(controller, robot))],
        RolloutConfig(robot, disturbance_of(robot), threads=1),
        commands=commands,
        repeats=repeats,
        seed=FIRST_SEED,
        kinds=("fixed",),
    )
    summary = judged.evaluation.to_json()["summary"]
    return [{**{n: row[n] for n in _KEPT}, "motionless": not row["hops"]} for row in summary]


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


@dataclass(frozen=True)
class Transfer:
    """One pass from a leg that is not known to hops on it, beside a training on the CAD's robot.

    Attributes:
        folder: Keeps recordings, robots, trainings and trials; what is there is not done again.
        seed: Seed of the trainings.
        effort: How far the fit searches.
        repeats: Runs at each command.
    """

    folder: Path
    twin: Twin
    recipe: "Recipe"
    seed: int = 0
    effort: LeastSquaresOptions = USUAL_FIT
    repeats: int = 3

    @property
    def identified(self) -> Path:
        """File of the identified robot."""
        return self.folder / "robots" / f"{self.twin.name}-identified.toml"

    @property
    def policy(self) -> Path:
        """Policy that was trained on it."""
        return self.trainings[0].folder / "policy.onnx"

    @property
    def records(self) -> list[RecordTwin]:
        """A recording on each rig."""
        folder, twin = self.folder / "recordings", self.twin
        return [RecordTwin(folder / f"{twin.name}-{rig}.parquet", twin, rig) for rig in RIGS]

    @property
    def fit(self) -> IdentifyTwin:
        """The fit to both."""
        files = tuple(record.file for record in self.records)
        return IdentifyTwin(self.identified, self.twin, files, effort=self.effort)

    @property
    def trainings(self) -> list[TrainPolicy]:
        """Trainings on the identified robot and on the believed one."""
        believed = self.twin.believed
        folder, seed = self.folder / "training", self.seed
        return [
            TrainPolicy(folder / f"{name}-seed{seed}", source, self.recipe, seed)
            for name, source in (
                (f"{self.twin.name}-identified", str(self.identified)),
                (Path(believed).stem, believed),
            )
        ]

    @property
    def hops(self) -> list[HopTrial]:
        """Trials of both policies, and of a controller that needs no training."""
        policies = [*(training.folder / "policy.onnx" for training in self.trainings), None]
        return [
            HopTrial(
                self.folder / "trials" / f"{self.twin.name}-{method}-seed{self.seed}.json",
                self.twin,
                method,
                self.seed,
                policy,
                repeats=self.repeats,
            )
            for method, policy in zip(MEANINGS, policies, strict=True)
        ]

    def run(self, at_once: int = 1, afterwards: float = 0.0) -> dict[str, Any]:
        """Do what is left of it and return its numbers.

        What the caller does ``afterwards``, s of a core, counts in the time left.

        Raises:
            UsageError: The folder holds results of other options, or another process works in it.
        """
        jobs = (self.records, [self.fit], self.trainings, self.hops)
        with hold_folder(self.folder, UsageError):
            work_through(jobs, at_once, afterwards)
        return {
            **about((self.twin,), SHORTEST, self.repeats),
            "training_seeds": [self.seed],
            "recipe": self.recipe.name,
            "recipe_changes": [],
            "training_steps": self.recipe.schedule.steps,
            **tabulate(MEANINGS, [trial for hop in self.hops for trial in hop.rows()]),
            "identification": [self.fit.row()],
            "trainings": [training.row() for training in self.trainings],
        }
