"""What must not change: named cases, each a list of arrays in a stable order.

Values only, never names of classes, columns or JSON keys, so that a renaming changes no digest.
What a case calls goes through public entry points, above all the command line.
"""

import contextlib
import io
import json
import os
import stat
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import onnx
import polars as pl
import pytest
from onnx import numpy_helper

from hopping_leg.cli import main
from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.registry import (
    load_controller,
    load_policy,
    robot_of,
    shipped_policies,
)
from hopping_leg.envs import ApexRewardConfig, HoppingTask, TaskConfig, apex_reward, paper_reward
from hopping_leg.rl import policy_evaluation
from hopping_leg.robot import load_robot
from tests.cli.emulated import put_behind

Values = list[np.ndarray]


@dataclass(frozen=True)
class Case:
    """A computation that is repeated: its arrays, made in an empty folder."""

    compute: Callable[[Path], Values]
    tolerance: float
    """Largest difference of a summary value on another processor or with other libraries, relative
    to the larger of 1 and the value; rounding errors grow with the horizon."""
    slow: bool = False


CASES: dict[str, Case] = {}


def case(name: str, tolerance: float, *, slow: bool = False, needs: str | None = None):
    """Register a case, skipped by name where an optional library is missing."""

    def register(function: Callable[[Path], Values]) -> Callable[[Path], Values]:
        def compute(folder: Path) -> Values:
            if needs is not None:
                pytest.importorskip(needs)
            return function(folder)

        CASES[name] = Case(compute, tolerance, slow)
        return function

    return register


def hop(*words: object) -> None:
    """Call the command line, silently."""
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as e:
        code = main([str(word) for word in words])
    assert code == 0, e.getvalue()


