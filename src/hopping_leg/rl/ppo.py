"""Proximal policy optimisation (Schulman et al. 2017) on many legs.

The actor sees what the robot measures; the critic, which is thrown away afterwards, sees the true
state. The noise of exploration is the same for all states and falls to a schedule; the learning
rate follows how far a policy moves. Rollouts and gradient steps take turns: learning from a policy
that is one update older, it forgets how to hop as the noise falls.
"""

import copy
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from stable_baselines3.common.torch_layers import create_mlp
from torch import nn

from hopping_leg.arrays import Array32, Stateful
from hopping_leg.rl.learner import Learner, MakeTask, NetworkConfig
from hopping_leg.rl.onnx_export import Actor, DenseActor
from hopping_leg.workers import WorkerGroup

_LEAST_RATE, _MOST_RATE = 1e-5, 3e-3  # between which the learning rate adapts
_AVERAGED = 0.97  # share that an update leaves of the actors' mean so far, which is the policy
_OUTSIDE = 0.1  # weight of the square by which mean actions leave [-1, 1]


@dataclass(frozen=True)
class PPOConfig:
    """Numbers of proximal policy optimisation, with the names of stable-baselines3."""

    learning_rate: float = 1e-3
    """Learning rate of Adam at the start, before it adapts; falls to a tenth besides."""
    n_steps: int = 32
    """Control steps of a rollout, each environment."""
    n_epochs: int = 3
    """How often each is learnt from."""
    batch_size: int = 8192
    """Control steps per gradient step."""
    gamma: float = 0.99
    """Discount factor per control step: a horizon of half a second, about one hop."""
    gae_lambda: float = 0.95
    """Of generalised advantage estimation."""
    clip_range: float = 0.2
    """How far the ratio of probabilities counts on either side of 1."""
    target_kl: float = 0.015
    """Divergence of the policies before and after an update to which the learning rate adapts."""
    log_std: tuple[float, float] = (-0.7, -3.0)
    """Log standard deviation of the actions' noise at the start and at the end."""
    log_std_until: float = 0.7
    """Share of the training with which it has fallen."""


class Rollout(NamedTuple):
    """Some control periods of n environments, in torch."""

    observations: torch.Tensor
    """What the actor saw, (ticks, n, size)."""
    states: torch.Tensor
    """What the critic sees, before every tick and after the last, (ticks + 1, n, k)."""
    actions: torch.Tensor
    """(ticks, n, 2)."""
    rewards: torch.Tensor
    """(ticks, n)."""
    ended: torch.Tensor
    """1 where an episode ended with the tick, (ticks, n)."""
    final: torch.Tensor
    """What the critic sees of the legs where any episode ended with the tick, (ticks, n, k)."""
    truncated: torch.Tensor
    """1 where an episode ended as its time was up, not as the leg fell, (ticks, n)."""
    noise: torch.Tensor
    """Of the actions, standard normal, (ticks, n, 2)."""
    std: torch.Tensor
    """Standard deviation of the actions, a number."""


class RolloutCollector(Stateful):
    """Collects what a ``Rollout`` holds, apart from noise, as arrays."""

    STATE = ("task", "_seen")

    def __init__(self, make_task: MakeTask, config: PPOConfig, *_: int) -> None:
        self.task, self.config = make_task(), config
        self._seen = self.task.reset()

    @torch.no_grad()
    def collect(self, actor: nn.Module, share: float, std: float, noise: Array32) -> list[Array32]:
        """Let the actor act, with noise (ticks, n, 2), at a share of the training."""
        task = self.task
        task.reward.anneal(share)
        states = [task.privileged()]
        final = np.zeros((self.config.n_steps, *states[0].shape), np.float32)
        ticks = []
        for tick, drawn in enumerate(noise):
            seen, action = self._seen, actor(torch.from_numpy(self._seen)).numpy() + std * drawn
            step = task.step(action)
            if step.final_privileged is not None:
                final[tick] = step.final_privileged
            self._seen = step.observation
            states.append(task.privileged())
            ended = step.terminated | step.truncated
            ticks.append((seen, action, step.reward, ended, step.truncated))
        stacked = (np.stack(part, dtype=np.float32) for part in zip(*ticks, strict=True))
        observations, actions, rewards, ends, truncated = stacked
        return [observations, np.stack(states), actions, rewards, ends, final, truncated]


