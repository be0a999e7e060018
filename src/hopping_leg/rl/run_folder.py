"""The folder of one training: what it was asked for, checkpoints, snapshots, results."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from hopping_leg.errors import UsageError
from hopping_leg.io import versions, write_json
from hopping_leg.rl.checkpoint import Tree, list_checkpoints, read_checkpoint
from hopping_leg.rl.legacy_names import upgrade_checkpoint, upgrade_config
from hopping_leg.rl.recipe import Recipe
from hopping_leg.rl.recipes import RECIPES, words_of
from hopping_leg.robot.parameters import Robot

_LIBRARIES = ("hopping-leg", "mujoco", "numpy", "onnxruntime", "stable-baselines3", "torch")

_ASKED = (
    "recipe",
    "robot_digest",
    "seed",
    "parallel_seeds",
    "minutes_budget",
    "source",
    "options",
)
"""What a run must have been asked for alike to go on."""


class RunFolder:
    """Paths and files of one run.

    Attributes:
        path: The folder.
        config: What the run was asked for, as JSON values.
    """

    def __init__(
        self,
        path: Path,
        recipe: Recipe,
        robot: Robot,
        seed: int,
        minutes: float | None,
        source: Path | None = None,
        parallel_seeds: int = 1,
    ) -> None:
        self.path, self._source = path, source
        self._defaults = _as_stored(asdict(RECIPES.get(recipe.name, recipe)))
        self.config = _as_stored(
            {
                "recipe": recipe.name,
                "options": asdict(recipe),
                "robot": robot.name,
                "robot_digest": robot.digest,
                "seed": seed,
                "minutes_budget": minutes,
                "source": str(source) if source else None,
                "parallel_seeds": parallel_seeds,
                "versions": library_versions(),
            }
        )

    @property
    def checkpoints(self) -> Path:
        """Folder of the checkpoints."""
        return self.path / "checkpoints"

    @property
    def policy(self) -> Path:
        """The selected policy, once the training is over."""
        return self.path / "policy.onnx"

    @property
    def command(self) -> str:
        """The command that makes such a run."""
        config = self.config
        recipe = config["options"]["source"] or config["recipe"]
        words = ["hop train", "--recipe", recipe, "--robot", config["robot"]]
        words += ["--seed", str(config["seed"])]
        if config["source"] is not None:
            words += ["--source", config["source"]]
        if config["minutes_budget"] is not None:
            words += ["--minutes", f"{config['minutes_budget']:g}"]
        if config["parallel_seeds"] > 1:
            words += ["--parallel-seeds", str(config["parallel_seeds"])]
        return " ".join([*words, *words_of(config["recipe"], config["options"])])

    def snapshot(self, steps: int) -> Path:
        """Return the file of the policy as it was after so many steps."""
        return self.path / "snapshots" / f"{steps:012d}.onnx"

    def begin(self, *, resume: bool) -> Tree | None:
        """Prepare the folder; return the newest checkpoint if there is one to resume from.

        Raises:
            UsageError: The folder holds a run and ``resume`` is off, or another or finished run.
        """
        if not self._config_file.exists():
            if self.path.is_dir() and any(self.path.iterdir()):
                raise UsageError(f"{self.path} is not empty and holds no run; give another --out.")
            tree = self._from_source() if self._source else None
            self.write("config.json", self.config)
            return tree
        if not resume:
            raise UsageError(
                f"{self.path} already holds a run; go on with --resume or give another --out."
            )
        self.check_same()
        if self.policy.exists():
            raise UsageError(f"The run in {self.path} is finished; its policy is {self.policy}.")
        found = list_checkpoints(self.checkpoints)
        if found:
            return upgrade_checkpoint(read_checkpoint(found[-1]))
        return self._from_source() if self._source else None

    def _from_source(self) -> Tree:
        assert self._source is not None
        found = list_checkpoints(self._source / "checkpoints")
        if not found:
            raise UsageError(f"{self._source} holds no checkpoint to begin from.")
        return {**upgrade_checkpoint(read_checkpoint(found[-1])), "history": []}

    def write(self, name: str, content: Any) -> None:  # noqa: ANN401
        """Write a JSON file of the folder, whole or not at all."""
        write_json(self.path / name, content)

    @property
    def _config_file(self) -> Path:
        return self.path / "config.json"

    def check_same(self) -> None:
        """Check that the run in the folder was asked for the same as this one.

        Raises:
            UsageError: It was not; the message names the first difference.
        """
        stored = upgrade_config(json.loads(self._config_file.read_text(encoding="utf-8")))
        # A run from before an option existed was asked for what is now its default.
        _complete(stored.get("options", {}), self._defaults)
        stored.setdefault("parallel_seeds", 1)
        for key in _ASKED:
            if stored.get(key) != self.config[key]:
                raise UsageError(
                    f"The run in {self.path} has another {key.replace('_', ' ')}"
                    f" ({_short(stored.get(key))} instead of {_short(self.config[key])});"
                    " resume it with the options that it began with."
                )


def _complete(options: dict[str, Any], defaults: dict[str, Any]) -> None:
    """Add what is missing, in the parts of the options, too."""
    for name, value in defaults.items():
        if isinstance(options.setdefault(name, value), dict) and isinstance(value, dict):
            _complete(options[name], value)


def _as_stored(values: dict[str, Any]) -> dict[str, Any]:
    """Return values as JSON gives them back."""
    stored: dict[str, Any] = json.loads(json.dumps(values, default=_name))
    return stored


def read_result(path: Path) -> dict[str, Any]:
    """Return what a finished run left in ``result.json``.

    Raises:
        UsageError: The folder holds no finished run.
    """
    file = path / "result.json"
    if not file.exists():
        raise UsageError(f"{path} holds no finished run; go on with `hop train --resume`.")
    result: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return result


def library_versions() -> dict[str, str]:
    """Return the versions of the libraries that decide about a training's result."""
    return {k: v for k, v in versions(*_LIBRARIES).items() if k != "python"}


def _name(function: object) -> str:
    return str(getattr(function, "__qualname__", type(function).__qualname__))


def _short(value: Any) -> str:  # noqa: ANN401
    return "other values" if isinstance(value, dict) else repr(value)
