"""Last stage: hop on the twin without tuning, and count.

A twin brings latency, noise and losses of its own; the paper's disturbance stays off there, as it
would come on top. A twin without [reality] is met with the paper's disturbance.
"""

import hashlib
import json
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hopping_leg.controllers import RolloutConfig
from hopping_leg.controllers.policy import Policy
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.entries import Entry
from hopping_leg.evaluate.result import Evaluation
from hopping_leg.evaluate.runner import evaluate
from hopping_leg.io import write_json
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import NO_NOISE, NoiseAndDelay
from hopping_leg.sim_to_real.methods import Method
from hopping_leg.sim_to_real.study import Study, TwinFile

FIRST_SEED = 1000
"""Of the trials; no seed from here on has chosen anything."""

_KEPT = ("command_m", "median_error_m", "std_m", "hops", "skipped_hops", "hop_rate_hz",
         "flight_fraction", "body_contacts")  # fmt: skip


@dataclass(frozen=True)
class Tried(ABC):
    """A policy that hops at the study's commands on some leg."""

    study: Study
    twin: TwinFile

    weight = 0.3

    @property
    @abstractmethod
    def name(self) -> str:
        """What is done."""

    @property
    @abstractmethod
    def leg(self) -> Robot:
        """What the policy hops on."""

    @property
    @abstractmethod
    def file(self) -> Path:
        """Of the result."""

    @property
    @abstractmethod
    def policy(self) -> bytes:
        """The policy's file."""

    @property
    def done(self) -> bool:
        """Whether the result is there.

        Raises:
            UsageError: It is there, but of other trials.
        """
        if not self.file.exists():
            return False
        if json.loads(self.file.read_text(encoding="utf-8"))["asked"] != self._asked():
            raise UsageError(
                f"{self.file} holds trials of another policy, twin or length; give another"
                " --folder, or delete it to try again."
            )
        return True

    def run(self, *, quiet: bool) -> None:
        """Try the policy at every command and write what was measured."""
        content = {"asked": self._asked(), "rows": hop(self.policy, self.leg, self.study)}
        write_json(self.file, content)

    def progress(self) -> tuple[float, str]:
        """Return the share done and what to show while it runs."""
        return 0.0, ""

    def measured(self) -> list[dict[str, Any]]:
        """Return what was measured, one row per command."""
        rows: list[dict[str, Any]] = json.loads(self.file.read_text(encoding="utf-8"))["rows"]
        return rows

    def _asked(self) -> dict[str, Any]:
        return {
            "policy": hashlib.sha256(self.policy).hexdigest()[:16],
            "twin": self.leg.digest,
            "commands": list(self.study.commands),
            "repeats": self.study.repeats,
        }


@dataclass(frozen=True)
class Hop(Tried):
    """A trained policy tried on a twin."""

    method: Method
    seed: int

    @property
    def name(self) -> str:
        """What is done."""
        return f"hop on {self.twin.name}, {self.method.name}, seed {self.seed}"

    @property
    def leg(self) -> Robot:
        """The twin."""
        return self.twin.robot

    @property
    def suffix(self) -> str:
        """Of the file with the result."""
        return ""

    @property
    def file(self) -> Path:
        """Of the result."""
        path = self.study.trial(self.twin, self.method, self.seed)
        return path.with_name(f"{path.stem}{self.suffix}.json")

    @property
    def policy(self) -> bytes:
        """The selected policy of the training."""
        folder = self.study.training(self.twin, self.method, self.seed)
        return (folder / "policy.onnx").read_bytes()

    def rows(self) -> list[dict[str, Any]]:
        """Return what was measured, one row per command."""
        where = {"method": self.method.name, "twin": self.twin.name, "seed": self.seed}
        return [{**where, **row} for row in self.measured()]


def disturbance_of(robot: Robot) -> NoiseAndDelay:
    """Return what a leg is tried with on top of what it brings: nothing, if it brings anything."""
    return NoiseAndDelay() if robot.reality.neutral else NO_NOISE


def hop(content: bytes, robot: Robot, study: Study) -> list[dict[str, Any]]:
    """Let a policy hop and return a row per command.

    Errors are apex minus command. A leg that never leaves the ground at a command counts as
    ``motionless`` with an error as large as the command.

    Args:
        content: The policy file.
        robot: The twin.
        study: Says at which commands and how often.
    """
    policy = Policy(content, "the trained policy", "policy")
    bounds = (policy.card.command_low, policy.card.command_high)
    setup = RolloutConfig(robot, disturbance_of(robot), threads=study.threads)
    judged = evaluate(
        [Entry("policy", policy, bounds)],
        setup,
        commands=study.commands,
        repeats=study.repeats,
        seed=FIRST_SEED,
        kinds=("fixed",),
    )
    return _rows(judged.evaluation)


def _rows(evaluation: Evaluation) -> list[dict[str, Any]]:
    summary = evaluation.to_json()["summary"]
    apexes = {d["command_m"]: np.array(d["apexes_m"]) for d in evaluation.distributions}
    rows = []
    for full in summary:
        row = {name: full[name] for name in _KEPT}
        command = row["command_m"]
        errors = apexes[command] - command
        row["motionless"] = not len(errors)
        row["median_abs_error_m"] = float(np.median(np.abs(errors))) if len(errors) else command
        if row["motionless"]:
            row["median_error_m"] = -command
        rows.append(row)
    return rows
