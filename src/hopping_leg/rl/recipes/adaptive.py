"""The adaptive recipe: the precise one on legs that differ, with a memory of where to aim.

What it costs in precision on the very leg that was believed, and what it gains on others, is on the
documentation's page about robustness.
"""

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from torch import nn

from hopping_leg.controllers.observation_history import make_layout
from hopping_leg.envs import TaskConfig
from hopping_leg.envs.observation import (
    PRIVILEGED_CLEARANCE,
    PRIVILEGED_COMMAND,
    PRIVILEGED_HEIGHT,
)
from hopping_leg.errors import UsageError
from hopping_leg.rl.actor import adaptive_network
from hopping_leg.rl.distillation.adaptive_student import (
    AdaptiveStudent,
    CommandIntegratorConfig,
    Places,
)
from hopping_leg.rl.onnx_export import Network
from hopping_leg.rl.recipes.precise import PreciseRecipe
from hopping_leg.rl.sb3_env import TaskVecEnv
from hopping_leg.sim.randomization import WIDE_RANGES


@dataclass(frozen=True)
class AdaptiveRecipe(PreciseRecipe):
    """The precise recipe for a policy that feels its errors and meets many different legs."""

    name: ClassVar[str] = "adaptive"

    task: TaskConfig = field(
        default_factory=lambda: replace(
            PreciseRecipe().task,
            command_range=(0.20, 0.42),
            command_skew=1.0,
            randomised=WIDE_RANGES,
            randomize_probability=0.5,
            nominal_fraction=0.5,
        )
    )
    """The learning problem; wider ranges of commands were not tried."""
    eval_commands: tuple[float, ...] = (0.22, 0.25, 0.28, 0.31, 0.34, 0.37, 0.40)
    """Heights of the trials, m."""
    command_integrator: CommandIntegratorConfig = field(default_factory=CommandIntegratorConfig)
    """Numbers of the memory."""
    feeling: tuple[int, ...] = (256, 128)
    """Hidden layers of the network that feels how far the last hop was off, tanh."""
    steps: int = 12_000_000
    """Control steps of experience in all, summed over the legs."""
    teacher_share: float = 0.4
    """Share of the training in which the teacher learns; in the rest the policy does."""
    n_epochs: int = 4
    """Passes over a rollout; more were not tried here."""
    teachers: int = 1
    """Choosing among several was not tried here."""
    alike: float = 0.35
    """Share of the policy's learning in which legs are alike."""
    draws: int = 40
    """How often legs change into others in the rest."""
    trusting: tuple[float, float] = (0.2, 0.6)
    """Shares of that rest between which ever more legs' aims follow what is felt rather than the
    truth."""

    def make_student(self, env: TaskVecEnv) -> nn.Module:
        """Build the untrained student.

        Raises:
            UsageError: The observation shows more than one command.
        """
        seen = self.task.observation
        if make_layout(seen, 1 / self.task.rate).shapes["command"] != (1,):
            raise UsageError(
                f"Recipe '{self.name}' tells its network another command than the one it is given"
                f" and needs an observation with a single one, not '{seen}'; choose"
                " --observation dated-long."
            )
        (size,) = env.observation_space.shape
        measured = env.task.observation.size
        places = Places(
            measured=measured,
            size=size,
            command=measured - 1,
            true_height=measured + PRIVILEGED_HEIGHT,
            true_command=measured + PRIVILEGED_COMMAND,
            true_clearance=measured + PRIVILEGED_CLEARANCE,
        )
        return AdaptiveStudent(
            places, list(self.student), list(self.feeling), self.dagger.buffer_size, env.num_envs,
            1 / self.task.rate, self.command_integrator,
        )  # fmt: skip

    def anneal(self, model: Any, env: TaskVecEnv, share: float) -> None:  # noqa: ANN401
        """Let legs differ once the policy can act, and their aims follow what it feels."""
        super().anneal(model, env, share)
        apart = self._apart(self.student_progress(share, model.teacher_scores))
        first, last = self.trusting
        model.policy.student.trust = min(1.0, max(0.0, (apart - first) / (last - first)))

    def draw(self, student_progress: float) -> int:
        """Return which draw of differing legs hops, 0 for legs that are alike."""
        return (
            1 + int(self.draws * self._apart(student_progress))
            if student_progress >= self.alike
            else 0
        )

    def _apart(self, student_progress: float) -> float:
        """Return the share of the learning on differing legs that is done, negative before it."""
        return (student_progress - self.alike) / (1 - self.alike)

    def network(self, model: Any, env: TaskVecEnv) -> Network:  # noqa: ANN401
        """Return the student as it stands."""
        student: AdaptiveStudent = model.policy.student
        return adaptive_network(student, env.task.observation, "clip")
