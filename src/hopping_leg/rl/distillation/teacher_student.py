"""A teacher that sees the true state, and a student that learns to act like it on measurements.

What a policy has to remember makes reinforcement learning slow; a teacher that sees the true state
has nothing to remember and learns in a few minutes. Then the student hops while the teacher says at
every tick what it would do (DAgger, Ross et al. 2011), which is regression and bears any memory.
"""

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from hopping_leg.arrays import Array, Array32, BoolArray, IntArray
from hopping_leg.controllers.observation_history import make_observation_history
from hopping_leg.envs import TaskConfig
from hopping_leg.envs.observation import (
    PRIVILEGED,
    PRIVILEGED_COMMAND,
    privileged_observation,
    sample_scaling,
)
from hopping_leg.rl import checkpoint, resumable, sb3_policies
from hopping_leg.rl.distillation.students import Student
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import Measurement, Simulator

_OUTLIER = 0.01
"""Error beyond which a hop counts no more, m: those after a new command miss by far."""

_FARTHEST = 0.2
"""Largest correction, of half the range of commands: it is of no use where hops cannot be as low or
high as the command."""


@dataclass(frozen=True)
class DaggerConfig:
    """Numbers of the student's learning."""

    buffer_size: int = 600_000
    """Ticks of its past from which it learns, the newest."""
    gradient_steps: int = 256
    """Gradient steps after every rollout."""
    batch_size: int = 1024
    """Ticks per gradient step."""
    knots: int = 8
    """Heights at which the teacher's command is corrected."""
    correction_rate: float = 0.1
    """Share of the recent hops' mean error that a rollout corrects."""


class CommandCorrection:
    """Correction of the teacher's command, so that the student's hops are as high as desired.

    A student sees less than its teacher and hops lower or higher on average; its error at a height
    is added up there, as an integral controller does. An observation shows the command ``offset``,
    m, as 0, scaled by ``gain``, 1/m; corrections are known at ``knots`` from -1 to 1 and linear in
    between.
    """

    def __init__(self, offset: float, gain: float, knots: int) -> None:
        self._offset, self._gain = offset, gain
        self._knots = torch.linspace(-1, 1, knots)
        self.values = torch.zeros(knots)
        """At the knots, of half the range of commands, (knots,)."""

    def correct(self, commands: Array, errors: Array, rate: float) -> None:
        """Correct a share of the mean error of recent hops, apex minus command, m."""
        if not len(errors):
            return
        seen = torch.from_numpy((commands - self._offset) * self._gain).float()
        shares = _shares(seen, self._knots)
        off = torch.from_numpy(errors.clip(-_OUTLIER, _OUTLIER) * self._gain).float()
        self.values -= rate * (shares.T @ off) / shares.sum(dim=0).clamp(min=1.0)
        self.values.clamp_(-_FARTHEST, _FARTHEST)

    def __call__(self, command: torch.Tensor) -> torch.Tensor:
        """Return the teacher's commands instead of those that are observed, (n,)."""
        return command + _shares(command, self._knots) @ self.values

    def of_heights(self, command: Array) -> Array:
        """Return corrected commands, m, (n,), of those that are desired."""
        seen = torch.from_numpy((command - self._offset) * self._gain).float()
        corrected: Array = self(seen).numpy() / self._gain + self._offset
        return corrected

    def state(self) -> checkpoint.Tree:
        """Return the corrections."""
        return {"values": self.values.numpy().copy()}

    def restore(self, state: checkpoint.Tree) -> None:
        """Go on from a ``state``."""
        self.values = torch.from_numpy(state["values"].copy())


def _shares(command: torch.Tensor, knots: torch.Tensor) -> torch.Tensor:
    """Return the weights of knots at commands, (n, knots); they add up to 1."""
    spacing = knots[1] - knots[0]
    distance = (command.clamp(-1, 1)[:, None] - knots).abs()
    return (1 - distance / spacing).clamp(min=0.0)


