"""Short trials of a small continued training."""

import dataclasses

import numpy as np

from hopping_leg.controllers.hardware_trial import HardwareTrial, measured_table
from hopping_leg.controllers.registry import load_policy, robot_of
from hopping_leg.rl.finetune.apex_estimate import ApexEstimator, ContactConfig, ContactEstimator
from hopping_leg.rl.finetune.finetuning import FinetuneConfig, StoppingRules
from hopping_leg.robot import GRAVITY, kinematics, load_robot
from hopping_leg.trace import Trace

ROBOT = load_robot(robot_of(["fast"]))
POLICY = load_policy("fast")
PERIOD = 0.005
CONTACT = ContactConfig(num_envs=4, seconds=3.0, steps=20, batch_size=64, hidden=(8,))
OPTIONS = FinetuneConfig(
    commands=(0.25, 0.35), trial_seconds=4.0, contact=CONTACT,
    stopping_rules=StoppingRules(minutes=0.4, patience=50, margin=10.0),
)  # fmt: skip


class Imagined:
    """A robot whose hops are always so much off their command; what its joints do is made up."""

    name = "imagined"

    def __init__(self, off=0.02, complain_from=10**9):
        self.off, self.complain_from, self.trials = off, complain_from, 0

    def hop(self, controller, schedule, seed):
        command = schedule.commands(1 / PERIOD)
        rng = np.random.default_rng(seed)
        joints = {name: rng.normal(0, 0.1, (len(command), 2)) for name in ("q", "qd", "torque")}
        joints["q"] += [0.6, -1.3]
        joints["asked"] = rng.uniform(-3, 3, (len(command), 2))
        table = measured_table(np.arange(len(command)) * PERIOD, command, joints)
        self.trials += 1
        complaint = "A joint left its range." if self.trials > self.complain_from else ""
        time = np.arange(1.2, len(command) * PERIOD, 0.4)
        at = command[(time / PERIOD).astype(int)]
        truth = np.stack([time, at, at + self.off], axis=1)
        trace = Trace(table, {"rate_hz": 1 / PERIOD})
        return HardwareTrial(trace, len(command) * PERIOD, complaint, truth)


def flying_leg(hops):
    """Return joints of a leg that stands still between flights to apexes, m, height and flight."""
    posture = np.array([0.6, -1.25])
    stand = float(kinematics.stance_height(ROBOT, posture))
    height, flying = [np.full(100, stand)], [np.zeros(100, bool)]
    for apex in hops:
        speed = np.sqrt(2 * GRAVITY * (apex - stand))
        time = np.arange(PERIOD, 2 * speed / GRAVITY, PERIOD)
        height.append(stand + speed * time - GRAVITY * time**2 / 2)
        flying.append(np.ones(len(time), bool))
        height.append(np.full(60, stand))
        flying.append(np.zeros(60, bool))
    height, flying = np.concatenate(height), np.concatenate(flying)
    return np.tile(posture, (len(height), 1, 1)), height, flying


class Known(ContactEstimator):
    """Knows who flies."""

    def __init__(self, flying):
        super().__init__(dataclasses.replace(CONTACT, hidden=(2,)))
        self._flying = flying

    def airborne(self, data):
        """Return it."""
        return np.where(self._flying, 1.0, -1.0)[:, None]


def estimator(flying):
    return ApexEstimator(ROBOT, Known(flying))
