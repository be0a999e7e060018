"""Where the numbers of each recipe are searched: one field per number, named as in the recipe."""

from dataclasses import dataclass, fields
from typing import Any, Protocol

from optuna.trial import Trial

from hopping_leg.errors import UsageError
from hopping_leg.rl.recipe import Recipe

Value = int | float | tuple[int, ...]


@dataclass(frozen=True)
class Real:
    """A real number."""

    low: float
    high: float
    log: bool = False
    """Searched by its logarithm."""

    def suggest(self, trial: Trial, name: str) -> Value:
        """Return the trial's value."""
        return trial.suggest_float(name, self.low, self.high, log=self.log)

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

    def suggest(self, trial: Trial, name: str) -> Value:
        """Return the trial's value."""
        by_text = {self.stored(choice): choice for choice in self.choices}
        chosen: Any = trial.suggest_categorical(name, list(by_text))
        return by_text[chosen]

    def stored(self, value: Any) -> int | float | str:  # noqa: ANN401
        """Return a recipe's value as the study stores it."""
        return "x".join(map(str, value)) if isinstance(value, tuple) else value

    def holds(self, value: Any) -> bool:  # noqa: ANN401
        """Tell whether a recipe's value is one of them."""
        return value in self.choices


class Dimension(Protocol):
    """One number of a recipe that is searched."""

    def suggest(self, trial: Trial, name: str) -> Value:
        """Return the trial's value."""
        ...

    def stored(self, value: Any) -> int | float | str:  # noqa: ANN401
        """Return a recipe's value as the study stores it."""
        ...

    def holds(self, value: Any) -> bool:  # noqa: ANN401
        """Tell whether a recipe's value can be found."""
        ...


_LAYERS = ((64, 64), (128, 64), (256, 128), (256, 256), (128, 128, 64))


@dataclass(frozen=True)
class FastSpace:
    """Of recipe ``fast``; see ``FastRecipe`` for what the numbers are."""

    learning_rate: Real = Real(2e-4, 4e-3, log=True)
    actor: OneOf = OneOf(_LAYERS)
    critic: OneOf = OneOf(_LAYERS)
    gamma: Real = Real(0.97, 0.997)
    gae_lambda: Real = Real(0.90, 0.99)
    sde_sample_freq: OneOf = OneOf((0, 8, 16, 24, 40))
    n_steps: OneOf = OneOf((32, 64, 128))
    batch_size: OneOf = OneOf((1024, 2048, 4096, 8192))
    n_epochs: OneOf = OneOf((2, 4, 8))
    log_std_until: Real = Real(0.3, 1.0)


@dataclass(frozen=True)
class PaperSpace:
    """Of recipe ``paper``; see ``PaperRecipe``."""

    learning_rate: Real = Real(1e-4, 3e-3, log=True)
    hidden: OneOf = OneOf(((128, 128), (256, 256), (256, 256, 128, 128)))
    batch_size: OneOf = OneOf((128, 256, 512))
    n_steps: OneOf = OneOf((1, 3, 5))
    tau: Real = Real(1e-3, 2e-2, log=True)
    gamma: Real = Real(0.97, 0.997)
    train_freq: OneOf = OneOf((8, 16, 32, 64))
    gradient_steps: OneOf = OneOf((32, 64, 128, 256))
    target_entropy: Real = Real(-4.0, 0.0)
    log_std: Real = Real(-3.5, -1.0)


@dataclass(frozen=True)
class PreciseSpace:
    """Of recipe ``precise``; see ``PreciseRecipe``."""

    learning_rate: Real = Real(2e-4, 4e-3, log=True)
    student: OneOf = OneOf((*_LAYERS, (512, 256)))
    gamma: Real = Real(0.97, 0.997)
    gae_lambda: Real = Real(0.90, 0.99)
    teacher_share: Real = Real(0.2, 0.7)
    dagger_mixing_share: Real = Real(0.0, 0.5)


Space = FastSpace | PaperSpace | PreciseSpace

SPACES: dict[str, Space] = {"fast": FastSpace(), "paper": PaperSpace(), "precise": PreciseSpace()}
"""Recipe to where it is searched."""


def dimensions(space: Any) -> dict[str, Dimension]:  # noqa: ANN401
    """Return what is searched, by name."""
    return {field.name: getattr(space, field.name) for field in fields(space)}


def suggest(trial: Trial, space: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return the values that a trial shall try, by name."""
    return {name: found.suggest(trial, name) for name, found in dimensions(space).items()}


def defaults(recipe: Recipe, space: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return a recipe's own values as a study stores them.

    Raises:
        UsageError: One of them lies outside of the space.
    """
    stored: dict[str, Any] = {}
    for name, dimension in dimensions(space).items():
        value = getattr(recipe, name)
        if not dimension.holds(value):
            raise UsageError(f"'{name}' of recipe '{recipe.name}' is {value}, outside {dimension}.")
        stored[name] = dimension.stored(value)
    return stored
