"""Stages of a sim-to-real study: record the twin, identify it, train on that, hop on it.

A twin brings latency, noise and losses of its own; the paper's disturbance stays off there, as it
would come on top. A twin without [reality] is met with the paper's disturbance.
"""

import json
from abc import abstractmethod
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from hopping_leg import io, trace
from hopping_leg.arrays import Array
from hopping_leg.controllers import Controller, RolloutConfig
from hopping_leg.controllers.command_schedule import command_range
from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.registry import load_controller
from hopping_leg.errors import UsageError
from hopping_leg.evaluate import entries, runner
from hopping_leg.evaluate.motor_load import MotorLoad
from hopping_leg.identify import cost, excitation, optimizers, parameters, plan, play_excitation
from hopping_leg.identify.paper_excitation import Strokes, adapt, fixed_base, moving_base
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.recording import load_recording
from hopping_leg.identify.recording_format import Rig
from hopping_leg.identify.result import Identified, as_json, save_robot
from hopping_leg.identify.search import SearchOptions
from hopping_leg.robot import Robot, load_robot
from hopping_leg.sim import NO_NOISE, Measurement, NoiseAndDelay
from hopping_leg.sim_to_real import jobs, methods
from hopping_leg.sim_to_real.study import USUAL_FIT, Study, TwinFile

if TYPE_CHECKING:
    from hopping_leg.rl.recipe import Recipe
    from hopping_leg.rl.run_folder import RunFolder


_BOTH_SWINGS = 120.0
"""Recordings of so many seconds have room for both swing periods of the paper."""


class StoredJob(jobs.Job):
    """A job whose result is a file, stored with the options that it depends on."""

    @property
    @abstractmethod
    def file(self) -> Path:
        """File of the result."""

    @property
    @abstractmethod
    def asked(self) -> dict[str, Any]:
        """Options that the result depends on, as JSON values."""

    @property
    def stored(self) -> dict[str, Any]:
        """Options that the stored result was made with; others may stand beside them."""
        text = self.file.with_suffix(".json").read_text(encoding="utf-8")
        asked: dict[str, Any] = json.loads(text)["asked"]
        return asked

    @property
    def done(self) -> bool:
        """Whether the result is stored.

        Raises:
            UsageError: It is stored, but of other options.
        """
        if not self.file.exists():
            return False
        stored, asked = self.stored, self.asked
        other = [name for name in {**asked, **stored} if asked.get(name) != stored.get(name)]
        if other:
            raise UsageError(
                f"{self.file} was made with other options ({', '.join(other)}); give another"
                " --folder, or delete it to make it again."
            )
        return True


@dataclass(frozen=True)
class RecordTwin(StoredJob):
    """A twin recorded on a rig."""

    study: Study
    twin: TwinFile
    rig: Rig

    weight: ClassVar[float] = 5.0

    @property
    def name(self) -> str:
        """What is done."""
        return f"record {self.twin.name}, {self.rig}"

    @property
    def file(self) -> Path:
        """The recording."""
        return self.study.recording(self.twin, self.rig)

    @property
    def asked(self) -> dict[str, Any]:
        """Twin and duration, s."""
        return {"robot_digest": self.twin.robot.digest, "seconds": self._template().duration}

    @property
    def stored(self) -> dict[str, Any]:
        """The same entries of the recording's header."""
        header = trace.Trace.load(self.file).header
        return {name: header[name] for name in ("robot_digest", "seconds")}

    def run(self, *, quiet: bool) -> None:
        """Play the paper's trajectory and write the recording."""
        believed = load_robot(self.twin.believed)
        template = adapt(self._template(), believed)
        recording = play_excitation.play(
            excitation.make_excitation(template, believed),
            self.twin.robot,
            believed=self.twin.believed,
            seed=0 if self.rig == "fixed-base" else 1,
        )
        recording.trace.header["seconds"] = template.duration
        recording.save(self.file)

    def _template(self) -> Strokes:
        seconds = self.study.seconds
        if self.rig != "fixed-base":
            return moving_base(duration=seconds)
        swings = (10.0, 20.0) if seconds >= _BOTH_SWINGS else (10.0,)
        return fixed_base(swings=swings, duration=seconds)


_INERTIA_FACTOR = 10.0
"""How far off the CAD's link inertias may be: the paper's Table I has nine times the shank's."""


