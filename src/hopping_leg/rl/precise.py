"""The precise recipe: one network from 0.7 s of joint samples to torques, taught by the true state.

What it takes to know the height is in the joints' past, in how long the last flight took and how
hard the last stance pushed. A teacher that is told the height learns by PPO, with nothing to
remember, and the policy learns from it what to do on measurements.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from torch import nn

from hopping_leg.controllers.observation_history import make_layout
from hopping_leg.envs import ApexRewardOptions, TaskConfig
from hopping_leg.envs.privileged_observation import PRIVILEGED
from hopping_leg.rl.actor import dense_network
from hopping_leg.rl.export import Network
from hopping_leg.rl.fast import FastRecipe, cosine
from hopping_leg.rl.imitation import Imitation
from hopping_leg.rl.judge import badness, every_centimetre, judge
from hopping_leg.rl.students import WindowStudent
from hopping_leg.rl.taught import TaughtPolicy, TaughtPPO
from hopping_leg.rl.teacher import Teacher
from hopping_leg.rl.vecenv import TaskVecEnv
from hopping_leg.robot.parameters import Robot

_FLIGHT = 0.1
"""What a lack of flight adds to an exam's score, m: a tenth of the time, 1 cm."""


@dataclass(frozen=True)
class PreciseRecipe(FastRecipe):
    """PPO for a teacher on the true state, then imitation on long, dated joint samples."""

    name: ClassVar[str] = "precise"

    task: TaskConfig = field(
        default_factory=lambda: replace(
            FastRecipe().task,
            observation="dated-long",
            command_range=(0.20, 0.46),
            command_skew=1.5,
            timestep=5e-4,
            randomize_from_start=False,
        )
    )
    reward: ApexRewardOptions = field(
        default_factory=lambda: ApexRewardOptions(
            width=(0.030, 0.006), energy=0.8, energy_beyond=0.05, jerk=0.5, effort=0.2
        )
    )
    """Apex reward of the teacher. The calmer it is, the better it can be imitated. Its energy gain
    ends where hops are too high: otherwise it learns one high hop for all commands, from which
    some never come back to the low ones."""
    epochs: int = 8
    """Passes over a rollout."""
    steps: int = 10_000_000
    """Control steps of experience in all, summed over the legs."""
    judge_every: int = 500_000
    """Control steps between two trials of the policy, for checkpoint selection."""
    judge_from: float = 0.7
    """Share of the training before which no snapshot is tried."""
    judge_commands: tuple[float, ...] = (0.225, 0.26, 0.295, 0.33, 0.365, 0.40, 0.435)
    """Heights of those trials, m."""
    teaching: float = 0.5
    """Share of the training in which teachers learn at most; in the rest the policy does."""
    teachers: int = 2
    """How many learn at most, one after the other; the best of them teaches."""
    exam_at: tuple[float, ...] = (1.0,)
    """Shares of its time after which each is examined, the last of them 1; the best exam counts."""
    passing: float = 0.007
    """Score in an exam with which a teacher needs neither more time nor a successor, m."""
    erring: float = 0.05
    """Errors of the torques in the exam, of the largest: about those that the policy will make."""
    student: tuple[int, ...] = (256, 128)
    """Hidden layers of the policy, tanh; ``actor`` are the teacher's."""
    imitation: Imitation = field(default_factory=Imitation)
    """How the policy learns from the teacher."""
    guided: float = 0.15
    """Share of the policy's learning over which the teacher acts ever less in its stead."""

    def make_model(self, env: TaskVecEnv, seed: int) -> TaughtPPO:
        """Build the teacher's PPO with the student beside it."""
        measured = env.task.observation.size
        state = range(measured, measured + PRIVILEGED)
        return TaughtPPO(
            TaughtPolicy,
            env,
            imitation=self.imitation,
            exam=lambda policy: self.examine(policy, env.task.robot, env.task.legs.threads),
            pace=self.pace,
            **self.ppo_options(seed),
            policy_kwargs={
                **self.network_options(),
                "measured": measured,
                "teacher_sees": [*state, *self.last_torque],
                "student": lambda: self.make_student(env),
            },
        )

    def make_student(self, env: TaskVecEnv) -> nn.Module:
        """Build the untrained student."""
        (size,) = env.observation_space.shape
        return WindowStudent(
            env.task.observation.size, size, list(self.student), self.imitation.memory, nn.Tanh
        )

    def make_teacher(self, policy: TaughtPolicy, robot: Robot, erring: float = 0.0) -> Teacher:
        """Return a policy's teacher as a controller.

        Args:
            policy: Whose teacher.
            robot: The leg that it learns on.
            erring: Errors of its torques, of the largest.
        """
        return Teacher(policy, robot, self.task, self.last_torque, erring)

    def examine(self, policy: TaughtPolicy, robot: Robot, threads: int = 1) -> float:
        """Score a policy's teacher where it does worst, m.

        Its torques err as the policy's will, at every centimetre between the lowest and the highest
        trial: a teacher may hop well, but know no way back from where it never errs to. One that
        is on the ground for more than half of the time is marked down, too: next to standing, the
        policy may fall into it.
        """
        commands = every_centimetre(self.judge_commands)
        teacher = self.make_teacher(policy, robot, self.erring)
        verdicts = judge(teacher, robot, commands, rate=self.task.rate, threads=threads)
        return max(badness(v) + _FLIGHT * max(0.0, 0.5 - v.flight_fraction) for v in verdicts)

    @property
    def last_torque(self) -> list[int]:
        """Where the torques of the last tick stand in an observation, if they do."""
        shapes = make_layout(self.task.observation, 1 / self.task.rate).shapes
        if "past_torque" not in shapes:
            return []
        before = list(shapes)[: list(shapes).index("past_torque")]
        first = sum(int(np.prod(shapes[name])) for name in before)
        return [first, first + 1]

    def rate(self, left: float) -> float:
        """Return the learning rate where no teacher passes before the last one."""
        return self.pace(1 - left, ())

    def pace(self, share: float, exams: Sequence[float]) -> float:
        """Return the learning rate; it falls along a cosine, for every teacher and again after.

        Args:
            share: Of the training that is done.
            exams: Scores so far, m.
        """
        until = self.taught_until(exams)
        if share < until:
            return self.learning_rate * cosine(1 - self._learnt(share)[1])
        return self.learning_rate * cosine((1 - share) / (1 - until))

    def taught_until(self, exams: Sequence[float]) -> float:
        """Return the share of the training with which the policy begins to learn.

        Args:
            exams: Scores so far, m; a teacher that passes gives away what is left of its time and
                that of the next ones.
        """
        if not self._passed(exams):
            return self.teaching
        before, last = divmod(len(exams) - 1, len(self.exam_at))
        return self.teaching * (before + self.exam_at[last]) / self.teachers

    def taught(self, share: float, exams: Sequence[float]) -> float:
        """Return the share of the policy's own learning that is done, negative before it."""
        until = self.taught_until(exams)
        return (share - until) / (1 - until)

    def anneal(self, model: Any, env: TaskVecEnv, share: float) -> None:  # noqa: ANN401
        """Sharpen the reward and quieten exploration for each teacher, then let the policy act.

        Where legs differ, they do so for the policy: a teacher that feels the true state is hardly
        the worse for not having met them.
        """
        due, learnt = self._due(share), self._learnt(share)[1]
        while len(model.exams) < due and not self._passed(model.exams):
            model.examine()
            number, more = divmod(len(model.exams), len(self.exam_at))
            if number == self.teachers or self._passed(model.exams):
                model.choose_teacher()
            elif not more:
                model.next_teacher()
        taught = self.taught(share, model.exams)
        super().anneal(model, env, learnt if taught < 0 else 1.0)
        model.policy.imitating = taught >= 0
        if draw := self.draw(taught):
            env.task.randomize(draw)
        model.policy.guidance = max(0.0, 1 - taught / self.guided)

    def _passed(self, exams: Sequence[float]) -> bool:
        return len(exams) > 0 and exams[-1] <= self.passing

    def _due(self, share: float) -> int:
        """Return how many exams have been due; a single teacher takes none."""
        if self.teachers == 1:
            return 0
        before, learnt = self._learnt(share)
        each = len(self.exam_at)
        return min(before * each + sum(learnt >= at for at in self.exam_at), self.teachers * each)

    def _learnt(self, share: float) -> tuple[int, float]:
        """Return how many teachers have had their time, and the share of it that the next one has.

        Whether one of them passed does not count here.
        """
        if share >= self.teaching:
            return self.teachers, 1.0
        learnt = self.teachers * share / self.teaching
        before = min(int(learnt), self.teachers - 1)
        return before, learnt - before

    def draw(self, taught: float) -> int:
        """Return which draw of differing legs hops, 0 for legs that are alike.

        Args:
            taught: Share of the policy's learning that is done, negative before it.
        """
        return int(taught >= 0)

    def promise(self, model: Any) -> float | None:  # noqa: ANN401
        """Return the first teacher's score in its last exam, m, once it has learnt."""
        taken = len(self.exam_at)
        return float(model.exams[taken - 1]) if len(model.exams) >= taken else None

    def findings(self, model: Any) -> dict[str, Any]:  # noqa: ANN401
        """Return how the teachers did in their exams."""
        return {"exam_scores_m": list(model.exams)} if model.exams else {}

    def network(self, model: Any, env: TaskVecEnv) -> Network:  # noqa: ANN401
        """Return the student as it stands."""
        student: WindowStudent = model.policy.student
        return dense_network([student.layers], env.task.observation, "clip")
