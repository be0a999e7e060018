"""The paper's recipe: soft actor-critic with state-dependent exploration (Sec. II-C)."""

from dataclasses import dataclass, field, replace
from typing import ClassVar

from torch import nn

from hopping_leg.envs import PaperRewardConfig, Reward, TaskConfig, paper_reward
from hopping_leg.rl.recipe import Recipe
from hopping_leg.rl.resumable import ResumableSAC
from hopping_leg.rl.sb3_env import TaskVecEnv
from hopping_leg.rl.sb3_policies import AsymmetricSACPolicy
from hopping_leg.robot.parameters import Robot


@dataclass(frozen=True)
class PaperRecipe(Recipe):
    """SAC + gSDE on the paper's observation and reward.

    The paper gives network, reward, weights, noise and delay; the hyper-parameters of SAC, what
    ends an episode and what the critics see are chosen here.
    """

    name: ClassVar[str] = "paper"

    task: TaskConfig = field(
        default_factory=lambda: TaskConfig(
            reset_distribution="mixed",
            random_episode_start=True,
            fall_clearance=0.01,
            fall_penalty=20.0,
        )
    )
    reward: PaperRewardConfig = field(default_factory=PaperRewardConfig)
    """Weights as printed."""
    steps: int = 240_000
    """Control steps of experience in all, summed over the legs."""
    eval_every: int = 8_000
    """Control steps between two trials of the deterministic policy, for checkpoint selection."""
    hidden: tuple[int, ...] = (256, 256, 128, 128)
    """Hidden layers of actor and critics, ReLU, as printed."""
    learning_rate: float = 5e-4
    """Of all networks at the start; falls linearly to a tenth."""
    buffer_size: int = 300_000
    """Transitions in the replay buffer."""
    learning_starts: int = 2_000
    """Steps of uniformly random torque before the first gradient step."""
    batch_size: int = 256
    """Transitions per gradient step."""
    n_steps: int = 1
    """Ticks of measured reward before the critic's own estimate."""
    tau: float = 0.005
    """Share by which the target critics follow the critics at each gradient step."""
    gamma: float = 0.99
    """Discount per tick: a horizon of half a second, about one hop."""
    train_freq: int = 32
    """Ticks between updates, each leg; gSDE keeps its noise as long, 0.16 s."""
    gradient_steps: int = 128
    """Gradient steps after each rollout: one for every 4 steps of experience."""
    target_entropy: float = -2.0
    """That SAC's entropy coefficient aims for; the usual minus one per action."""
    log_std: float = -2.0
    """Initial log standard deviation of gSDE's weights."""

    def make_reward(self, robot: Robot) -> Reward:
        """Build the paper's five-term reward."""
        return paper_reward(robot, replace(self.reward, rest_length=self.task.start_length))

    def make_model(self, env: TaskVecEnv, seed: int) -> ResumableSAC:
        """Build SAC with gSDE."""
        rate = self.learning_rate
        return ResumableSAC(
            AsymmetricSACPolicy if self.privileged_critic else "MlpPolicy",
            env,
            learning_rate=lambda remaining: rate * (0.1 + 0.9 * remaining),
            buffer_size=self.buffer_size,
            learning_starts=self.learning_starts,
            batch_size=self.batch_size,
            tau=self.tau,
            gamma=self.gamma,
            n_steps=self.n_steps,
            train_freq=self.train_freq,
            gradient_steps=self.gradient_steps,
            target_entropy=self.target_entropy,
            use_sde=True,
            sde_sample_freq=-1,
            policy_kwargs={
                "net_arch": list(self.hidden),
                "activation_fn": nn.ReLU,
                "log_std_init": self.log_std,
                **({"actor_size": env.task.observation.size} if self.privileged_critic else {}),
            },
            seed=seed,
            device="cpu",
        )
