"""The steps of the chain for one twin: record, identify, train, tune, hop; each gives a record."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from hopping_leg.arrays import Array
from hopping_leg.controllers import Controller, RolloutConfig
from hopping_leg.controllers.command_schedule import command_range
from hopping_leg.controllers.registry import ENERGY_SHAPING_TUNED, load_controller
from hopping_leg.evaluate import Entry, runner
from hopping_leg.identify import excitation, play_excitation
from hopping_leg.identify.optimizers import SearchOptions
from hopping_leg.identify.paper_excitation import Strokes, adapt, fixed_base, moving_base
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.recording import load_recording
from hopping_leg.identify.recording_format import Rig
from hopping_leg.identify.result import as_json, save_robot
from hopping_leg.io import write_atomically
from hopping_leg.rl.recipe import Recipe
from hopping_leg.rl.run_folder import read_result
from hopping_leg.rl.train import train
from hopping_leg.robot import Robot, load_robot
from hopping_leg.sim import Measurement
from studies.energy_shaping.tune import Tune
from studies.shared import Row
from studies.sim_to_real.twins import BELT, Noise, Twin, disturbance_of, with_play

RIGS: tuple[Rig, ...] = ("fixed-base", "rail")

FIRST_SEED = 1000
"""First seed of the trials; no seed from here on has chosen anything."""

_BOTH_SWINGS = 120.0
"""Recordings of so many seconds have room for both swing periods of the paper."""

_USUAL_TOLERANCE = 1e-3
"""A round that lowers the cost by a smaller share ends the search."""

_INERTIA_FACTOR = 10.0
"""How far off the CAD's link inertias may be: the paper's Table I has nine times the shank's."""


def record(twin: Twin, rig: Rig, seconds: float, file: Path) -> Row:
    """Let a twin track the paper's trajectory on a rig and write the recording."""
    believed = load_robot(twin.believed)
    recording = play_excitation.play(
        excitation.make_excitation(adapt(_strokes(rig, seconds), believed), believed),
        twin.robot,
        believed=twin.believed,
        seed=RIGS.index(rig),
    )
    recording.save(file)
    return {"digest": recording.digest}


def _strokes(rig: Rig, seconds: float) -> Strokes:
    if rig != "fixed-base":
        return moving_base(duration=seconds)
    swings = (10.0, 20.0) if seconds >= _BOTH_SWINGS else (10.0,)
    return fixed_base(swings=swings, duration=seconds)


def fit(twin: Twin, recordings: Sequence[Path], file: Path, search: str, belt: bool) -> Row:
    """Identify a twin by a search, with the knee's belt if asked, and write the robot file.

    What is returned are errors on data that the fit has not seen, and each parameter's value and
    that of the twin itself.
    """
    believed = with_play(load_robot(twin.believed)) if belt else load_robot(twin.believed)
    links = {"thigh.inertia": believed.thigh.inertia, "shank.inertia": believed.shank.inertia}
    options = IdentifyOptions(
        parameters=("+reality.knee.stiffness",) if belt else None,
        bounds={k: (v / _INERTIA_FACTOR, v * _INERTIA_FACTOR) for k, v in links.items()},
        search=search,
        effort=SearchOptions(tolerance=_USUAL_TOLERANCE),
    )
    identified = identify([load_recording(path) for path in recordings], believed, options=options)
    save_robot(identified, file, twin.believed)
    found = as_json(identified)
    before, after, truth = found["start_validation"], found["validation"], load_robot(twin.source)
    errors = ("closed_loop_position_rms_rad", "closed_loop_torque_rms_nm")
    return {
        "method": file.stem.removeprefix(f"{twin.name}-"),
        "twin": twin.name,
        **{f"{name}_before": before[name] for name in errors},
        **{name: after[name] for name in errors},
        "parameters": {
            row["name"]: (row["value"], _truth(truth, row["name"])) for row in found["parameters"]
        },
    }


def _truth(robot: Robot, name: str) -> float | None:
    """Return a twin's own value of a fitted number, None where it has none."""
    if name == "drive.delay":
        return robot.reality.latency.command
    return None if name.startswith("drive.") else LegHypothesis(robot).get(name)


def learn(recipe: Recipe, robot: Robot, seed: int, folder: Path) -> Row:
    """Train a policy in the simulation of a robot, or go on; return how it hops in there."""
    if not (folder / "policy.onnx").exists():
        train(recipe, robot, seed, folder, resume=True, threads=1, quiet=True)
    result = read_result(folder)
    errors = [trial["median_error_m"] for trial in result["selected"]["trials"]]
    return {
        "training": folder.name,
        "minutes": result["minutes"],
        "steps": result["steps"],
        "own_simulation_worst_abs_median_error_m": (
            None if None in errors else max(map(abs, errors))
        ),
        "own_simulation_score_m": float(result["selected"]["score_m"]),
    }


TUNE = Tune(start=ENERGY_SHAPING_TUNED, damped=True, threads=1)


def tune(source: str, folder: Path) -> Row:
    """Search gains of energy shaping in the simulation of a robot with an assumed belt."""
    told = folder / "told.toml"
    write_atomically(told, BELT.format(Path(source).resolve()).encode())
    return replace(TUNE, robot=str(told), out=folder).find()


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


_KEPT = ("command_m", "median_error_m", "median_abs_error_m", "std_m", "hops", "skipped_hops",
         "missed_runs", "hop_rate_hz", "flight_fraction", "body_contacts")  # fmt: skip


def load(controller: str | Path, told: str) -> Controller:
    """Return a controller that is told a robot, by name or file."""
    return load_controller(controller, load_robot(told))


def hop(
    controller: str | Path, told: str, twin: Twin, hops: tuple[Sequence[float], int, Noise]
) -> Row:
    """Let a controller that is told a robot hop on a twin; return ``rows`` as ``hops_of`` does."""
    return {"rows": hops_of(load(controller, told), twin.robot, *hops)}


def hops_of(
    controller: Controller, leg: Robot, heights: Sequence[float], repeats: int, noise: Noise = "own"
) -> list[Row]:
    """Let a controller hop on a leg, ``repeats`` runs of 15 s at each command, a record each.

    Errors are apex minus command. A leg that never leaves the ground at a command counts as
    ``motionless``; its error is standing height minus command. A policy whose training reached less
    high is asked for the highest command that it knows.
    """
    judged = runner.evaluate(
        [Entry("policy", WithinRange(controller, leg))],
        RolloutConfig(leg, disturbance_of(leg, noise), threads=1),
        commands=tuple(heights),
        repeats=repeats,
        seed=FIRST_SEED,
        kinds=("fixed",),
    )
    summary = judged.evaluation.to_json()["summary"]
    return [{**{n: row[n] for n in _KEPT}, "motionless": not row["hops"]} for row in summary]
