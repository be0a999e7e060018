"""The same controllers in both physics engines: what of their accuracy is MuJoCo's?

Hops on a stiff ground, MuJoCo's and PyBullet's own rigid one. No controller is told or trained
again.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hopping_leg.cli.options import Heights, JsonFile, at_least
from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.registry import load_controller, robot_of
from hopping_leg.evaluate.metrics import measure, pooled_apexes
from hopping_leg.evaluate.trials import choose_commands, floor_robot
from hopping_leg.io import versions
from hopping_leg.robot import TIMESTEP, load_robot
from hopping_leg.sim import Simulator
from hopping_leg.sim.mujoco_simulator import MujocoSimulator
from hopping_leg.workers import ProcessWorkers
from studies.engines.pybullet import PyBulletSimulator
from studies.shared import Row, show_rows

Engine = Literal["MuJoCo", "PyBullet"]

ENGINES: dict[Engine, Callable[..., Simulator]] = {
    "MuJoCo": MujocoSimulator,
    "PyBullet": PyBulletSimulator,
}

_SECONDS = 15.0


@dataclass(frozen=True)
class Engines:
    """Let controllers hop in PyBullet as well, without retraining; needs `pip install pybullet`."""

    controllers: tuple[str, ...] = ("energy-shaping", "fast", "precise", "paper")
    """Names or .onnx files."""
    commands: Heights | None = None
    """Apex heights, m; default 0.25 0.30 0.35, scaled to the leg's length."""
    seeds: int = 2
    """Realisations of noise and delay per command."""
    seed: int = 1000
    """All of them follow from it; choose one that selected nothing."""
    timestep: float = TIMESTEP
    """Physics step, s."""
    workers: int = 2
    """Processes that share the work; the numbers do not depend on it."""
    json: JsonFile = None

    def measure(self) -> Row:
        """Let all controllers hop in both engines, print a table, return every number."""
        at_least(1, seeds=self.seeds, workers=self.workers)
        at_least(0, seed=self.seed)
        places = itertools.product(ENGINES, self.controllers)
        with ProcessWorkers(self.workers) as pool:
            parts = pool.map(hop, [(self, *place) for place in places])
        rows = [row for part in parts for row in part]
        show_rows(rows, "engine", "controller", "command_m", "median_error_m", "std_m", "hops")
        return {
            "rows": rows,
            "seeds": self.seeds,
            "seed": self.seed,
            "timestep_s": self.timestep,
            "versions": versions("hopping-leg", "mujoco", "numpy", "onnxruntime", "pybullet"),
        }


def hop(study: Engines, engine: Engine, name: str) -> list[Row]:
    """Return how a controller hops in an engine on the robot of its training: a row per command.

    Errors are median apex minus command; a leg that does not hop has none.
    """
    told = load_robot(robot_of([name]))
    robot = floor_robot(told, "stiff")
    config = RolloutConfig(robot, timestep=study.timestep)
    commands = choose_commands(robot, study.commands)
    asked = np.repeat(commands, study.seeds)
    schedule = np.tile(asked, (round(_SECONDS * config.rate), 1))
    legs = ENGINES[engine](robot, len(asked), rate=config.rate, timestep=study.timestep)
    controller = load_controller(name, told, other="accept")
    run = rollout(controller, config, schedule, study.seed, legs=legs)
    windows = [measure(run.trace(leg))[0] for leg in range(len(asked))]
    rows = []
    for index, command in enumerate(commands):
        found = pooled_apexes(windows[index * study.seeds : (index + 1) * study.seeds])
        rows.append({
            "engine": engine,
            "controller": name,
            "command_m": command,
            "median_error_m": float(np.median(found) - command) if len(found) else None,
            "std_m": float(found.std()) if len(found) else None,
            "hops": len(found),
        })  # fmt: skip
    return rows
