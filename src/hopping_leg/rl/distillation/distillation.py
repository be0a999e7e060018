"""How a teacher and its student learn one after the other.

What it takes to know the height is in the joints' past, in how long the last flight took and how
hard the last stance pushed. A teacher that is told the height learns by PPO, with nothing to
remember, and the student learns from it what to do on measurements.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from torch import nn

from hopping_leg.controllers.observation_history import make_observation_history
from hopping_leg.envs import TaskConfig, observation
from hopping_leg.errors import UsageError
from hopping_leg.rl.algorithms import NetworkConfig, PPOConfig, cosine
from hopping_leg.rl.distillation import adaptive_student, students, teacher_student
from hopping_leg.rl.onnx_export import Network
from hopping_leg.rl.policy_evaluation import command_score, evaluate_policy, every_centimetre
from hopping_leg.rl.sb3_env import TaskVecEnv
from hopping_leg.robot.parameters import Robot

_FLIGHT = 0.1
"""What a lack of flight adds to a teacher's score, m: a tenth of the time, 1 cm."""


class Stage(NamedTuple):
    """A part of the training."""

    name: str
    """Who learns."""
    until: float
    """Share of the training with which it ends at the latest."""
    must_score: float | None
    """Score with which it may end the stages of its kind early, m; None cannot end it."""


@dataclass(frozen=True)
class StudentConfig:
    """Network of the policy."""

    memory: Literal["window", "gru", "integrator"] = "window"
    """What it remembers: the samples that the observation shows; a gated recurrent unit's state; or
    a correction of the command, see ``AdaptiveStudent``."""
    hidden: tuple[int, ...] = (256, 128)
    """Hidden layers, tanh; the recurrent unit has none."""
    size: int = 128
    """Entries of the recurrent unit's memory."""
    error_hidden: tuple[int, ...] = (256, 128)
    """Hidden layers of the network that estimates the last hop's error, tanh."""