@dataclass(frozen=True)
class IdentifyTwin(StoredJob):
    """A twin identified by a method."""

    study: Study
    twin: TwinFile
    method: methods.Method

    on_all_cores: ClassVar[bool] = True

    @property
    def weight(self) -> float:
        """Rough time, s."""
        usual = self.study.least_squares == USUAL_FIT
        return 5.0 + self.study.seconds if usual else 10.0

    @property
    def name(self) -> str:
        """What is done."""
        return f"identify {self.twin.name}, {self.fit.name}"

    @property
    def fit(self) -> methods.Fit:
        """How the method identifies."""
        assert self.method.fit is not None
        return self.method.fit

    @property
    def file(self) -> Path:
        """The robot file; beside it, as .json, stands the fit."""
        return self.study.fitted(self.twin, self.method)

    @property
    def asked(self) -> dict[str, Any]:
        """Recordings and search."""
        search, effort = self.fit.search, self.study.least_squares
        return {
            "recordings": [load_recording(path).digest for path in self._recordings],
            "search": search,
            "generations": None if search == "least-squares" else self.study.generations,
            **({} if effort == USUAL_FIT else {"least_squares": asdict(effort)}),
        }

    def run(self, *, quiet: bool) -> None:
        """Identify and write the robot file; a fit that was killed goes on."""
        study, search = self.study, self.fit.search
        believed = load_robot(self.twin.believed)
        effort = SearchOptions(
            cma=optimizers.CmaOptions(generations=study.generations),
            least_squares=study.least_squares,
        )
        recordings = [load_recording(path) for path in self._recordings]
        options = IdentifyOptions(search=search, bounds=_bounds(believed), effort=effort)
        if search == "one-pass":
            names = plan.make_plan(recordings, believed, search="two-pass").parameters.names
            options = replace(
                options, search="cma", parameters=tuple(names), scoring=cost.Scoring()
            )
        folder = self.file.with_suffix("")
        identified = identify(recordings, believed, options=options, folder=folder, resume=True)
        content = {"asked": self.asked, **as_json(identified), "truth": self._truth(identified)}
        io.write_json(self.file.with_suffix(".json"), content)
        save_robot(identified, self.file, self.twin.believed)

    @property
    def _recordings(self) -> list[Path]:
        return [self.study.recording(self.twin, rig) for rig in self.fit.rigs]

    def _truth(self, identified: Identified) -> dict[str, float]:
        """Return the twin's own values of what was fitted, where it has them."""
        truth = parameters.LegHypothesis(self.twin.without_surprises)
        names = identified.passes[-1].parameters.names
        values = {name: truth.get(name) for name in names if not name.startswith("drive.")}
        if "drive.delay" in names:
            values["drive.delay"] = self.twin.robot.reality.latency.command
        return values


def _bounds(believed: Robot) -> dict[str, tuple[float, float]]:
    links = {"thigh.inertia": believed.thigh.inertia, "shank.inertia": believed.shank.inertia}
    return {name: (v / _INERTIA_FACTOR, v * _INERTIA_FACTOR) for name, v in links.items()}


@dataclass(frozen=True)
class TrainPolicy(jobs.Job):
    """Training of a policy in the simulation of a method."""

    study: Study
    twin: TwinFile
    method: methods.Method
    seed: int

    @property
    def weight(self) -> float:
        """Rough time, s."""
        return 10.0 + self.study.steps / 17_000

    @property
    def name(self) -> str:
        """What is done."""
        return f"train {self.path.name}"

    @property
    def done(self) -> bool:
        """Whether the policy is there.

        Raises:
            UsageError: The folder holds another training.
        """
        folder = self._folder()
        if not (folder.path / "config.json").exists():
            return False
        folder.check_same()
        return folder.policy.exists()

    def run(self, *, quiet: bool) -> None:
        """Train; a training that was killed goes on."""
        from hopping_leg.rl.train import train

        train(
            self.recipe(),
            self.robot,
            self.seed,
            self.path,
            resume=True,
            threads=self.study.threads,
            quiet=quiet,
        )

    def progress(self) -> tuple[float, str]:
        """Return the share done and what to show while it runs."""
        snapshots = sorted((self.path / "snapshots").glob("*.onnx"))
        steps = int(snapshots[-1].stem) if snapshots else 0
        share = min(steps / self.study.steps, 1.0)
        return share, f"{steps / 1e6:.1f}M steps" if steps else "begun"

    def recipe(self) -> "Recipe":
        """Return how it is trained.

        Raises:
            UsageError: There is no such recipe, or it has no such number.
        """
        from hopping_leg.rl.recipes import change, get_recipe, randomise

        study = self.study
        recipe = change(get_recipe(study.recipe), [*study.changes, f"steps={study.steps}"])
        return randomise(recipe, self.method.ranges)

    @property
    def robot(self) -> Robot:
        """Robot that is trained on."""
        return self.study.simulated(self.twin, self.method)

    @property
    def path(self) -> Path:
        """Folder of the training."""
        return self.study.training(self.twin, self.method, self.seed)

    @property
    def result(self) -> dict[str, Any]:
        """What the finished training left: how long it took, how the policy hops where it learnt.

        Raises:
            UsageError: It is not finished.
        """
        from hopping_leg.rl.run_folder import read_result

        return read_result(self.path)

    @property
    def own_score(self) -> float:
        """Score of the policy in the simulation that it was trained in, m; less is better."""
        return float(self.result["selected"]["score_m"])

    def _folder(self) -> "RunFolder":
        from hopping_leg.rl.run_folder import RunFolder

        robot = self.robot
        return RunFolder(self.path, self.recipe().fit(robot), robot, self.seed, None)


