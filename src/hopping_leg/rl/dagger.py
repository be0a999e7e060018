"""Distillation: a student hops while a teacher says what it would do (DAgger, Ross et al. 2011).

What a policy has to remember makes reinforcement learning slow. A teacher that sees the true state
has nothing to remember, and imitating it is regression, which bears any memory. The student
collects the states, so that it learns the way back from its own errors; at first the teacher acts
in its stead now and then. A rollout and the gradient steps on those before it run side by side.
"""

import copy
import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from torch.nn import functional

from hopping_leg.arrays import Array, Array32, BoolArray, Stateful
from hopping_leg.controllers import robot_numbers
from hopping_leg.controllers.mpc import HopShape, Planning, TrueStateMpc
from hopping_leg.envs.hidden_state import HiddenState
from hopping_leg.envs.task import HoppingTask, Step
from hopping_leg.rl.learner import Learner, MakeTask
from hopping_leg.rl.students import LabelledRollout, RolloutBuffer, Student, StudentConfig
from hopping_leg.robot import GRAVITY
from hopping_leg.workers import WorkerGroup

_PUSHED, _PUSHES = 0.15, 0.5
"""Share of the environments that push the base, and how often these do, 1/s."""

_HELD_SECONDS = (0.2, 1.5)
_HELD_STIFFNESS, _HELD_DAMPING = 2.0, 0.05
"""Of the stiff legs' joint PD: actions per rad and rad/s."""


@dataclass(frozen=True)
class DaggerConfig:
    """Numbers of a distillation."""

    learning_rate: float = 1e-3
    """Learning rate of Adam at the start; falls along a cosine to a fiftieth."""
    n_steps: int = 64
    """Control steps of a rollout, each environment."""
    buffer_size: int = 1_300_000
    """Control steps from which the student learns, the newest."""
    gradient_steps: int = 16
    """Gradient steps per rollout."""
    batch_size: int = 4096
    """Control steps per gradient step."""
    mixing_share: float = 0.15
    """Share of the training over which the teacher acts ever less in the student's stead."""
    headroom: float = 0.01
    """How far training goes beyond the highest command, m: calibrated commands may lie there."""
    push_weight: float = 1.0
    """How much a control period counts in which the leg pushes, over others."""
    fold_weight: float = 1.0
    """How much one counts in which it has to fold on the ground: to hop from rest, to leave it."""
    held_share: float = 0.0
    """Share of episodes that begin with a stiff leg for a while, so that it stands still."""
    impulse: float = 0.0
    """Largest impulse on the base, up or down, in a control period now and then, over the leg's
    mass times sqrt(g L); some of the environments have them."""
    outlier: float = 0.0
    """Difference of actions beyond which the loss grows linearly (Huber); 0 for none."""
    hidden_weight: float = 0.0
    """How much guesses of what cannot be seen count, over actions; only on legs that differ."""
    teacher: HopShape = field(default_factory=HopShape)
    """What the hops of the teacher, `mpc-true-state`, are like."""
    planning: Planning = field(default_factory=Planning)
    """How the teacher simulates hops."""

    def make_teacher(self, task: HoppingTask) -> TrueStateMpc:
        """Build the teacher."""
        return TrueStateMpc(task.robot, self.teacher, self.planning, rate=task.options.rate)


