"""Transitions from what outings measured: what the environment would have given.

The actor's part of an observation is made by the policy's own layout from the samples as they
arrived. The critics' part and the reward come from hindsight: a robot that cannot know its height
while it hops can know it afterwards, and critics are asked only then.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers.observation_history import make_layout
from hopping_leg.controllers.policy import Card
from hopping_leg.envs import ApexReward
from hopping_leg.envs.observation import Array32
from hopping_leg.envs.transition import Transition
from hopping_leg.rl.export import Network
from hopping_leg.rl.finetune.exploring import EDGE
from hopping_leg.rl.finetune.heard import Heard
from hopping_leg.rl.finetune.hindsight import Hindsight
from hopping_leg.robot import kinematics
from hopping_leg.robot.parameters import Robot

CRITIC_SIZE = 10
"""Entries of an observation that only critics see."""

_HEIGHT, _SPEED = 0.1, 10.0
"""Scales of heights, m, and joint velocities, rad/s."""


@dataclass(frozen=True)
class Rows:
    """Transitions, (n, ...).

    Attributes:
        observation: The actor's inputs, then the critics', (n, size).
        following: The same one tick later, (n, size).
        action: Taken in between, -1 to 1, (n, 2).
        reward: (n,).
        done: Whether the outing was ended there by whoever watches over the leg, (n,).
    """

    observation: Array32
    following: Array32
    action: Array32
    reward: Array32
    done: Array32

    @staticmethod
    def join(parts: "list[Rows]") -> "Rows":
        """Return several as one."""
        names = ("observation", "following", "action", "reward", "done")
        return Rows(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


class Rewriter:
    """Writes transitions.

    Args:
        card: Of the policy.
        network: With the scaling of its inputs.
        robot: The believed leg.
        reward: Judges every tick.
        penalty: Reward lost where an outing is ended early.
    """

    def __init__(
        self, card: Card, network: Network, robot: Robot, reward: ApexReward, penalty: float
    ) -> None:
        self._card, self._network, self._robot = card, network, robot
        self._reward, self._penalty = reward, penalty
        self._scale = np.array(card.torque_scale)

    def __call__(self, heard: Heard, hindsight: Hindsight, *, ended: bool = False) -> Rows:
        """Return the transitions of outings.

        Args:
            heard: What they measured.
            hindsight: What is reckoned of them.
            ended: Whether they were ended early.
        """
        action = np.clip(heard.asked / self._scale, -EDGE, EDGE)
        seen = np.concatenate(
            [self.actor_inputs(heard), self._critic_inputs(heard, hindsight, action)], axis=-1
        ).astype(np.float32)
        reward = self._rewards(heard, hindsight, action)
        done = np.zeros(reward.shape, np.float32)
        if ended:
            done[-1] = 1.0
            reward[-1] -= self._penalty
        flat = [v.reshape(-1, v.shape[-1]) for v in (seen[:-1], seen[1:], action[:-1])]
        before, after, taken = flat
        return Rows(
            before, after, taken.astype(np.float32), reward.ravel().astype(np.float32), done.ravel()
        )

    def actor_inputs(self, heard: Heard) -> Array:
        """Return what the network computes with at every tick, normalised, (ticks, n, size)."""
        card, network = self._card, self._network
        layout = make_layout(card.layout, 1 / card.rate)
        layout.reset(heard.command.shape[1])
        last = np.zeros(heard.asked.shape[1:])
        rows = []
        for tick, measurement in enumerate(heard.measurements()):
            layout.update(measurement, last)
            parts = [part.reshape(len(part), -1) for part in layout.inputs().values()]
            joined = np.concatenate(parts, axis=1, dtype=np.float64)
            rows.append((joined - network.offset) * network.gain)
            last = heard.asked[tick]
        return np.stack(rows)

    def _critic_inputs(self, heard: Heard, hindsight: Hindsight, action: Array) -> Array:
        filled = heard.filled()
        middle = (self._card.command_low + self._card.command_high) / 2
        last = np.concatenate([np.zeros_like(action[:1]), action[:-1]])
        return np.concatenate(
            [
                ((hindsight.height - middle) / _HEIGHT)[..., None],
                hindsight.rate[..., None],
                filled[..., 0:2],
                filled[..., 2:4] / _SPEED,
                ((heard.command - middle) / _HEIGHT)[..., None],
                hindsight.flying[..., None],
                last,
            ],
            axis=-1,
        )

    def _rewards(self, heard: Heard, hindsight: Hindsight, action: Array) -> Array:
        """Return the reward of every tick but the last, (ticks - 1, n)."""
        filled = heard.filled()
        joints = [filled[..., 0:2], hindsight.rate[..., None], filled[..., 2:4]]
        state = np.concatenate([hindsight.height[..., None], *joints], axis=-1)
        gap = kinematics.foot_clearance(self._robot, hindsight.height, filled[..., 0:2])
        gap = np.where(hindsight.flying, np.maximum(gap, 1.0), 0.0)
        reached = np.full(heard.command.shape, np.nan)
        for leg, apexes in enumerate(hindsight.apexes):
            reached[np.maximum(apexes[:, 0].astype(np.int64), 1), leg] = apexes[:, 1]
        self._reward.restore({"air": np.zeros(0), "since": np.zeros(0)})
        rewards, last = np.empty((heard.ticks - 1, gap.shape[1])), np.zeros_like(action[0])
        for tick in range(1, heard.ticks):
            rewards[tick - 1], _ = self._reward(
                Transition(
                    state[tick], heard.command[tick - 1], action[tick - 1], last,
                    ~np.isnan(reached[tick]), reached[tick], partial(np.copy, gap[tick]),
                )
            )  # fmt: skip
            last = action[tick - 1]
        return rewards