FIRST_SEED = 1000
"""First seed of the trials; no seed from here on has chosen anything."""

_KEPT = ("command_m", "median_error_m", "median_abs_error_m", "std_m", "hops", "skipped_hops",
         "missed_runs", "hop_rate_hz", "flight_fraction", "body_contacts",
         *MotorLoad.__dataclass_fields__)  # fmt: skip


@dataclass(frozen=True)
class HopTrial(StoredJob):
    """A controller that hops at the study's commands on some leg."""

    study: Study
    twin: TwinFile

    weight: ClassVar[float] = 8.0

    @property
    def leg(self) -> Robot:
        """Leg that the policy hops on: the twin."""
        return self.twin.robot

    @property
    @abstractmethod
    def controller(self) -> Controller:
        """What hops."""

    @property
    def asked(self) -> dict[str, Any]:
        """Controller, leg and trials."""
        return {
            "policy": entries.fingerprint(self.controller),
            "twin": self.leg.digest,
            "commands": list(self.study.commands),
            "repeats": self.study.repeats,
        }

    def run(self, *, quiet: bool) -> None:
        """Try the controller at every command and write what was measured."""
        rows = hop(self.controller, self.leg, self.study)
        io.write_json(self.file, {"asked": self.asked, "rows": rows})

    def measured(self) -> list[dict[str, Any]]:
        """Return what was measured, one row per command."""
        rows: list[dict[str, Any]] = json.loads(self.file.read_text(encoding="utf-8"))["rows"]
        return rows


@dataclass(frozen=True)
class HopOnTwin(HopTrial):
    """A trained policy, or a controller that needs no training, tried on a twin."""

    method: methods.Method
    seed: int

    @property
    def name(self) -> str:
        """What is done."""
        return f"hop on {self.twin.name}, {self.method.name}, seed {self.seed}"

    @property
    def file(self) -> Path:
        """File of the result."""
        return self.study.trial(self.twin, self.method, self.seed)

    @property
    def controller(self) -> Controller:
        """The selected policy of the training, or the method's controller of the believed leg."""
        if self.method.controller is not None:
            return load_controller(self.method.controller, load_robot(self.twin.believed))
        folder = self.study.training(self.twin, self.method, self.seed)
        content = (folder / "policy.onnx").read_bytes()
        return Policy(content, "the trained policy", "policy")

    def rows(self) -> list[dict[str, Any]]:
        """Return what was measured, one row per command."""
        where = {"method": self.method.name, "twin": self.twin.name, "seed": self.seed}
        return [{**where, **row} for row in self.measured()]


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


def hop(controller: Controller, robot: Robot, study: Study) -> list[dict[str, Any]]:
    """Let a controller hop at a study's commands on a robot and return a row per command.

    Errors are apex minus command. A leg that never leaves the ground at a command counts as
    ``motionless``; its error is standing height minus command. A policy whose training reached less
    high is asked for the highest command that it knows.
    """
    setup = RolloutConfig(robot, disturbance_of(robot), threads=study.threads)
    judged = runner.evaluate(
        [entries.entry_of("policy", WithinRange(controller, robot))], setup,
        commands=study.commands,
        repeats=study.repeats, seed=FIRST_SEED, kinds=("fixed",),
    )  # fmt: skip
    summary = judged.evaluation.to_json()["summary"]
    return [{**{n: row[n] for n in _KEPT}, "motionless": not row["hops"]} for row in summary]
