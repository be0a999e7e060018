"""What the learning problem leaves open, as options; the default is argued in the docs."""

from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from hopping_leg.controllers.observation_history import OBSERVATION_HISTORIES
from hopping_leg.errors import UsageError
from hopping_leg.robot import TIMESTEP, SoftLimits
from hopping_leg.sim import CONTROL_RATE, NoiseAndDelay
from hopping_leg.sim.randomization import Range

ResetDistribution = Literal["standing", "drop", "mixed", "hop"]


@dataclass(frozen=True)
class TaskConfig:
    """The learning problem around the leg."""

    observation: str = "three-samples"
    """Observation history whose inputs the learner sees: the paper's three samples, however late,
    or more samples, each in its place in time, and the own past torques."""
    action_torque: tuple[float, float] = (6.0, 6.0)
    """Joint torque of a full action at hip and knee, N m."""
    commands: tuple[float, ...] = (0.25, 0.30, 0.35)
    """Desired heights to draw from, m; the paper's three."""
    command_range: tuple[float, float] | None = None
    """Draw desired heights from this range instead, m."""
    command_resampling_time: tuple[float, float] | None = None
    """Shortest and longest time between new commands, s; none keeps one command per episode."""
    reset_distribution: ResetDistribution = "standing"
    """Episodes begin standing, with a drop in a random posture, either with equal chance, or mostly
    near the apex of the commanded hop and else standing in a random posture."""
    episode: float = 5.0
    """Length of an episode, s."""
    random_episode_start: bool = False
    """Cut the first episode of each leg at a random length, so that a batch does not end as one."""
    episode_grid: int = 1
    """Control periods at whose multiples alone episodes end."""
    fall_clearance: float | None = None
    """Gap between ground and base or knee below which an episode terminates, m; none never does."""
    fall_penalty: float = 0.0
    """Reward lost by that end: without it a leg with little to win learns to fall."""
    rate: float = CONTROL_RATE
    """Control rate, Hz."""
    timestep: float = TIMESTEP
    """Physics step, s."""
    disturbance: NoiseAndDelay = field(default_factory=NoiseAndDelay)
    """Noise and delay; the paper trains with them."""
    randomised: tuple[Range, ...] = ()
    """Where each leg draws its own numbers instead of the robot's; none by default."""
    soft_limits: SoftLimits | None = field(default_factory=SoftLimits)
    """PD at the joint limits, added to the action's torque."""

    def __post_init__(self) -> None:
        if not self.commands or not all(0 < c < np.inf for c in self.commands):
            raise UsageError(
                f"Commands must be positive heights in m, not {self.commands}; e.g. 0.25 0.30 0.35."
            )
        for name in ("command_range", "command_resampling_time"):
            pair = getattr(self, name)
            if pair is not None and not 0 < pair[0] <= pair[1] < np.inf:
                raise UsageError(
                    f"'{name}' is {pair} but must be two positive numbers, the smaller first."
                )
        for name in ("action_torque", "episode", "rate", "timestep"):
            value = getattr(self, name)
            if not all(0 < v < np.inf for v in np.atleast_1d(value)):
                raise UsageError(f"'{name}' is {value} but must be positive and finite.")
        for name, valid in (
            ("observation", tuple(OBSERVATION_HISTORIES)),
            ("reset_distribution", get_args(ResetDistribution)),
        ):
            if getattr(self, name) not in valid:
                raise UsageError(f"'{name}' is '{getattr(self, name)}'; valid: {', '.join(valid)}.")

    @property
    def command_bounds(self) -> tuple[float, float]:
        """Lowest and highest desired height, m."""
        return self.command_range or (min(self.commands), max(self.commands))
