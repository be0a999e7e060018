"""Soft actor-critic that goes on from a policy file, on transitions that others gathered.

The actor is the policy: same layers, same weights. A policy by PPO clips its output, SAC squashes
by tanh; the mean here is the inverse tanh of the clipped output, so that SAC's squash gives the
policy's action back. Where the output is clipped, a gradient passes that leads back inside.
Exploration keeps its size: entropy is not sought, the actor's noise is what the trials can bear.
"""

from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from torch import nn

from hopping_leg.arrays import Array
from hopping_leg.rl import checkpoint, onnx_export, resumable, sb3_policies
from hopping_leg.rl.finetune.replay import CRITIC_SIZE, EDGE, Transitions

_LOOKED_AT = 3000
"""Ticks on which it is told how much actions have changed, the newest, 15 s."""

_HALVINGS = 8
"""Shares of a step that are tried, each half of the one before."""

_ACTIVATIONS = {"relu": nn.ReLU, "tanh": nn.Tanh, "elu": nn.ELU}


@dataclass(frozen=True)
class SacConfig:
    """Numbers of SAC."""

    critic: tuple[int, ...] = (128, 128)
    """Hidden layers of the critics."""
    learning_rate: float = 5e-4
    """Learning rate of the critics."""
    actor_share: float = 0.1
    """The actor's learning rate over the critics'."""
    last_layer: bool = False
    """Whether the actor learns in its last layer alone."""
    change: float = 0.02
    """Root mean square by which learning from a trial may change the actor's actions, of full
    torque: critics that have heard little of the robot would lead it far astray."""
    batch_size: int = 256
    """Transitions per gradient step."""
    gamma: float = 0.99
    """Discount per tick: a horizon of half a second, about one hop."""
    tau: float = 0.005
    """Share by which the target critics follow the critics at each gradient step."""
    entropy: float = 1e-4
    """Worth of the actor's entropy, hardly any."""
    log_std: float = -3.8
    """Log standard deviation of gSDE's weights: as quiet as the recipe `fast` ends."""
    believed_share: float = 0.25
    """Share of a batch from the believed robot, once the real one has been heard of."""
    buffer_size: int = 150_000
    """Transitions of the real robot that are kept, the newest."""


class Learner:
    """SAC without an environment, which goes on from a policy's network.

    Transitions of the believed robot stay in its replay.
    """

    def __init__(
        self, network: onnx_export.Network, believed: Transitions, options: SacConfig, seed: int
    ) -> None:
        self.options, self._network = options, network
        size = believed.observation.shape[1]
        sizes = [len(bias) for _, bias in network.layers[:-1]]
        torch.manual_seed(seed)
        self.model = _Offline(
            sb3_policies.AsymmetricSACPolicy,
            None,
            learning_rate=options.learning_rate,
            buffer_size=options.buffer_size,
            batch_size=options.batch_size,
            tau=options.tau,
            gamma=options.gamma,
            ent_coef=options.entropy,
            target_entropy=-2.0,
            use_sde=True,
            replay_buffer_class=_Shared,
            policy_kwargs={
                "net_arch": {"pi": sizes, "qf": list(options.critic)},
                "activation_fn": _ACTIVATIONS[network.activation],
                "log_std_init": options.log_std,
                "clip_mean": 0.0,
                "actor_size": size - CRITIC_SIZE,
            },
            seed=seed,
            device="cpu",
            _init_setup_model=False,
        )
        self.model.begin(size, options.actor_share)
        buffer = self.model.replay_buffer
        buffer.believed = ReplayBuffer(
            max(len(believed.reward), 1), buffer.observation_space, buffer.action_space, "cpu"
        )
        _fill(buffer.believed, believed)
        buffer.share = options.believed_share
        self.set_actor(network)

    @property
    def spread(self) -> Array:
        """Standard deviation of gSDE's weights, (hidden, 2)."""
        with torch.no_grad():
            spread: Array = self.model.actor.get_std().double().numpy()
        return spread

    def keep(self, rows: Transitions) -> None:
        """Keep transitions of the real robot."""
        _fill(self.model.replay_buffer, rows)

    def learn(self, steps: int, seed: int, *, critics_only: bool = False) -> None:
        """Make gradient steps on batches drawn from numpy's global generator, which is seeded."""
        if steps < 1:
            return
        torch.manual_seed(seed)
        np.random.seed(seed)  # noqa: NPY002
        for name, weight in self.model.actor.named_parameters():
            frozen = name == "log_std" or (self.options.last_layer and "latent_pi" in name)
            weight.requires_grad_(not (critics_only or frozen))
        before = self._weights()
        self.model.train(steps, self.options.batch_size)
        if not critics_only:
            self._hold_back(before)

    def _weights(self) -> list[torch.Tensor]:
        return [weight.detach().clone() for weight in self.model.actor.parameters()]

    def _hold_back(self, before: list[torch.Tensor]) -> None:
        """Halve the actor's step until actions on the newest ticks have changed little enough."""
        real, actor = self.model.replay_buffer, self.model.actor
        buffer = real if real.size() else real.believed
        newest = (buffer.pos - 1 - np.arange(min(_LOOKED_AT, buffer.size()))) % buffer.buffer_size
        seen = torch.from_numpy(buffer.observations[newest, 0])
        learnt = self._weights()
        with torch.no_grad():
            self._set(before)
            acted = actor(seen, deterministic=True)
            for share in 0.5 ** np.arange(_HALVINGS):
                self._set([a + share * (b - a) for a, b in zip(before, learnt, strict=True)])
                moved = actor(seen, deterministic=True) - acted
                if moved.square().mean().sqrt() <= self.options.change:
                    return
            self._set(before)

    def _set(self, weights: list[torch.Tensor]) -> None:
        for weight, value in zip(self.model.actor.parameters(), weights, strict=True):
            weight.copy_(value)

    def network(self) -> onnx_export.Network:
        """Return the deterministic actor as it stands."""
        actor = self.model.actor
        layers = [m for m in [*actor.latent_pi, actor.mu[0]] if isinstance(m, nn.Linear)]
        with torch.no_grad():
            weights = [(m.weight.double().numpy().copy(), m.bias.double().numpy().copy())
                       for m in layers]  # fmt: skip
        return replace(self._network, layers=weights)

    def state(self) -> checkpoint.Tree:
        """Return networks and optimisers; transitions are others' to keep."""
        return resumable.learner_state(self.model)

    def restore(self, state: checkpoint.Tree) -> None:
        """Go on from a ``state``."""
        resumable.restore_learner(self.model, state)

    def set_actor(self, network: onnx_export.Network) -> None:
        """Let the actor go on from another network; the critics stay."""
        actor = self.model.actor
        linear = actor.mu[0] if isinstance(actor.mu, nn.Sequential) else actor.mu
        layers = [m for m in [*actor.latent_pi, linear] if isinstance(m, nn.Linear)]
        with torch.no_grad():
            for layer, (weight, bias) in zip(layers, network.layers, strict=True):
                layer.weight.copy_(torch.from_numpy(weight))
                layer.bias.copy_(torch.from_numpy(bias))
        squash = (
            nn.Hardtanh(-network.bound, network.bound) if network.squash == "tanh" else _Unclipped()
        )
        actor.mu = nn.Sequential(linear, squash)


