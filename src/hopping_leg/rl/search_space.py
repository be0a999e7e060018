"""What `hop tune` searches: options of a recipe by name, each with its values."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from hopping_leg.errors import UsageError
from hopping_leg.robot import DEFAULT_ROBOT

if TYPE_CHECKING:
    from hopping_leg.rl.recipe import Recipe

Value = int | float | tuple[int, ...]

LAYERS = ((64, 64), (128, 64), (256, 128), (256, 256), (128, 128, 64))
"""Sizes of hidden layers that are searched."""


@dataclass(frozen=True)
class Real:
    """A real number."""

    low: float
    high: float
    log: bool = False
    """Searched by its logarithm."""

    def suggest(self, trial: Any, name: str) -> Value:  # noqa: ANN401
        """Return the value that an Optuna trial shall try."""
        return float(trial.suggest_float(name, self.low, self.high, log=self.log))

    def stored(self, value: Any) -> float:  # noqa: ANN401
        """Return a recipe's value as the study stores it."""
        return float(value)

    def holds(self, value: Any) -> bool:  # noqa: ANN401
        """Tell whether a recipe's value lies in the range."""
        return bool(self.low <= value <= self.high)


@dataclass(frozen=True)
class OneOf:
    """One of a few values; layer sizes are stored as ``128x64``."""

    choices: tuple[Value, ...]

    def suggest(self, trial: Any, name: str) -> Value:  # noqa: ANN401
        """Return the value that an Optuna trial shall try."""
        by_text = {self.stored(choice): choice for choice in self.choices}
        return by_text[trial.suggest_categorical(name, list(by_text))]

    def stored(self, value: Any) -> int | float | str:  # noqa: ANN401
        """Return a recipe's value as the study stores it."""
        return "x".join(map(str, value)) if isinstance(value, tuple) else value

    def holds(self, value: Any) -> bool:  # noqa: ANN401
        """Tell whether a recipe's value is one of them."""
        return value in self.choices


SearchSpace = Mapping[str, Real | OneOf]
"""Options by name, each with the values that are searched."""


def defaults(recipe: "Recipe", space: SearchSpace) -> dict[str, Any]:
    """Return a recipe's own values as a study stores them; ``UsageError`` outside of the space."""
    stored: dict[str, Any] = {}
    for name, dimension in space.items():
        value = recipe.value(name)
        if not dimension.holds(value):
            raise UsageError(f"'{name}' of recipe '{recipe.name}' is {value}, outside {dimension}.")
        stored[name] = dimension.stored(value)
    return stored


@dataclass(frozen=True)
class Tuning:
    """Search the numbers of a recipe with Optuna."""

    recipe: tyro.conf.Suppress[str]
    study: str | None = None
    """SQLite file, or URL of another database; default: runs/tune/RECIPE.db."""
    out: Path | None = None
    """Folder of the trainings, trials.json and the figures; default: runs/tune/RECIPE."""
    robot: str = DEFAULT_ROBOT
    """A shipped robot or the path of a .toml file."""
    trials: int = 50
    """Trials of the finished study, summed over all processes."""
    steps: int = 1_000_000
    """Control steps of each training, all legs together."""
    snapshots: int = 5
    """Evaluations of each training before it ends, at which it may be pruned."""
    startup: int = 10
    """Finished trials before any is pruned, and before the search uses them."""
    seed: int = 0
    """Seed of the trainings, and of the search."""
    set: tuple[str, ...] = ()
    """Options of the recipe for every trial, e.g. `--set num_envs=256`."""
    heartbeat: tyro.conf.Suppress[int] = 15
    """Time between two signs of life of a trial, s; after three without one it is given to the
    next process."""

    def __post_init__(self) -> None:
        for name in ("trials", "steps", "snapshots", "startup", "heartbeat"):
            if getattr(self, name) < 1:
                raise UsageError(f"--{name} is {getattr(self, name)} but must be 1 or more.")
        if self.seed < 0:
            raise UsageError(f"--seed is {self.seed} but must be 0 or more.")

    @property
    def folder(self) -> Path:
        """Folder of the trainings."""
        return self.out or Path("runs/tune") / self.recipe

    @property
    def storage(self) -> str:
        """URL of the study's database."""
        study = self.study or f"runs/tune/{self.recipe}.db"
        return study if "://" in study else f"sqlite:///{Path(study).resolve()}"

    @property
    def in_file(self) -> bool:
        """Whether the database is a file, of SQLite."""
        return self.storage.startswith("sqlite")
