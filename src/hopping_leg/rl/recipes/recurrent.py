"""The recurrent recipe: a network with a memory of its own, taught as the precise one is.

The paper finds that recurrent networks bring no advantage (Sec. II-C, "Network architecture"). Here
the same teacher teaches a gated recurrent unit that sees 50 ms, beside ``precise`` that sees 0.7 s.
"""

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from torch import nn

from hopping_leg.envs import TaskConfig
from hopping_leg.rl.actor import recurrent_network
from hopping_leg.rl.distillation.dagger import DaggerConfig
from hopping_leg.rl.distillation.students import RecurrentStudent
from hopping_leg.rl.onnx_export import Network
from hopping_leg.rl.recipes.precise import PreciseRecipe
from hopping_leg.rl.sb3_env import TaskVecEnv


@dataclass(frozen=True)
class RecurrentRecipe(PreciseRecipe):
    """The precise recipe with a GRU instead of a window of the past."""

    name: ClassVar[str] = "recurrent"

    task: TaskConfig = field(
        default_factory=lambda: replace(
            PreciseRecipe().task,
            observation="dated",
            command_range=(0.20, 0.42),
            command_skew=1.0,
        )
    )
    """The learning problem; wider ranges of commands were not tried."""
    eval_commands: tuple[float, ...] = (0.22, 0.25, 0.28, 0.31, 0.34, 0.37, 0.40)
    """Heights of the trials, m."""
    num_envs: int = 256
    """Legs that gather experience at once."""
    n_steps: int = 128
    """Ticks between updates, each leg: errors are traced back so far, longer than a hop."""
    steps: int = 9_000_000
    """Control steps of experience in all, summed over the legs."""
    teacher_share: float = 0.55
    """Share of the training in which the teacher learns; in the rest the policy does."""
    n_epochs: int = 4
    """Passes over a rollout; more were not tried here."""
    teachers: int = 1
    """Choosing among several was not tried here."""
    memory: int = 128
    """Entries of the memory."""
    dagger: DaggerConfig = field(
        default_factory=lambda: DaggerConfig(gradient_steps=24, batch_size=8192)
    )
    """How the policy learns from the teacher; a batch is made of whole sequences."""

    def make_student(self, env: TaskVecEnv) -> nn.Module:
        """Build the untrained student."""
        return RecurrentStudent(
            env.task.observation.size, self.memory, self.dagger.buffer_size, self.num_envs
        )

    def network(self, model: Any, env: TaskVecEnv) -> Network:  # noqa: ANN401
        """Return the student as it stands."""
        student: RecurrentStudent = model.policy.student
        return recurrent_network(student.unit, [student.readout], env.task.observation, "clip")
