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
from hopping_leg.envs import ApexRewardConfig, TaskConfig
from hopping_leg.envs.observation import PRIVILEGED
from hopping_leg.rl.actor import dense_network
from hopping_leg.rl.distillation.dagger import DaggerConfig
from hopping_leg.rl.distillation.students import WindowStudent
from hopping_leg.rl.distillation.teacher import Teacher
from hopping_leg.rl.distillation.teacher_student import TeacherStudentPolicy, TeacherStudentPPO
from hopping_leg.rl.onnx_export import Network
from hopping_leg.rl.policy_evaluation import command_score, evaluate_policy, every_centimetre
from hopping_leg.rl.recipes.fast import FastRecipe, cosine
from hopping_leg.rl.sb3_env import TaskVecEnv
from hopping_leg.robot.parameters import Robot

_FLIGHT = 0.1
"""What a lack of flight adds to a teacher's score, m: a tenth of the time, 1 cm."""


@dataclass(frozen=True)
class PreciseRecipe(FastRecipe):
    """PPO for a teacher on the true state, then distillation on long, dated joint samples."""

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
    reward: ApexRewardConfig = field(
        default_factory=lambda: ApexRewardConfig(
            width=(0.030, 0.006), energy=0.8, energy_beyond=0.05, jerk=0.5, effort=0.2
        )
    )
    """Apex reward of the teacher. The calmer it is, the better it can be imitated. Its energy gain
    ends where hops are too high: otherwise it learns one high hop for all commands, from which
    some never come back to the low ones."""
    n_epochs: int = 8
    """Passes over a rollout."""
    steps: int = 10_000_000
    """Control steps of experience in all, summed over the legs."""
    eval_every: int = 500_000
    """Control steps between two trials of the policy, for checkpoint selection."""
    eval_start: float = 0.7
    """Share of the training before which no snapshot is tried."""
    eval_commands: tuple[float, ...] = (0.225, 0.26, 0.295, 0.33, 0.365, 0.40, 0.435)
    """Heights of those trials, m."""
    teacher_share: float = 0.5
    """Share of the training in which teachers learn at most; in the rest the policy does."""
    teachers: int = 2
    """How many learn at most, one after the other; the best of them teaches."""
    exam_at: tuple[float, ...] = (1.0,)
    """Shares of its time after which each is evaluated, the last 1; the best one counts."""
    teacher_accept_score: float = 0.007
    """Score with which a teacher needs neither more time nor a successor, m."""
    teacher_action_noise: float = 0.05
    """Errors of the torques in its evaluation, of the largest: about those of the policy."""
    student: tuple[int, ...] = (256, 128)
    """Hidden layers of the policy, tanh; ``actor`` are the teacher's."""
    dagger: DaggerConfig = field(default_factory=DaggerConfig)
    """How the policy learns from the teacher."""
    dagger_mixing_share: float = 0.15
    """Share of the policy's learning over which the teacher acts ever less in its stead."""

    def make_model(self, env: TaskVecEnv, seed: int) -> TeacherStudentPPO:
        """Build the teacher's PPO with the student beside it."""
        measured = env.task.observation.size
        state = range(measured, measured + PRIVILEGED)
        return TeacherStudentPPO(
            TeacherStudentPolicy,
            env,
            dagger=self.dagger,
            evaluate_teacher=lambda policy: self.evaluate_teacher(
                policy, env.task.robot, env.task.legs.threads
            ),
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
            env.task.observation.size, size, list(self.student), self.dagger.buffer_size, nn.Tanh
        )

    def make_teacher(
        self, policy: TeacherStudentPolicy, robot: Robot, teacher_action_noise: float = 0.0
    ) -> Teacher:
        """Return a policy's teacher as a controller.

        Args:
            policy: Whose teacher.
            robot: The leg that it learns on.
            teacher_action_noise: Errors of its torques, of the largest.
        """
        return Teacher(policy, robot, self.task, self.last_torque, teacher_action_noise)

    def evaluate_teacher(
        self, policy: TeacherStudentPolicy, robot: Robot, threads: int = 1
    ) -> float:
        """Score a policy's teacher where it does worst, m.

        Its torques err as the policy's will, at every centimetre between the lowest and the highest
        trial: a teacher may hop well, but know no way back from where it never errs to. One that
        is on the ground for more than half of the time is marked down, too: next to standing, the
        policy may fall into it.
        """
        commands = every_centimetre(self.eval_commands)
        teacher = self.make_teacher(policy, robot, self.teacher_action_noise)
        results = evaluate_policy(teacher, robot, commands, rate=self.task.rate, threads=threads)
        return max(command_score(v) + _FLIGHT * max(0.0, 0.5 - v.flight_fraction) for v in results)

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

    def pace(self, share: float, teacher_scores: Sequence[float]) -> float:
        """Return the learning rate; it falls along a cosine, for every teacher and again after.

        Args:
            share: Of the training that is done.
            teacher_scores: Scores so far, m.
        """
        until = self.student_from(teacher_scores)
        if share < until:
            return self.learning_rate * cosine(1 - self._learnt(share)[1])
        return self.learning_rate * cosine((1 - share) / (1 - until))

    def student_from(self, teacher_scores: Sequence[float]) -> float:
        """Return the share of the training with which the policy begins to learn.

        Args:
            teacher_scores: Scores so far, m; a teacher that passes gives away the rest of its time
                and that of the next ones.
        """
        if not self._passed(teacher_scores):
            return self.teacher_share
        before, last = divmod(len(teacher_scores) - 1, len(self.exam_at))
        return self.teacher_share * (before + self.exam_at[last]) / self.teachers

    def student_progress(self, share: float, teacher_scores: Sequence[float]) -> float:
        """Return the share of the policy's own learning that is done, negative before it."""
        until = self.student_from(teacher_scores)
        return (share - until) / (1 - until)

    def anneal(self, model: Any, env: TaskVecEnv, share: float) -> None:  # noqa: ANN401
        """Sharpen the reward and quieten exploration for each teacher, then let the policy act.

        Where legs differ, they do so for the policy: a teacher that feels the true state is hardly
        the worse for not having met them.
        """
        due, learnt = self._due(share), self._learnt(share)[1]
        while len(model.teacher_scores) < due and not self._passed(model.teacher_scores):
            model.evaluate_teacher()
            number, more = divmod(len(model.teacher_scores), len(self.exam_at))
            if number == self.teachers or self._passed(model.teacher_scores):
                model.choose_teacher()
            elif not more:
                model.next_teacher()
        student_progress = self.student_progress(share, model.teacher_scores)
        super().anneal(model, env, learnt if student_progress < 0 else 1.0)
        model.policy.student_learns = student_progress >= 0
        if draw := self.draw(student_progress):
            env.task.randomize(draw)
        model.policy.mixing = max(0.0, 1 - student_progress / self.dagger_mixing_share)

    def _passed(self, teacher_scores: Sequence[float]) -> bool:
        return len(teacher_scores) > 0 and teacher_scores[-1] <= self.teacher_accept_score

    def _due(self, share: float) -> int:
        """Return how many evaluations have been due; a single teacher takes none."""
        if self.teachers == 1:
            return 0
        before, learnt = self._learnt(share)
        each = len(self.exam_at)
        return min(before * each + sum(learnt >= at for at in self.exam_at), self.teachers * each)

    def _learnt(self, share: float) -> tuple[int, float]:
        """Return how many teachers have had their time, and the share of it that the next one has.

        Whether one of them passed does not count here.
        """
        if share >= self.teacher_share:
            return self.teachers, 1.0
        learnt = self.teachers * share / self.teacher_share
        before = min(int(learnt), self.teachers - 1)
        return before, learnt - before

    def draw(self, student_progress: float) -> int:
        """Return which draw of differing legs hops, 0 for legs that are alike.

        Args:
            student_progress: Share of the policy's learning that is done, negative before it.
        """
        return int(student_progress >= 0)

    def early_score(self, model: Any) -> float | None:  # noqa: ANN401
        """Return the first teacher's last score, m, once it has learnt."""
        taken = len(self.exam_at)
        return (
            float(model.teacher_scores[taken - 1]) if len(model.teacher_scores) >= taken else None
        )

    def extra_results(self, model: Any) -> dict[str, Any]:  # noqa: ANN401
        """Return how the teachers did."""
        return {"teacher_scores_m": list(model.teacher_scores)} if model.teacher_scores else {}

    def network(self, model: Any, env: TaskVecEnv) -> Network:  # noqa: ANN401
        """Return the student as it stands."""
        student: WindowStudent = model.policy.student
        return dense_network([student.layers], env.task.observation, "clip")
