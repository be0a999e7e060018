"""What continued training is asked for."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

from hopping_leg.controllers.policy import Policy
from hopping_leg.envs import ApexRewardConfig
from hopping_leg.errors import UsageError
from hopping_leg.rl.finetune import apex_estimate, command_correction
from hopping_leg.rl.finetune.learner import SacConfig
from hopping_leg.robot.parameters import Robot


@dataclass(frozen=True)
class Task:
    """What goes on learning."""

    policy: Policy
    """The one to go on from."""
    robot: Robot
    """The believed leg."""
    commands: tuple[float, float]
    """Lowest and highest command, m."""
    seed: int
    """Seed of everything."""


@dataclass(frozen=True)
class StoppingRules:
    """When to stop and when to roll back; errors are those estimated on checks."""

    minutes: float = 10.0
    """Robot time at most."""
    tolerance: float = 0.004
    """Error that is good enough, on two checks in a row, m."""
    margin: float = 0.01
    """Error above the best at which a policy is rolled back to it, m."""
    confirm: int = 2
    """Checks in a row that must be so bad: a few hops scatter."""
    gain: float = 0.0005
    """Less of an improvement counts for none, m."""
    patience: int = 8
    """Checks without an improvement after which the training ends."""

    def rolled_back(self, errors: Sequence[float]) -> bool:
        """Tell whether the last errors of checks, m, are too bad beside the best."""
        latest = errors[-self.confirm :]
        return len(latest) == self.confirm and min(latest) > min(errors) + self.margin

    def reason(self, errors: Sequence[float], minutes: float, following: float) -> str:
        """Return why to stop after errors of checks, m; empty for a next trial of minutes."""
        if len(errors) > 1 and max(errors[-2:]) <= self.tolerance:
            return f"The error is within {1e3 * self.tolerance:g} mm."
        if minutes + following > self.minutes + 1e-9:
            return f"The {self.minutes:g} minutes of robot time are used up."
        before, since = errors[: -self.patience], errors[-self.patience :]
        if before and min(since) > min(before) - self.gain:
            return f"Nothing improved on the last {self.patience} checks."
        return ""


Method = Literal["aim", "sac", "both"]
"""Two numbers of the command, all weights, or first the one and then the other."""


@dataclass(frozen=True)
class FinetuneConfig:
    """Continued training on a robot."""

    method: Method = "both"
    """What is learnt: a correction of the command, the network's weights, or first the one."""
    commands: tuple[float, ...] = (0.25, 0.30, 0.35)
    """Heights of the checks, m; explorations hop between the lowest and the highest."""
    trial_seconds: float = 15.0
    """Length of a trial, s."""
    hold: float = 2.5
    """Time between new commands on explorations, s."""
    explorations: int = 3
    """Trials with exploration after each check, where weights are learnt."""
    correction_minutes: float = 2.0
    """Robot time for the correction before weights are learnt, with the method `both`, min."""
    sde_sample_freq: int = 24
    """Ticks that exploration keeps its noise, 0.12 s: about a push-off."""
    believed_seconds: float = 320.0
    """Experience of the believed robot in the replay, s."""
    first_steps: int = 5000
    """Gradient steps of the critics on that alone."""
    steps_per_tick: float = 0.33
    """Gradient steps for every tick of the real robot."""
    critics_first: int = 2
    """Trials of exploration from which only the critics learn."""
    penalty: float = 5.0
    """Reward lost where a trial is ended early."""
    stopping_rules: StoppingRules = field(default_factory=StoppingRules)
    """When it ends."""
    correction: command_correction.CommandCorrectionConfig = field(
        default_factory=command_correction.CommandCorrectionConfig
    )
    """How the command's correction follows the errors."""
    learner: SacConfig = field(default_factory=SacConfig)
    """Numbers of SAC."""
    contact: apex_estimate.ContactConfig = field(default_factory=apex_estimate.ContactConfig)
    """How contact is learnt in simulation."""
    reward: ApexRewardConfig = field(
        default_factory=lambda: ApexRewardConfig(width=(0.03, 0.015), sharp_from=1e-6, tail=0.5)
    )
    """Reward of the estimated apexes."""

    def __post_init__(self) -> None:
        if self.method not in get_args(Method):
            raise UsageError(f"'method' is '{self.method}'; valid: {', '.join(get_args(Method))}.")
        if len(set(self.commands)) < 2:
            raise UsageError(
                f"Commands {self.commands} are too few to correct by; give at least two heights."
            )
        if not 2 * len(self.commands) <= self.trial_seconds <= 60:
            raise UsageError(
                f"A trial of {self.trial_seconds:g} s does not suit {len(self.commands)} commands;"
                f" give {2 * len(self.commands)} to 60 s."
            )
        if not 0 < self.stopping_rules.minutes <= 600:
            raise UsageError(
                f"'minutes' is {self.stopping_rules.minutes:g} but must lie in 0 to 600."
            )
