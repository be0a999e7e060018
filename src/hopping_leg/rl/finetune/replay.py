"""Transitions from what trials measured: what the environment would have given.

The actor's part of an observation is made by the policy's own layout from the samples as they
arrived. The critics' part and the reward come from estimate: a robot that cannot know its height
while it hops can know it afterwards, and critics are asked only then.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from hopping_leg.arrays import Array, Array32
from hopping_leg.controllers import observation_history, policy, protocol
from hopping_leg.controllers.onnx_session import open_session
from hopping_leg.envs import Reward
from hopping_leg.envs.rewards import Transition
from hopping_leg.rl.finetune import apex_estimate, simulated, trial_data
from hopping_leg.rl.onnx_export import PREFIX, Network, expose_hidden
from hopping_leg.robot import Robot, kinematics

EDGE = 0.995
"""Largest action: exploration and gradients end where tanh is flat."""


class ExploringPolicy:
    """Acts as a policy file does, and off it; implements ``Controller``.

    The noise is the hidden layer times a random matrix of standard deviation ``spread``, (hidden,
    2), held for ``hold`` ticks.
    """

    def __init__(
        self, content: bytes, card: policy.Card, spread: Array, hold: int, rng: np.random.Generator
    ) -> None:
        self.name = f"exploring {card.recipe}"
        self._layout = observation_history.make_observation_history(card.layout, 1 / card.rate)
        self._session = open_session(expose_hidden(content), self.name)
        hidden = [o.name for o in self._session.get_outputs() if o.name.startswith(PREFIX)]
        self._wanted = ["torque", hidden[-1]]
        self._scale = np.array(card.torque_scale)
        self._spread, self._hold, self._rng = spread, hold, rng

    def reset(self, count: int) -> None:
        """Forget everything."""
        self._layout.reset(count)
        self._torque = np.zeros((count, 2))
        self._left = 0

    def act(self, measurement: protocol.Measurement) -> Array:
        """Return joint torques, N m, (n, 2)."""
        self._layout.update(measurement, self._torque)
        torque, hidden = self._session.run(self._wanted, self._layout.inputs())
        if self._left == 0:
            shape = (len(torque), *self._spread.shape)
            self._matrix = self._rng.standard_normal(shape) * self._spread
            self._left = self._hold
        self._left -= 1
        action = np.clip(torque.astype(np.float64) / self._scale, -EDGE, EDGE)
        off = np.einsum("nh,nha->na", hidden.astype(np.float64), self._matrix)
        self._torque = np.tanh(np.arctanh(action) + off) * self._scale
        return self._torque

    def internals(self) -> dict[str, Array]:
        """Return nothing."""
        return {}


CRITIC_SIZE = 10
"""Entries of an observation that only critics see."""

_HEIGHT, _SPEED = 0.1, 10.0
"""Scales of heights, m, and joint velocities, rad/s."""


@dataclass(frozen=True)
class Transitions:
    """Transitions, (n, ...)."""

    observation: Array32
    """Inputs of the actor, then those of the critics, (n, size)."""
    following: Array32
    """The same one tick later, (n, size)."""
    action: Array32
    """Action in between, -1 to 1, (n, 2)."""
    reward: Array32
    """Reward of the action, (n,)."""
    done: Array32
    """Whether the trial was ended there by whoever watches over the leg, (n,)."""


class TransitionWriter:
    """Writes transitions; a trial that is ended early loses ``penalty`` of reward."""

    def __init__(
        self, card: policy.Card, network: Network, robot: Robot, reward: Reward, penalty: float
    ) -> None:
        self._card, self._network, self._robot = card, network, robot
        self._reward, self._penalty, self._untouched = reward, penalty, reward.state()
        self._scale = np.array(card.torque_scale)

    def __call__(
        self, data: trial_data.TrialData, estimate: trial_data.ApexEstimate, *, ended: bool = False
    ) -> Transitions:
        """Return the transitions of trials, which may have ``ended`` early."""
        action = np.clip(data.asked / self._scale, -EDGE, EDGE)
        seen = np.concatenate(
            [self._actor_inputs(data), self._critic_inputs(data, estimate, action)], axis=-1
        ).astype(np.float32)
        reward = self._rewards(data, estimate, action)
        done = np.zeros(reward.shape, np.float32)
        if ended:
            done[-1] = 1.0
            reward[-1] -= self._penalty
        flat = [v.reshape(-1, v.shape[-1]) for v in (seen[:-1], seen[1:], action[:-1])]
        before, after, taken = flat
        return Transitions(
            before, after, taken.astype(np.float32), reward.ravel().astype(np.float32), done.ravel()
        )

    def _actor_inputs(self, data: trial_data.TrialData) -> Array:
        """Return what the network computes with at every tick, normalised, (ticks, n, size)."""
        card, network = self._card, self._network
        layout = observation_history.make_observation_history(card.layout, 1 / card.rate)
        layout.reset(data.command.shape[1])
        last = np.zeros(data.asked.shape[1:])
        rows = []
        for tick, measurement in enumerate(data.measurements()):
            layout.update(measurement, last)
            parts = [part.reshape(len(part), -1) for part in layout.inputs().values()]
            joined = np.concatenate(parts, axis=1, dtype=np.float64)
            rows.append((joined - network.offset) * network.gain)
            last = data.asked[tick]
        return np.stack(rows)

    def _critic_inputs(
        self, data: trial_data.TrialData, estimate: trial_data.ApexEstimate, action: Array
    ) -> Array:
        filled = data.filled()
        middle = (self._card.command_low + self._card.command_high) / 2
        last = np.concatenate([np.zeros_like(action[:1]), action[:-1]])
        return np.concatenate(
            [
                ((estimate.height - middle) / _HEIGHT)[..., None],
                estimate.rate[..., None],
                filled[..., 0:2],
                filled[..., 2:4] / _SPEED,
                ((data.command - middle) / _HEIGHT)[..., None],
                estimate.flying[..., None],
                last,
            ],
            axis=-1,
        )

    def _rewards(
        self, data: trial_data.TrialData, estimate: trial_data.ApexEstimate, action: Array
    ) -> Array:
        """Return the reward of every tick but the last, (ticks - 1, n)."""
        filled = data.filled()
        joints = [filled[..., 0:2], estimate.rate[..., None], filled[..., 2:4]]
        state = np.concatenate([estimate.height[..., None], *joints], axis=-1)
        gap = kinematics.foot_clearance(self._robot, estimate.height, filled[..., 0:2])
        gap = np.where(estimate.flying, np.maximum(gap, 1.0), 0.0)
        reached = np.full(data.command.shape, np.nan)
        for leg, apexes in enumerate(estimate.apexes):
            reached[np.maximum(apexes[:, 0].astype(np.int64), 1), leg] = apexes[:, 1]
        self._reward.restore(self._untouched)
        rewards, last = np.empty((data.ticks - 1, gap.shape[1])), np.zeros_like(action[0])
        for tick in range(1, data.ticks):
            rewards[tick - 1], _ = self._reward(
                Transition(
                    state[tick], data.command[tick - 1], action[tick - 1], last,
                    ~np.isnan(reached[tick]), reached[tick], partial(np.copy, gap[tick]),
                )
            )  # fmt: skip
            last = action[tick - 1]
        return rewards


BELIEVED_LEGS = 16
"""Legs that hop at once for the replay."""


def believed_rows(
    robot: Robot,
    commands: tuple[float, float],
    seed: int,
    controller: ExploringPolicy,
    estimator: apex_estimate.ApexEstimator,
    writer: TransitionWriter,
    seconds: float,
) -> Transitions:
    """Return transitions of an exploring policy on the believed robot in simulation.

    Heights are estimated there, too. The time is that of all ``BELIEVED_LEGS`` legs together.
    """
    rng = np.random.default_rng((seed, 1))
    holds = max(1, round(seconds / BELIEVED_LEGS / 2.0))
    steps = np.repeat(rng.uniform(*commands, (holds, BELIEVED_LEGS)), 400, axis=0)
    run = simulated.hop_many(controller, robot, [robot] * BELIEVED_LEGS, steps, seed)
    data = trial_data.TrialData.of(simulated.traces_of(run))
    return writer(data, estimator(data))
