"""Twins, which play the real leg: recorded on a rig, and identified from the recordings.

A twin brings latency, noise and losses of its own; the paper's disturbance stays off there, as it
would come on top. A twin without [reality] is met with the paper's disturbance.
"""

import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from hopping_leg import io, trace
from hopping_leg.errors import UsageError
from hopping_leg.identify import excitation, play_excitation
from hopping_leg.identify.optimizers import LeastSquaresOptions, SearchOptions
from hopping_leg.identify.paper_excitation import Strokes, adapt, fixed_base, moving_base
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.recording import Recording, load_recording
from hopping_leg.identify.recording_format import Rig
from hopping_leg.identify.result import Identified, as_json, save_robot
from hopping_leg.robot import NO_MISMATCH, Latency, Robot, load_robot, parent_robot, shipped_robots
from hopping_leg.sim import NO_NOISE, NoiseAndDelay
from hopping_leg.sim.randomization import draw_twin
from studies.sim_to_real.jobs import StoredJob

RIGS: tuple[Rig, ...] = ("fixed-base", "rail")

SHORTEST = 30.0
"""Shortest recording, s: one swing of the leg per amplitude."""

_BOTH_SWINGS = 120.0
"""Recordings of so many seconds have room for both swing periods of the paper."""

USUAL_FIT = LeastSquaresOptions(tolerance=1e-3)
"""A round that lowers the cost by a smaller share ends the search."""

_INERTIA_FACTOR = 10.0
"""How far off the CAD's link inertias may be: the paper's Table I has nine times the shank's."""


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


def disturbance_of(robot: Robot) -> NoiseAndDelay:
    """Return what a leg is tried with on top of what it brings: nothing, if it brings anything."""
    return NoiseAndDelay() if robot.reality.neutral else NO_NOISE


@dataclass(frozen=True)
class RecordTwin(StoredJob):
    """A twin recorded on a rig for ``seconds``."""

    file: Path
    twin: Twin
    rig: Rig
    seconds: float = SHORTEST

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
        """Identify and write the robot file."""
        believed, recordings = load_robot(self.twin.believed), self._load()
        identified = identify(recordings, believed, options=self.options(recordings, believed))
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