@dataclass(frozen=True)
class Distillation:
    """Teachers learn in turn on the true state; the best one's student learns on measurements."""

    teacher: Literal["ppo", "shooting"] = "ppo"
    """What teaches: policies that learn by PPO, or shooting, which need not learn."""
    teacher_share: float = 0.5
    """Share of the training in which teachers learn at most; in the rest the student does."""
    teachers: int = 2
    """How many learn at most, one after the other; the best of them teaches."""
    teacher_accept_score: float = 0.007
    """Score with which a teacher needs no successor, m."""
    teacher_action_noise: float = 0.05
    """Errors of the torques in its evaluation, of the largest: about those of the student."""
    student: StudentConfig = field(default_factory=StudentConfig)
    """The policy's network; ``network.actor`` is the teacher's."""
    dagger: teacher_student.DaggerConfig = field(default_factory=teacher_student.DaggerConfig)
    """How the student learns from the teacher."""
    integrator: adaptive_student.CommandIntegratorConfig = field(
        default_factory=adaptive_student.CommandIntegratorConfig
    )
    """The memory of the command's correction."""
    dagger_mixing_share: float = 0.15
    """Share of the student's learning over which the teacher acts ever less in its stead."""
    nominal_share: float = 0.0
    """Share of the student's learning in which all legs are the robot."""
    randomizations: int = 0
    """How often legs are randomized anew in the rest."""
    estimate_ramp: tuple[float, float] = (0.2, 0.6)
    """Shares of that rest between which ever more legs' corrections follow the estimated error
    rather than the true one."""

    @property
    def stages(self) -> list[Stage]:
        """The curriculum, in order."""
        if self.teacher == "shooting":
            return [Stage("student", 1.0, None)]
        each, accept = self.teacher_share / self.teachers, self.teacher_accept_score
        taught = [
            Stage(f"teacher {k + 1}", (k + 1) * each, accept if self.teachers > 1 else None)
            for k in range(self.teachers)
        ]
        until = self.teacher_share + self.nominal_share * (1 - self.teacher_share)
        nominal = [Stage("student, legs alike", until, None)] if self.nominal_share else []
        return [*taught, *nominal, Stage("student", 1.0, None)]

    def make_model(
        self,
        env: TaskVecEnv,
        ppo: PPOConfig,
        network: NetworkConfig,
        commands: Sequence[float],
        seed: int,
    ) -> teacher_student.TeacherStudentPPO:
        """Build the teacher's PPO with the student beside it.

        Teachers are evaluated between the lowest and the highest of the commands, m.
        """
        task = env.task
        measured = task.observation.size
        state = range(measured, measured + observation.PRIVILEGED)
        return teacher_student.TeacherStudentPPO(
            teacher_student.TeacherStudentPolicy,
            env,
            dagger=self.dagger,
            evaluate_teacher=lambda policy: self.evaluate_teacher(
                policy, task.robot, task.options, commands, task.legs.threads
            ),
            pace=lambda share, scores: self.pace(share, scores, ppo.learning_rate),
            **ppo.options(seed),
            policy_kwargs={
                **ppo.policy_options(network),
                "measured": measured,
                "teacher_sees": [*state, *teacher_student.last_torque(task.options)],
                "student": lambda: self.make_student(env),
                "computed": self.teacher == "shooting",
            },
        )

    def make_student(self, env: TaskVecEnv) -> nn.Module:
        """Build the untrained student; ``UsageError`` if it corrects one of several commands."""
        (size,) = env.observation_space.shape
        measured, task = env.task.observation.size, env.task.options
        config, room = self.student, self.dagger.buffer_size
        if config.memory == "gru":
            return students.RecurrentStudent(measured, config.size, room, env.num_envs)
        if config.memory == "window":
            return students.WindowStudent(measured, size, list(config.hidden), room, nn.Tanh)
        if make_observation_history(task.observation, 1 / task.rate).shapes["command"] != (1,):
            raise UsageError(
                "A student with an integrator corrects its command and needs an observation with a"
                f" single one, not '{task.observation}'; choose --observation dated-long."
            )
        places = adaptive_student.Places(
            measured=measured,
            size=size,
            command=measured - 1,
            true_height=measured + observation.PRIVILEGED_HEIGHT,
            true_command=measured + observation.PRIVILEGED_COMMAND,
            true_clearance=measured + observation.PRIVILEGED_CLEARANCE,
        )
        return adaptive_student.AdaptiveStudent(
            places, list(config.hidden), list(config.error_hidden), room, env.num_envs,
            1 / task.rate, self.integrator,
        )  # fmt: skip

    def evaluate_teacher(
        self,
        policy: teacher_student.TeacherStudentPolicy,
        robot: Robot,
        task: TaskConfig,
        commands: Sequence[float],
        threads: int = 1,
    ) -> float:
        """Score a policy's teacher where it does worst, m.

        Its torques err as the student's will, at every centimetre between the lowest and the
        highest command: a teacher may hop well, but know no way back from where it never errs to.
        One that is on the ground for more than half of the time is marked down, too: next to
        standing, the student may fall into it.
        """
        teacher = teacher_student.Teacher(policy, robot, task, self.teacher_action_noise)
        heights = every_centimetre(commands)
        results = evaluate_policy(teacher, robot, heights, rate=task.rate, threads=threads)
        return max(command_score(v) + _FLIGHT * max(0.0, 0.5 - v.flight_fraction) for v in results)

    def pace(self, share: float, scores: Sequence[float], rate: float) -> float:
        """Return the learning rate; it falls along a cosine, for every teacher and again after."""
        until = self.student_from(scores)
        if share < until:
            return rate * cosine(1 - self._learnt(share)[1])
        return rate * cosine((1 - share) / (1 - until))

    def student_from(self, scores: Sequence[float]) -> float:
        """Return the share of the training with which the student begins to learn.

        A teacher whose score, m, is accepted gives away the time of those after it.
        """
        if self.teacher == "shooting":
            return 0.0
        if not self._accepted(scores):
            return self.teacher_share
        return self.teacher_share * len(scores) / self.teachers

    def student_progress(self, share: float, scores: Sequence[float]) -> float:
        """Return the share of the student's own learning that is done, negative before it."""
        until = self.student_from(scores)
        return (share - until) / (1 - until)

    def anneal(self, model: Any, env: TaskVecEnv, share: float, ppo: PPOConfig) -> None:  # noqa: ANN401
        """Sharpen the reward and quieten exploration for each teacher, then let the student act.

        Where legs differ, they do so for the student: a teacher that sees the true state is hardly
        the worse for not having met them.
        """
        due, learnt = self._due(share), self._learnt(share)[1]
        while len(model.teacher_scores) < due and not self._accepted(model.teacher_scores):
            model.evaluate_teacher()
            if len(model.teacher_scores) == self.teachers or self._accepted(model.teacher_scores):
                model.choose_teacher()
            else:
                model.next_teacher()
        progress = self.student_progress(share, model.teacher_scores)
        env.task.reward.anneal(learnt if progress < 0 else 1.0)
        ppo.anneal(model, learnt if progress < 0 else 1.0)
        model.policy.student_learns = progress >= 0
        if number := self.randomization(progress):
            env.task.randomize(number)
        model.policy.mixing = max(0.0, 1 - progress / self.dagger_mixing_share)
        if self.student.memory == "integrator":
            first, last = self.estimate_ramp
            ramp = (self._randomized_progress(progress) - first) / (last - first)
            model.policy.student.estimate_share = min(1.0, max(0.0, ramp))

    def randomization(self, progress: float) -> int:
        """Return the number of the randomization at a share of the student's learning, 0 before."""
        if progress < self.nominal_share:
            return 0
        return 1 + int(self.randomizations * self._randomized_progress(progress))

    def early_score(self, model: Any) -> float | None:  # noqa: ANN401
        """Return the first teacher's score, m, once it has learnt."""
        return float(model.teacher_scores[0]) if model.teacher_scores else None

    def extra_results(self, model: Any) -> dict[str, Any]:  # noqa: ANN401
        """Return the curriculum and how the teachers scored."""
        scores = list(model.teacher_scores)
        curriculum = {"curriculum": [stage._asdict() for stage in self.stages]}
        return curriculum | ({"teacher_scores_m": scores} if scores else {})

    def network(self, model: Any, env: TaskVecEnv) -> Network:  # noqa: ANN401
        """Return the student as it stands."""
        network: Network = model.policy.student.network(env.task.observation)
        return network

    def _accepted(self, scores: Sequence[float]) -> bool:
        return len(scores) > 0 and scores[-1] <= self.teacher_accept_score

    def _due(self, share: float) -> int:
        """Return how many evaluations have been due; a single teacher takes none."""
        if self.teachers == 1 or self.teacher == "shooting":
            return 0
        before, learnt = self._learnt(share)
        return min(before + (learnt >= 1.0), self.teachers)

    def _learnt(self, share: float) -> tuple[int, float]:
        """Return how many teachers have had their time, and the next one's share of it."""
        if share >= self.teacher_share or self.teacher == "shooting":
            return self.teachers, 1.0
        learnt = self.teachers * share / self.teacher_share
        before = min(int(learnt), self.teachers - 1)
        return before, learnt - before

    def _randomized_progress(self, progress: float) -> float:
        """Return the share of the learning on randomized legs that is done, negative before it."""
        return (progress - self.nominal_share) / (1 - self.nominal_share)
