"""Policies trained on what is known of a twin, and their hops on it."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hopping_leg import io
from hopping_leg.arrays import Array
from hopping_leg.controllers import Controller, RolloutConfig
from hopping_leg.controllers.command_schedule import command_range
from hopping_leg.controllers.registry import ENERGY_SHAPING, load_controller
from hopping_leg.evaluate import entries, runner
from hopping_leg.evaluate.motor_load import MotorLoad
from hopping_leg.robot import Robot, load_robot
from hopping_leg.sim import Measurement
from studies.sim_to_real.jobs import Job, StoredJob
from studies.sim_to_real.twins import Twin, disturbance_of, simulated

if TYPE_CHECKING:
    from hopping_leg.rl.recipe import Recipe
    from hopping_leg.rl.run_folder import RunFolder

COMMANDS = (0.25, 0.27, 0.29, 0.31, 0.33, 0.35)
"""Apex heights at which a twin is tried, m."""

FIRST_SEED = 1000
"""First seed of the trials; no seed from here on has chosen anything."""


@dataclass(frozen=True)
class TrainPolicy(Job):
    """Training of a policy in the simulation of the robot ``source``; it has a folder."""

    folder: Path
    source: str
    recipe: "Recipe"
    seed: int = 0

    @property
    def trained(self) -> "Recipe":
        """What is trained; it may depend on earlier jobs."""
        return self.recipe

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