class PPO(Learner):
    """A training from nothing.

    Everything random follows from the seed; torch sums otherwise on another number of threads.
    """

    STATE = (
        *("actor", "critic", "optimizer", "collectors", "num_timesteps"),
        *("_average", "_rate", "_draws"),
    )

    def __init__(
        self, collectors: WorkerGroup, config: PPOConfig, network: NetworkConfig, seed: int
    ) -> None:
        super().__init__(collectors)
        torch.manual_seed(seed)
        self.config = config
        self.actor = _mlp(self.task.observation.size, network.actor, 2)
        self.critic = _mlp(self.task.privileged_size, network.critic, 1)
        head = list(self.actor.parameters())[-2:]
        with torch.no_grad():
            head[0].mul_(0.01)
            head[1].zero_()
        self._parameters = [*self.actor.parameters(), *self.critic.parameters()]
        self.optimizer = torch.optim.Adam(self._parameters, lr=config.learning_rate, eps=1e-5)
        self._rate = config.learning_rate
        self._draws = torch.Generator().manual_seed(seed)
        self._average = copy.deepcopy(self.actor)

    def train_until(self, steps: int, callback: Callable[[], bool], log_interval: int) -> None:
        """Learn until so many control steps are done in all, or until the callback says no."""
        size = self.config.n_steps * self.count
        for _ in self._rollouts(size, steps, callback, log_interval):
            rollout = self._collect()
            self._train(rollout)
            self.logger.record("rollout/reward", float(rollout.rewards.mean()))

    def _collect(self) -> Rollout:
        config = self.config
        first, last = config.log_std
        std = math.exp(first + (last - first) * min(1.0, self.share / config.log_std_until))
        noise = torch.randn((config.n_steps, self.count, 2), generator=self._draws)
        parts = np.split(noise.numpy(), self.collectors.count, axis=1)
        collected = self._collect_all(self.actor, self.share, std, each=parts)
        return Rollout._make([*map(torch.from_numpy, collected), noise, torch.tensor(std)])

    def _train(self, rollout: Rollout) -> None:
        began, config = time.monotonic(), self.config
        states = rollout.states[:-1].flatten(0, 1)
        observations, actions = rollout.observations.flatten(0, 1), rollout.actions.flatten(0, 1)
        before = -0.5 * rollout.noise.square().sum(dim=-1).flatten()
        advantages, returns = (values.flatten() for values in self._advantages(rollout))
        advantages = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
        for group in self.optimizer.param_groups:
            group["lr"] = self._rate * max(0.1, self._left)
        moved = []
        epochs, size = range(config.n_epochs), len(actions)
        orders = (torch.randperm(size, generator=self._draws) for _ in epochs)
        for rows in (rows for order in orders for rows in torch.split(order, config.batch_size)):
            mean = self.actor(observations[rows])
            now = -0.5 * ((actions[rows] - mean) / rollout.std).square().sum(dim=-1)
            ratio = torch.exp(now - before[rows])
            clipped = ratio.clamp(1 - config.clip_range, 1 + config.clip_range)
            gain = torch.minimum(ratio * advantages[rows], clipped * advantages[rows]).mean()
            missed = (self.critic(states[rows])[:, 0] - returns[rows]).square().mean()
            outside = (mean.abs() - 1).clamp(min=0).square().mean()
            self.optimizer.zero_grad()
            (missed + _OUTSIDE * outside - gain).backward()
            nn.utils.clip_grad_norm_(self._parameters, 1.0)
            self.optimizer.step()
            moved.append(float((ratio.detach() - 1 - torch.log(ratio.detach())).mean()))
        with torch.no_grad():
            for mean, now in zip(self._average.parameters(), self.actor.parameters(), strict=True):
                mean.lerp_(now, 1 - _AVERAGED)
        divergence = float(np.mean(moved[-len(moved) // config.n_epochs :]))
        if divergence > 2 * config.target_kl:
            self._rate = max(self._rate / 1.5, _LEAST_RATE)
        elif divergence < config.target_kl / 2:
            self._rate = min(self._rate * 1.5, _MOST_RATE)
        self.logger.record("train/approx_kl", divergence)
        self.logger.record("train/learning_rate", self._rate)
        self.seconds["gradient steps"] += time.monotonic() - began

    @torch.no_grad()
    def _advantages(self, rollout: Rollout) -> tuple[torch.Tensor, torch.Tensor]:
        """Return generalised advantages and what the critic should have said, (ticks, n)."""
        config, alive = self.config, 1 - rollout.ended
        values = self.critic(rollout.states)[..., 0]
        after = values[1:] * alive
        ends = rollout.ended > 0
        after[ends] = self.critic(rollout.final[ends])[:, 0] * rollout.truncated[ends]
        errors = rollout.rewards + config.gamma * after - values[:-1]
        advantages, ahead = torch.empty_like(errors), torch.zeros_like(errors[0])
        for tick in reversed(range(len(errors))):
            ahead = errors[tick] + config.gamma * config.gae_lambda * alive[tick] * ahead
            advantages[tick] = ahead
        return advantages, advantages + values[:-1]

    def network(self) -> Actor:
        """Return the deterministic actor as it stands."""
        return DenseActor(*self._average)


def _mlp(inputs: int, hidden: tuple[int, ...], outputs: int) -> nn.Sequential:
    return nn.Sequential(*create_mlp(inputs, outputs, list(hidden), nn.ELU))
