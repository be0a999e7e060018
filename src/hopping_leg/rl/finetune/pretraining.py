"""What is learnt in simulation before the real robot is touched; kept in the run's folder."""

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from hopping_leg.controllers.policy import Policy
from hopping_leg.rl.checkpoint import list_checkpoints, read_checkpoint, write_checkpoint
from hopping_leg.rl.finetune.apex_estimate import (
    ApexEstimator,
    ContactConfig,
    ContactEstimator,
    doubtful_legs,
    learn_contact,
)
from hopping_leg.rl.finetune.replay import ExploringPolicy, Transitions, TransitionWriter
from hopping_leg.rl.finetune.simulated import hop_many, traces_of
from hopping_leg.rl.finetune.trial_data import TrialData
from hopping_leg.robot.parameters import Robot

BELIEVED_LEGS = 16
"""Legs that hop at once for the replay."""


@dataclass(frozen=True)
class Task:
    """What is pretraining for.

    Attributes:
        policy: The one to go on from.
        robot: The believed leg.
        commands: Lowest and highest, m.
        seed: Seed of everything.
    """

    policy: Policy
    robot: Robot
    commands: tuple[float, float]
    seed: int

    def asked(self, options: ContactConfig) -> dict[str, object]:
        """Return all that decides about the outcome, as JSON values."""
        return {
            "policy": self.policy.digest,
            "robot": self.robot.digest,
            "options": {k: list(v) if isinstance(v, tuple) else v
                        for k, v in asdict(options).items()},
        }  # fmt: skip


def prepare(task: Task, options: ContactConfig, folder: Path) -> ApexEstimator:
    """Learn to estimate heights from joints, or take it from an earlier run's folder.

    Args:
        task: What for.
        options: How.
        folder: Where it is kept.
    """
    contact = ContactEstimator(options)
    for path in list_checkpoints(folder):
        tree = read_checkpoint(path)
        if tree["asked"] == task.asked(options):
            contact.restore(tree["contact"])
            return ApexEstimator(task.robot, contact, tree["drag"])
    card = task.policy.card
    span = (card.command_low, card.command_high)
    run = doubtful_legs(task.policy, task.robot, span, options.seed, options)
    contact = learn_contact(run, options.seed, options)
    estimator = ApexEstimator(task.robot, contact)
    estimator.calibrate(run)
    tree = {"asked": task.asked(options), "contact": contact.state(), "drag": estimator.drag}
    write_checkpoint(folder, len(list_checkpoints(folder)), tree)
    return estimator


def believed_rows(
    task: Task,
    controller: ExploringPolicy,
    estimator: ApexEstimator,
    writer: TransitionWriter,
    seconds: float,
) -> Transitions:
    """Return transitions of an exploring policy on the believed robot in simulation.

    Heights are reckoned there, too, as they will be on the real one.

    Args:
        task: Robot, commands and seed.
        controller: Explores.
        estimator: Estimates heights.
        writer: Writes transitions.
        seconds: In all, over ``BELIEVED_LEGS`` legs.
    """
    rng = np.random.default_rng((task.seed, 1))
    holds = max(1, round(seconds / BELIEVED_LEGS / 2.0))
    commands = np.repeat(rng.uniform(*task.commands, (holds, BELIEVED_LEGS)), 400, axis=0)
    robots = [task.robot] * BELIEVED_LEGS
    run = hop_many(controller, task.robot, robots, commands, task.seed)
    data = TrialData.of(traces_of(run))
    return writer(data, estimator(data))