def hopped(robot: str, seconds: float, *, keep=lambda m: None) -> Values:
    """Return what energy shaping did on three legs whose commands change half-way."""
    config = RolloutConfig(load_robot(robot), threads=1)
    scale = config.standing_length / 0.2
    commands = scale * np.tile([0.25, 0.30, 0.35], (round(seconds * config.rate), 1))
    commands[len(commands) // 2 :] = commands[0, ::-1]
    controller = load_controller("energy-shaping", config.robot)
    act = controller.act
    controller.act = lambda measurement: (keep(measurement), act(measurement))[1]
    done = rollout(controller, config, commands, seed=11)
    return [done.time, *done.data.values()]


@case("policies", 1e-4)
def policies(folder: Path) -> Values:
    """Torques of every shipped policy on 100 measurements, with noise and delay."""
    seen = []
    hopped("legv2-paper", 0.5, keep=seen.append)
    result = []
    for name in shipped_policies():
        policy = load_policy(name)
        policy.set_robot(load_robot("legv2-paper"))
        policy.reset(3)
        result.append(np.array([policy.act(measurement) for measurement in seen]))
    return result


REWARDS = {
    "paper": paper_reward,
    "apex": lambda robot: apex_reward(robot, ApexRewardConfig(), 200.0),
}


def _task(layout: str, reward: str, **options: object) -> Values:
    """Return 200 steps of four legs with resets, changing commands, noise and delay."""
    chosen = TaskConfig(
        observation=layout, episode=0.4, reset_distribution="mixed", random_episode_start=True,
        command_resampling_time=(0.05, 0.2),
        fall_clearance=0.01, fall_penalty=2.0, **options,
    )  # fmt: skip
    robot = load_robot("legv2-paper")
    rng = np.random.default_rng(5)
    task = HoppingTask(robot, 4, chosen, REWARDS[reward](robot), rng, threads=1)
    actions = np.random.default_rng(7).uniform(-1.2, 1.2, (200, 4, 2))
    actions[100:] = 0.3 * actions[100:] + [0.2, -0.4]
    steps, critics = [], []
    for tick, action in enumerate(actions):
        steps.append(task.step(action))
        critics.append(task.privileged())
        if tick == 150:
            critics.append(task.reset(np.array([1, 3])))
    columns = [np.array(column) for column in list(zip(*steps, strict=True))[:8]]
    ends = [s.final_observation for s in steps if s.final_observation is not None]
    assert ends
    return [*columns, *critics[:151], critics[151], *critics[152:], *ends]


for _reward in REWARDS:
    for _layout in ("three-samples", "dated", "dated-long"):
        case(f"task-{_reward}-{_layout}", 1e-4)(
            lambda folder, layout=_layout, reward=_reward: _task(layout, reward)
        )


@case("task-range", 1e-4)
def task_range(folder: Path) -> Values:
    """A range of commands at a coarse physics step."""
    return _task("dated", "apex", command_range=(0.22, 0.4), timestep=1e-3)


_STUDENT = ["n_steps=32", "batch_size=64", "gradient_steps=4", "mixing_share=0.5"]
RECIPES = {
    "paper": ["train_freq=32", "learning_starts=64", "gradient_steps=4", "batch_size=32"],
    "fast": _STUDENT,
    "rl": ["n_steps=32", "batch_size=64"],
    "surprised": [*_STUDENT, "calibrations=1"],
    "recurrent": [*_STUDENT, "memory=gru"],
}
"""What makes a training of a recipe short: a few rollouts of four legs."""

MADE = {
    "surprised": ("--recipe", "fast", "--randomise", "surprises", "--heights", 0.25, 0.3),
    "recurrent": ("--recipe", "fast", "--observation", "dated", "--heights", 0.25, 0.3),
}


def _trained(folder: Path, recipe: str) -> Values:
    """Return weights of a training's snapshots and policy, and scores of its trials."""
    numbers = ["num_envs=4", "eval_every=64", "eval_start=0.5", *RECIPES[recipe]]
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(policy_evaluation.evaluate_policy.__kwdefaults__, "seconds", 0.5)
        hop(
            "train", *MADE.get(recipe, ("--recipe", recipe)),
            "--seed", 3, "--threads", 1, "--out", folder / "run",
            "--steps", 256 if recipe == "paper" else 512, "--set", *numbers,
        )  # fmt: skip
    files = [*sorted((folder / "run" / "snapshots").iterdir()), folder / "run" / "policy.onnx"]
    told = json.loads((folder / "run" / "result.json").read_text())
    scores = [row["score_m"] for row in told["history"]]
    return [np.array(scores, float), *(w for file in files for w in _weights(file))]


def _weights(file: Path) -> Values:
    """Return all constants of a policy's graph and its operations in their order."""
    graph = onnx.load(file).graph
    operations = " ".join(node.op_type for node in graph.node).encode()
    constants = [numpy_helper.to_array(constant) for constant in graph.initializer]
    return [*constants, np.frombuffer(operations, np.uint8)]


for _recipe in RECIPES:
    case(f"train-{_recipe}", 2e-2, slow=True, needs="torch")(
        lambda folder, recipe=_recipe: _trained(folder, recipe)
    )


@case("evaluate", 5e-2, slow=True)
def evaluate(folder: Path) -> Values:
    """Every number of an evaluation's tables, sorted, as keys have no order to rely on."""
    file = folder / "result.json"
    hop(
        "evaluate", "energy-shaping", "--commands", 0.3, "--seeds", 1, "--floor", "soft",
        "--threads", 1, "--json", file,
    )  # fmt: skip
    tables = [table for table in json.loads(file.read_text()).values() if isinstance(table, list)]
    return [np.sort(np.array(list(_numbers(tables)), float))]


def _numbers(value: object) -> Iterator[float]:
    """Yield the numbers in nested JSON."""
    if isinstance(value, int | float):
        yield float(value)
    for entry in value.values() if isinstance(value, dict) else ():
        yield from _numbers(entry)
    for entry in value if isinstance(value, list) else ():
        yield from _numbers(entry)


def _recorded(folder: Path, rig: str, robot: str, *words: object) -> Path:
    """Excite a leg, record what plays it, and return the recording."""
    folder.mkdir(exist_ok=True)
    excitation = folder / f"{rig}.parquet"
    seconds = ["--duration", 8, "--amplitudes", 0.05, "--periods", 0.5]
    believed = "legv2" if robot == "twin" else robot
    hop("record", rig, "--robot", believed, *seconds, *words, "--out", excitation)
    hop("record", "play", excitation, "--robot", robot, "--out", folder / "recordings", "--seed", 2)
    (recording,) = (folder / "recordings").glob("*.parquet")
    return recording


def _columns(file: Path) -> Values:
    """Return the numeric columns of a Parquet file in their order."""
    table = pl.read_parquet(file)
    return [c.to_numpy() for c in table.iter_columns() if c.dtype.is_numeric() or c.dtype == bool]


@case("identify", 1e-3, slow=True)
def identify(folder: Path) -> Values:
    """Recordings of a twin, and what least squares fits to one, with intervals and errors."""
    recording = _recorded(folder, "fixed-base", "twin", "--swings", 4)
    moving = _recorded(folder / "moving", "moving-base", "twin")
    robot, told = folder / "leg.toml", folder / "leg.json"
    hop(
        "identify", recording, "--validate", moving, "--parameters", "hip.friction,knee.damping",
        "--search", "least-squares", "--threads", 1, "--out", robot, "--json", told,
    )  # fmt: skip
    leg = load_robot(robot)
    fitted = [leg.hip.friction, leg.knee.damping]
    told = json.loads(told.read_text())
    numbers = [list(_numbers(told[key])) for key in sorted(told) if not key.startswith("version")]
    numbers = np.sort(np.array([n for entries in numbers for n in entries]))
    return [np.array(fitted), numbers, *_columns(recording), *_columns(moving)]


@contextlib.contextmanager
def _wire() -> Iterator[list[bytes]]:
    """Collect what either end writes to the line, a pair of sockets, in order."""
    frames: list[bytes] = []
    write = os.write

    def note(descriptor: int, data: bytes) -> int:
        if stat.S_ISSOCK(os.fstat(descriptor).st_mode):
            frames.append(bytes(data))
        return write(descriptor, data)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "write", note)
        yield frames


def _deployed(folder: Path, controller: str, robot: str) -> Values:
    """Return every byte between host and emulated drives in virtual time, and the trace."""
    with pytest.MonkeyPatch.context() as patch, _wire() as frames:
        lockstep = put_behind(patch, robot=robot, seed=4)
        hop(
            "deploy", controller, "--transport", "/dev/leg", "--robot", robot, "--seconds", "0.5",
            "--schedule", "0.25:0.2,0.3:0.3", "--yes", "--out", folder / "run",
        )  # fmt: skip
    (trace,) = (folder / "run").glob("*.parquet")
    assert len(frames) > 1000
    wire = np.frombuffer(b"".join(frames), np.uint8)
    return [wire, np.array(lockstep.truth), *_columns(trace)]


for _controller, _robot in (("energy-shaping", "legv2-paper"), ("fast", robot_of(["fast"]))):
    case(f"deploy-{_controller}", 1e-2, needs="moteus")(
        lambda folder, controller=_controller, robot=_robot: _deployed(folder, controller, robot)
    )

for _robot in ("legv1", "legv2", "legv2-paper", "twin"):
    case(f"rollout-{_robot}", 1e-4)(lambda folder, robot=_robot: hopped(robot, 1.0))


@case("record-doublependulum", 1e-6)
def record_doublependulum(folder: Path) -> Values:
    """A recording of the robot that cannot hop."""
    return _columns(_recorded(folder, "fixed-base", "doublependulum", "--swings", 4))
