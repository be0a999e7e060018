"""Record a twin, identify it, train on that, hop on it: the paper's claim, tried once."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hopping_leg.controllers.registry import ENERGY_SHAPING
from hopping_leg.errors import UsageError
from hopping_leg.evaluate import runner
from hopping_leg.identify.optimizers import LeastSquaresOptions
from hopping_leg.locks import hold_folder
from hopping_leg.sim_to_real.jobs import work_through
from hopping_leg.sim_to_real.policies import FIRST_SEED, HopTrial, TrainPolicy
from hopping_leg.sim_to_real.tables import tabulate
from hopping_leg.sim_to_real.twins import (
    RIGS,
    SHORTEST,
    USUAL_FIT,
    IdentifyTwin,
    RecordTwin,
    Twin,
    disturbance_of,
)

if TYPE_CHECKING:
    from hopping_leg.rl.recipe import Recipe

MEANINGS = {
    "identified": "identified from both recordings",
    "cad": "CAD defaults",
    ENERGY_SHAPING: "energy shaping, shipped gains",
}
"""What a controller is trained on before it meets the twin, by the method's name."""


def about(twins: tuple[Twin, ...], seconds: float, repeats: int) -> dict[str, Any]:
    """Return what results begin with: the twins and how they were met."""
    return {
        "twins": [
            {
                "name": twin.name,
                "robot_digest": twin.robot.digest,
                "believed": twin.believed,
                "paper_disturbance": disturbance_of(twin.robot).delay_probability > 0,
            }
            for twin in twins
        ],
        "recording_seconds": seconds,
        "evaluation_seed": FIRST_SEED,
        "evaluation_seeds": repeats,
        "versions": runner.software_versions(),
    }


@dataclass(frozen=True)
class Transfer:
    """One pass from a leg that is not known to hops on it, beside a training on the CAD's robot.

    Attributes:
        folder: Keeps recordings, robots, trainings and trials; what is there is not done again.
        seed: Seed of the trainings.
        effort: How far the fit searches.
        repeats: Runs at each command.
    """

    folder: Path
    twin: Twin
    recipe: "Recipe"
    seed: int = 0
    effort: LeastSquaresOptions = USUAL_FIT
    repeats: int = 3

    @property
    def identified(self) -> Path:
        """File of the identified robot."""
        return self.folder / "robots" / f"{self.twin.name}-identified.toml"

    @property
    def policy(self) -> Path:
        """Policy that was trained on it."""
        return self.trainings[0].folder / "policy.onnx"

    @property
    def records(self) -> list[RecordTwin]:
        """A recording on each rig."""
        folder, twin = self.folder / "recordings", self.twin
        return [RecordTwin(folder / f"{twin.name}-{rig}.parquet", twin, rig) for rig in RIGS]

    @property
    def fit(self) -> IdentifyTwin:
        """The fit to both."""
        files = tuple(record.file for record in self.records)
        return IdentifyTwin(self.identified, self.twin, files, effort=self.effort)

    @property
    def trainings(self) -> list[TrainPolicy]:
        """Trainings on the identified robot and on the believed one."""
        believed = self.twin.believed
        folder, seed = self.folder / "training", self.seed
        return [
            TrainPolicy(folder / f"{name}-seed{seed}", source, self.recipe, seed)
            for name, source in (
                (f"{self.twin.name}-identified", str(self.identified)),
                (Path(believed).stem, believed),
            )
        ]

    @property
    def hops(self) -> list[HopTrial]:
        """Trials of both policies, and of a controller that needs no training."""
        policies = [*(training.folder / "policy.onnx" for training in self.trainings), None]
        return [
            HopTrial(
                self.folder / "trials" / f"{self.twin.name}-{method}-seed{self.seed}.json",
                self.twin,
                method,
                self.seed,
                policy,
                repeats=self.repeats,
            )
            for method, policy in zip(MEANINGS, policies, strict=True)
        ]

    def run(self, at_once: int = 1, afterwards: float = 0.0) -> dict[str, Any]:
        """Do what is left of it and return its numbers.

        What the caller does ``afterwards``, s of a core, counts in the time left.

        Raises:
            UsageError: The folder holds results of other options, or another process works in it.
        """
        jobs = (self.records, [self.fit], self.trainings, self.hops)
        with hold_folder(self.folder, UsageError):
            work_through(jobs, at_once, afterwards)
        return {
            **about((self.twin,), SHORTEST, self.repeats),
            "training_seeds": [self.seed],
            "recipe": self.recipe.name,
            "recipe_changes": [],
            "training_steps": self.recipe.schedule.steps,
            **tabulate(MEANINGS, [trial for hop in self.hops for trial in hop.rows()]),
            "identification": [self.fit.row()],
            "trainings": [training.row() for training in self.trainings],
        }
