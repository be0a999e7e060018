"""Third stage: train on what a method believes the twin to be."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hopping_leg.robot.parameters import Robot
from hopping_leg.sim_to_real.methods import Method
from hopping_leg.sim_to_real.study import Study, TwinFile

if TYPE_CHECKING:
    from hopping_leg.rl.recipe import Recipe
    from hopping_leg.rl.run_folder import RunFolder


@dataclass(frozen=True)
class Train:
    """A training."""

    study: Study
    twin: TwinFile
    method: Method
    seed: int

    @property
    def weight(self) -> float:
        """Rough time, min."""
        return self.study.steps / 600_000

    @property
    def name(self) -> str:
        """What is done."""
        return f"train {self.study.training(self.twin, self.method, self.seed).name}"

    @property
    def done(self) -> bool:
        """Whether the policy is there.

        Raises:
            UsageError: The folder holds another training.
        """
        folder = self._folder()
        if not (folder.path / "config.json").exists():
            return False
        folder.check_same()
        return folder.policy.exists()

    def run(self, *, quiet: bool) -> None:
        """Train; a training that was killed goes on."""
        from hopping_leg.rl.train import train

        folder = self._folder()
        train(
            self.recipe(),
            self.robot,
            self.seed,
            folder.path,
            resume=True,
            threads=self.study.threads,
            quiet=quiet,
        )

    def progress(self) -> tuple[float, str]:
        """Return the share done and what to show while it runs."""
        snapshots = sorted((self._folder().path / "snapshots").glob("*.onnx"))
        steps = int(snapshots[-1].stem) if snapshots else 0
        share = min(steps / self.study.steps, 1.0)
        return share, f"{steps / 1e6:.1f}M steps" if steps else "begun"

    def recipe(self) -> "Recipe":
        """Return how it is trained.

        Raises:
            UsageError: There is no such recipe, or it has no such number.
        """
        from hopping_leg.rl.recipes import change, get_recipe, randomise

        study = self.study
        recipe = change(get_recipe(study.recipe), [*study.changes, f"steps={study.steps}"])
        return randomise(recipe, self.method.ranges)

    @property
    def robot(self) -> Robot:
        """What is trained on."""
        return self.study.simulated(self.twin, self.method)

    @property
    def path(self) -> Path:
        """The training's folder."""
        return self.study.training(self.twin, self.method, self.seed)

    @property
    def result(self) -> dict[str, Any]:
        """What the finished training left: how long it took, how the policy hops where it learnt.

        Raises:
            UsageError: It is not finished.
        """
        from hopping_leg.rl.run_folder import read_result

        return read_result(self.path)

    @property
    def own_score(self) -> float:
        """How bad the policy is in the simulation that it was trained in, m."""
        return float(self.result["selected"]["score_m"])

    def _folder(self) -> "RunFolder":
        from hopping_leg.rl.run_folder import RunFolder

        robot = self.robot
        recipe = self.recipe().fit(robot)
        return RunFolder(self.path, recipe, robot, self.seed, None)
