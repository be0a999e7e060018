"""The recurrent recipe: a network with a memory of its own, taught as the precise one is.

The paper finds that recurrent networks bring no advantage (Sec. II-C, "Network architecture"). Here
the same teacher teaches a gated recurrent unit that sees 50 ms, beside ``precise`` that sees 0.7 s.
"""

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from torch import nn

from hopping_leg.envs import TaskConfig
from hopping_leg.rl.actor import recurrent_network
from hopping_leg.rl.export import Network
from hopping_leg.rl.imitation import Imitation
from hopping_leg.rl.precise import PreciseRecipe
from hopping_leg.rl.students import RecurrentStudent
from hopping_leg.rl.vecenv import TaskVecEnv


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
    judge_commands: tuple[float, ...] = (0.22, 0.25, 0.28, 0.31, 0.34, 0.37, 0.40)
    """Heights of the trials, m."""
    num_envs: int = 256
    """Legs that gather experience at once."""
    rollout: int = 128
    """Ticks between updates, each leg: errors are traced back so far, longer than a hop."""
    steps: int = 9_000_000
    """Control steps of experience in all, summed over the legs."""
    teaching: float = 0.55
    """Share of the training in which the teacher learns; in the rest the policy does."""
    epochs: int = 4
    """Passes over a rollout; more were not tried here."""
    teachers: int = 1
    """Choosing among several was not tried here."""
    memory: int = 128
    """Entries of the memory."""
    imitation: Imitation = field(default_factory=lambda: Imitation(updates=24, batch=8192))
    """How the policy learns from the teacher; a batch is made of whole sequences."""

    def make_student(self, env: TaskVecEnv) -> nn.Module:
        """Build the untrained student."""
        return RecurrentStudent(
            env.task.observation.size, self.memory, self.imitation.memory, self.num_envs
        )

    def network(self, model: Any, env: TaskVecEnv) -> Network:  # noqa: ANN401
        """Return the student as it stands."""
        student: RecurrentStudent = model.policy.student
        return recurrent_network(student.unit, [student.readout], env.task.observation, "clip")