class TeacherStudentPolicy(sb3_policies.AsymmetricPolicy):
    """PPO policy whose actor is the teacher, with a student beside it.

    Observations are the ``measured`` entries that the student sees, then the true state, which the
    critic sees; behind them what a teacher would do if it is ``computed`` and does not learn.

    Attributes:
        student_learns: Whether the student acts and learns, rather than the teacher.
        mixing: Chance that the teacher acts for a learning student, leg by leg and tick by
            tick: at first the student would only show how to fall.
        begun: Tells whose episode began with this tick, (n,).
    """

    def __init__(
        self,
        *args: Any,  # noqa: ANN401
        measured: int,
        teacher_sees: Sequence[int],
        student: Callable[[], Any],
        computed: bool = False,
        **kwargs: Any,  # noqa: ANN401
    ) -> None:
        self.student_learns, self.mixing = False, 0.0
        self.measured, self._make_student, self._computed = measured, student, computed
        self.begun: Callable[[], BoolArray] = lambda: np.ones((), np.bool_)
        super().__init__(*args, actor_size=measured, actor_sees=list(teacher_sees), **kwargs)

    def _build_mlp_extractor(self) -> None:
        super()._build_mlp_extractor()
        self.mlp_extractor.student = self._make_student()

    @property
    def student(self) -> Student:
        """What learns from the teacher."""
        networks: Any = self.mlp_extractor
        student: Student = networks.student
        return student

    def student_action(self, observation: torch.Tensor) -> torch.Tensor:
        """Return what the student would do, unbounded, (n, 2)."""
        return self.student.act(observation, self.begun())

    def teacher_action(self, observation: torch.Tensor) -> torch.Tensor:
        """Return what the teacher would do, within -1 and 1, (n, 2)."""
        if self._computed:
            return observation[:, -2:]
        action: torch.Tensor = self.action_net(self.mlp_extractor.forward_actor(observation))
        return action.clamp(-1.0, 1.0)

    def forward(
        self, obs: torch.Tensor, deterministic: bool = False
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return actions, values and log-likelihoods, the latter two zero if the student learns."""
        if not self.student_learns:
            return super().forward(obs, deterministic)  # type: ignore[no-any-return]
        mixed = torch.rand(len(obs), 1) < self.mixing
        action = torch.where(mixed, self.teacher_action(obs), self.student_action(obs))
        nothing = torch.zeros(len(obs), 1)
        return action.clamp(-1.0, 1.0), nothing, nothing[:, 0]


class TeacherStudentPPO(resumable.ResumablePPO):
    """PPO while the teacher learns; regression on the teacher's actions while the student does.

    ``pace`` is the learning rate at a share of the training, 0 to 1, after the ``teacher_scores``
    so far, m, of which less is better.
    """

    def __init__(
        self,
        *args: Any,  # noqa: ANN401
        dagger: DaggerConfig,
        evaluate_teacher: Callable[[TeacherStudentPolicy], float],
        pace: Callable[[float, Sequence[float]], float],
        **kwargs: Any,  # noqa: ANN401
    ) -> None:
        self._dagger, self._evaluate_teacher = dagger, evaluate_teacher
        self.teacher_scores: list[float] = []
        self._best: dict[str, torch.Tensor] = {}
        kwargs["learning_rate"] = lambda left: pace(1 - left, self.teacher_scores)
        super().__init__(*args, **kwargs)
        task = self.env.task
        scaling = task.observation.scaling
        self._true_command = task.observation.size + PRIVILEGED_COMMAND
        self._correction = CommandCorrection(scaling.offset[-1], scaling.gain[-1], dagger.knots)
        self.policy.begun = lambda: self._last_episode_starts
        self.env.correct = self._correction.of_heights

    def evaluate_teacher(self) -> None:
        """Examine the teacher that has learnt; keep it if it is the best so far."""
        self.teacher_scores.append(self._evaluate_teacher(self.policy))
        self.logger.record("teacher/score_m", self.teacher_scores[-1])
        if self.teacher_scores[-1] == min(self.teacher_scores):
            self._best = {k: v.clone() for k, v in self.policy.state_dict().items()}

    def next_teacher(self) -> None:
        """Forget all that teacher, critic and optimiser have learnt."""
        self.policy._build(self.lr_schedule)

    def choose_teacher(self) -> None:
        """Let the best teacher go on to teach."""
        self.policy.load_state_dict(self._best)
        self._best = {}

    def train(self) -> None:
        """Learn from the rollout."""
        policy: TeacherStudentPolicy = self.policy
        if not policy.student_learns:
            super().train()
            return
        self._update_learning_rate(policy.optimizer)
        commands, errors = self.env.recent_hops
        self._correction.correct(commands, errors, self._dagger.correction_rate)
        buffer = self.rollout_buffer
        begun = buffer.episode_starts.astype(np.bool_)
        seen, known = shift_to_arrival(
            buffer.observations, begun, self.env.task.legs.command_delay_ticks, policy.measured
        )
        policy.student.add_rollout(seen, begun, known)
        losses = [self._dagger_step(policy) for _ in range(self._dagger.gradient_steps)]
        self._n_updates += self._dagger.gradient_steps
        self.logger.record("train/dagger_loss", sum(losses) / len(losses))

    def _dagger_step(self, policy: TeacherStudentPolicy) -> float:
        """Take one step towards what the teacher would do; return the loss."""
        loss = policy.student.loss(self._dagger.batch_size, self._wanted)
        policy.optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        policy.optimizer.step()
        return loss.item()

    def _wanted(self, seen: torch.Tensor) -> torch.Tensor:
        """Return what the teacher would do at the corrected command, (n, 2)."""
        shown, column = seen.clone(), self._true_command
        shown[:, column] = self._correction(seen[:, column])
        policy: TeacherStudentPolicy = self.policy
        with torch.no_grad():
            return policy.teacher_action(shown)

    def own_state(self) -> checkpoint.Tree:
        """Return what the student learns from, the teacher's correction, and the scores so far."""
        policy: TeacherStudentPolicy = self.policy
        return {
            "teacher_scores": list(self.teacher_scores),
            "best": {k: v.numpy().copy() for k, v in self._best.items()},
            "student": policy.student.state(),
            "aim": self._correction.state(),
        }

    def restore_own(self, state: checkpoint.Tree) -> None:
        """Go on from an ``own_state``."""
        policy: TeacherStudentPolicy = self.policy
        self.teacher_scores = list(state["teacher_scores"])
        self._best = {k: torch.from_numpy(v.copy()) for k, v in state["best"].items()}
        policy.student.restore(state["student"])
        self._correction.restore(state["aim"])


def shift_to_arrival(
    observations: Array32, begun: BoolArray, late: IntArray, first: int
) -> tuple[Array32, BoolArray]:
    """Show the teacher the state in which a late leg's action will have its effect.

    Seen in hindsight: what it would do there is what the student has to ask for before. Returns
    observations, (ticks, n, size), with true states, from entry ``first`` on, ``late`` ticks later,
    and whether those are known: not at the end of the rollout nor of an episode, (ticks, n).
    """
    if not late.any():
        return observations, np.ones(begun.shape, np.bool_)
    ticks, rows = np.arange(len(begun))[:, None], np.arange(len(late))
    then = np.minimum(ticks + late, len(begun) - 1)
    episode = begun.cumsum(axis=0)
    known = (ticks + late < len(begun)) & (episode[then, rows] == episode)
    shown = observations.copy()
    shown[..., first:] = observations[then, rows, first:]
    return shown, known


_LASTING = 0.8
"""Share of an error that is left after a tick: a policy that has misjudged the state goes on to."""


class Teacher:
    """Sees the true state of simulated legs, without noise or delay; its torques are disturbed.

    ``action_noise`` is the standard deviation of what is added to them, of the largest torque:
    errors as an imitator makes, which last for some ticks.
    """

    name = "true-state"

    def __init__(
        self,
        policy: TeacherStudentPolicy,
        robot: Robot,
        options: TaskConfig,
        action_noise: float = 0.0,
    ) -> None:
        self._policy, self._action_noise = policy, action_noise
        self._last_torque = last_torque(options)
        self._sample = sample_scaling(robot, options)
        self._torque = np.array(options.action_torque)
        self.command_range = options.command_bounds
        """Heights it was made for, m."""

    @property
    def digest(self) -> str:
        """First 16 hex digits of its weights' SHA-256."""
        weights = hashlib.sha256()
        for value in self._policy.state_dict().values():
            weights.update(value.numpy().tobytes())
        return weights.hexdigest()[:16]

    def watch(self, legs: Simulator) -> None:
        """Set the legs whose state it sees."""
        self._legs = legs

    def reset(self, count: int) -> None:
        """Forget its last action; the errors begin anew, the same ones every time."""
        self._last, self._error = np.zeros((count, 2)), np.zeros((count, 2))
        self._rng = np.random.default_rng(0)

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2)."""
        count = len(self._last)
        seen = np.zeros((count, self._policy.features_dim), np.float32)
        first = self._policy.measured
        seen[:, self._last_torque] = self._last
        state = seen[:, first : first + PRIVILEGED]
        privileged_observation(self._legs, measurement.command[:, 0], self._sample, out=state)
        with torch.no_grad():
            self._last = self._policy.teacher_action(torch.from_numpy(seen)).double().numpy()
        if self._action_noise > 0:
            spread = self._action_noise * math.sqrt(1 - _LASTING**2)
            self._error = _LASTING * self._error + spread * self._rng.normal(size=(count, 2))
            self._last = (self._last + self._error).clip(-1, 1)
        torque: Array = self._last * self._torque
        return torque

    def internals(self) -> dict[str, Array]:
        """Return nothing."""
        return {}


def last_torque(task: TaskConfig) -> list[int]:
    """Return where the torques of the last control step stand in an observation, if they do."""
    shapes = make_observation_history(task.observation, 1 / task.rate).shapes
    if "past_torque" not in shapes:
        return []
    before = list(shapes)[: list(shapes).index("past_torque")]
    first = sum(int(np.prod(shapes[name])) for name in before)
    return [first, first + 1]