class LabelCollector(Stateful):
    """Collects rollouts with what the teacher would have done."""

    STATE = (
        *("task", "teacher", "hidden", "_mixing"),
        *("_seen", "_begun", "_held", "_posture", "_memory", "_label"),
    )

    def __init__(self, make_task: MakeTask, config: DaggerConfig, seed: int, number: int) -> None:
        self.task, self.config = make_task(), config
        task = self.task
        self.hidden = HiddenState(task.legs, task.believed) if config.hidden_weight else None
        self.teacher = config.make_teacher(task)
        self.teacher.watch(task.legs)
        self._mixing = np.random.default_rng([seed, 1, number])
        self._most_force: Array | None = None
        """Largest force on each base, N, (n,), 0 for most; None where none is pushed."""
        if config.impulse:
            legs = [leg.true for leg in task.task_legs] or [task.robot]
            lengths = map(robot_numbers.leg_length, legs)
            momentum = [r.mass * math.sqrt(GRAVITY * n) for r, n in zip(legs, lengths, strict=True)]
            pushed = self._mixing.random(task.count) < _PUSHED
            most = np.array(momentum) * config.impulse * task.options.rate
            self._most_force = np.where(pushed, most, 0.0)
        self._seen: Any = task.reset()
        self.teacher.reset(task.count)
        self._begun: BoolArray = np.ones(task.count, np.bool_)
        self._held, self._posture = np.zeros(task.count), np.zeros((task.count, 2))
        self._memory: Array32 = np.zeros((task.count, 0), np.float32)
        self._label = self._teach()

    def collect(self, actor: Student, share: float) -> LabelledRollout:
        """Let the student act, and the teacher by what share of the training is done."""
        if not self._memory.size:
            self._memory = np.zeros((self.task.count, actor.memory_size), np.float32)
        memory, helped = self._memory[None], 1 - share / self.config.mixing_share
        ticks = [self._step(actor, helped) for _ in range(self.config.n_steps)]
        return LabelledRollout._make([*map(np.stack, zip(*ticks, strict=True)), memory])

    def _step(self, actor: Student, helped: float) -> tuple[Any, ...]:
        seen, label, begun, config = self._seen, self._label, self._begun, self.config
        pushing = np.where(self.teacher.pushing, config.push_weight, 1.0)
        weight = np.where(self.teacher.folding, config.fold_weight, pushing)
        hidden = self.hidden.view() if self.hidden else np.empty((len(begun), 0), np.float32)
        memory = torch.from_numpy(self._memory * ~begun[:, None])
        with torch.no_grad():
            action, remembered = actor(torch.from_numpy(seen), memory)
        # Leg by leg and tick by tick the teacher acts for the student, ever less often.
        taught = self._mixing.random(len(begun)) < helped
        step = self._act(np.where(taught[:, None], label, action.numpy()))
        if self.hidden:
            self.hidden.update(step.apex_error, step.terminated | step.truncated)
        self._memory = remembered.numpy()
        self._seen, self._begun = step.observation, step.terminated | step.truncated
        self._label = self._teach()
        return seen, label, weight.astype(np.float32), hidden, begun

    def _act(self, action: Array) -> Step:
        """Act for a control period, in which some legs are held and some bases are pushed."""
        task, most = self.task, self._most_force
        if most is None:
            return task.step(self._hold(action))
        now = self._mixing.random(task.count) < _PUSHES / task.options.rate
        task.legs.push(most * self._mixing.uniform(-1, 1, task.count) * now)
        step = task.step(self._hold(action))
        task.legs.push(np.zeros(task.count))
        return step

    def _hold(self, action: Array) -> Array:
        """Return what is commanded: at the start of some episodes, the posture that they have."""
        if not self.config.held_share:
            return action
        legs, begun = self.task.legs, self._begun
        seconds = self._mixing.uniform(*_HELD_SECONDS, len(begun))
        chosen = self._mixing.random(len(begun)) < self.config.held_share
        until = np.where(chosen, np.rint(seconds * self.task.options.rate), 0)
        self._held = np.where(begun, until, np.maximum(self._held - 1, 0))
        self._posture[begun] = legs.q[begun]
        stiff = _HELD_STIFFNESS * (self._posture - legs.q) - _HELD_DAMPING * legs.qd
        return np.where(self._held[:, None] > 0, stiff.clip(-1, 1), action)

    def _teach(self) -> Any:  # noqa: ANN401
        torque = self.teacher.torque(self.task.command)
        return (torque / self.task.full_torque).clip(-1, 1).astype(np.float32)


class Dagger(Learner):
    """A distillation; rollouts and gradient steps run side by side.

    Everything random follows from the seed, on any number of cores.
    """

    STATE = ("student", "optimizer", "collectors", "num_timesteps", "_buffer", "_draws")

    def __init__(
        self, collectors: WorkerGroup, config: DaggerConfig, network: StudentConfig, seed: int
    ) -> None:
        super().__init__(collectors)
        torch.manual_seed(seed)
        self.config, seen = config, self.task.observation
        unseen = collectors.here[0].hidden.size if config.hidden_weight else 0
        self.student = network.make(seen, unseen)
        self.optimizer = torch.optim.Adam(self.student.parameters(), lr=config.learning_rate)
        self._actor: Student = copy.deepcopy(self.student)
        self._actor.correction = 0.0
        kept = config.buffer_size // (config.n_steps * self.count)
        self._buffer = RolloutBuffer(
            kept, config.n_steps, self.count, seen.size, self.student.memory_size, unseen
        )
        self._draws = torch.Generator().manual_seed(seed)

    def train_until(self, steps: int, callback: Callable[[], bool], log_interval: int) -> None:
        """Learn until so many control steps are done in all, or until the callback says no."""
        size = self.config.n_steps * self.count
        with ThreadPoolExecutor(1, thread_name_prefix="rollout") as beside:
            for _ in self._rollouts(size, steps, callback, log_interval):
                self._actor.load_state_dict(self.student.state_dict())
                rollout = beside.submit(self._collect_all, self._actor, self.share)
                self._train()
                self._buffer.add(LabelledRollout(*rollout.result()))

    def _train(self) -> None:
        if not self._buffer.added:
            return
        began = time.monotonic()
        cosine = (1 + math.cos(math.pi * (1 - self._left))) / 2  # falls from 1 to 0
        for group in self.optimizer.param_groups:
            group["lr"] = self.config.learning_rate * (0.02 + 0.98 * cosine)
        losses = [self._gradient_step() for _ in range(self.config.gradient_steps)]
        self.logger.record("train/loss", float(np.mean(losses)))
        self.seconds["gradient steps"] += time.monotonic() - began

    def _gradient_step(self) -> float:
        """Learn from some ticks; return how far actions, and guesses, were off."""
        config = self.config
        batch, actions, guesses = self.student.recall(self._buffer, config.batch_size, self._draws)
        if config.outlier:
            off = functional.huber_loss(
                actions, batch.labels, reduction="none", delta=config.outlier
            )
        else:
            off = functional.mse_loss(actions, batch.labels, reduction="none")
        loss = (off.mean(dim=-1) * batch.weights).sum() / batch.weights.sum()
        if config.hidden_weight:
            known = (batch.weights > 0)[..., None]
            missed = functional.mse_loss(guesses * known, batch.hidden * known)
            loss = loss + config.hidden_weight * missed
        self.optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.student.parameters(), 1.0)
        self.optimizer.step()
        return loss.item()

    def network(self) -> Student:
        """Return the student as it stands."""
        return self.student