class _Offline(SAC):  # type: ignore[misc]
    """SAC that is never given an environment."""

    def begin(self, size: int, actor_share: float) -> None:
        """Set up for observations of a size."""
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.n_envs, self._actor_share = 1, actor_share
        self._setup_model()
        self.set_logger(Logger(None, []))

    def _update_learning_rate(self, optimizers: Any) -> None:  # noqa: ANN401
        super()._update_learning_rate(optimizers)
        for group in self.actor.optimizer.param_groups:
            group["lr"] *= self._actor_share


class _Shared(ReplayBuffer):  # type: ignore[misc]
    """The real robot's transitions, some of each batch from the believed one's."""

    believed: ReplayBuffer | None = None
    share = 0.0

    def sample(self, batch_size: int, env: Any = None) -> ReplayBufferSamples:  # noqa: ANN401
        """Return a batch; all of it is the believed robot's until the real one was heard of."""
        own = round(batch_size * (1 - self.share)) if self.size() else 0
        if self.believed is None or own == batch_size:
            return super().sample(batch_size, env)
        other = self.believed.sample(batch_size - own, env)
        if own == 0:
            return other
        real = super().sample(own, env)
        pairs = zip(real, other, strict=True)
        joined = [None if a is None else torch.cat([a, b]) for a, b in pairs]
        return ReplayBufferSamples(*joined)


class _Unclip(torch.autograd.Function):
    """Inverse tanh of the clipped value; outside, only gradients that lead back inside pass."""

    @staticmethod
    def forward(ctx: Any, value: torch.Tensor) -> torch.Tensor:  # noqa: ANN401
        ctx.save_for_backward(value)
        return torch.atanh(value.clamp(-EDGE, EDGE))

    @staticmethod
    def backward(ctx: Any, gradient: torch.Tensor) -> torch.Tensor:  # noqa: ANN401
        (value,) = ctx.saved_tensors
        outward = ((value > EDGE) & (gradient < 0)) | ((value < -EDGE) & (gradient > 0))
        slope = 1 / (1 - value.clamp(-EDGE, EDGE).square())
        return torch.where(outward, torch.zeros_like(gradient), gradient * slope)


class _Unclipped(nn.Module):
    """What tanh turns into the clipped value."""

    def forward(self, value: torch.Tensor) -> torch.Tensor:
        """Return it."""
        unclipped: torch.Tensor = _Unclip.apply(value)  # type: ignore[no-untyped-call]
        return unclipped


def _fill(buffer: ReplayBuffer, rows: Transitions) -> None:
    """Add transitions at once, in the place of the oldest."""
    count = len(rows.reward)
    at = (buffer.pos + np.arange(count)) % buffer.buffer_size
    buffer.observations[at, 0], buffer.next_observations[at, 0] = rows.observation, rows.following
    buffer.actions[at, 0], buffer.rewards[at, 0] = rows.action, rows.reward
    buffer.dones[at, 0] = rows.done
    buffer.full = buffer.full or buffer.pos + count >= buffer.buffer_size
    buffer.pos = (buffer.pos + count) % buffer.buffer_size
