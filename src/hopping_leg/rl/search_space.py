"""What `hop tune` searches: options of a recipe by name, each with its values."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hopping_leg.errors import UsageError
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


def suggest(trial: Any, space: SearchSpace) -> dict[str, Any]:  # noqa: ANN401
    """Return the values that a trial shall try, by name."""
    return {name: found.suggest(trial, name) for name, found in space.items()}


def defaults(recipe: Recipe, space: SearchSpace) -> dict[str, Any]:
    """Return a recipe's own values as a study stores them.

    Raises:
        UsageError: One of them lies outside of the space.
    """
    stored: dict[str, Any] = {}
    for name, dimension in space.items():
        value = recipe.value(name)
        if not dimension.holds(value):
            raise UsageError(f"'{name}' of recipe '{recipe.name}' is {value}, outside {dimension}.")
        stored[name] = dimension.stored(value)
    return stored
