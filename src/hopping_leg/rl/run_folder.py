"""The folder of one training: what it was asked for, checkpoints, snapshots, results."""

import json
import shlex
from dataclasses import asdict
from pathlib import Path
from typing import Any

from hopping_leg.controllers.registry import ROBOT_FILE
from hopping_leg.errors import UsageError
from hopping_leg.io import parse_json, versions, write_atomically, write_json
from hopping_leg.locks import FOLDER_LOCK
from hopping_leg.rl import checkpoint, recipes
from hopping_leg.rl.recipe import Recipe
from hopping_leg.robot import Robot, load_robot, robot_text, robot_tree, shipped_robots

_LIBRARIES = ("hopping-leg", "mujoco", "numpy", "onnxruntime", "stable-baselines3", "torch")

_ASKED = ["recipe", "robot_digest", "seed", "minutes_budget", "source", "options"]
"""What a run must have been asked for alike to go on."""


class RunFolder:
    """Paths and files of one run."""

    def __init__(
        self,
        path: Path,
        recipe: Recipe,
        robot: Robot,
        seed: int,
        minutes: float | None,
        source: Path | None = None,
    ) -> None:
        self.path, self._source, self._robot = path, source, robot
        self._defaults = as_stored(asdict(recipes.RECIPES.get(recipe.name, recipe)))
        self.config = as_stored(
            {
                "recipe": recipe.name,
                "options": asdict(recipe),
                "robot": robot.name,
                "robot_digest": robot.digest,
                "seed": seed,
                "minutes_budget": minutes,
                "source": str(source) if source else None,
                "versions": library_versions(),
            }
        )
        """What the run was asked for, as JSON values."""

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
        robot = config["robot"]
        if robot not in shipped_robots() or load_robot(robot) != self._robot:
            robot = str(self.path / ROBOT_FILE)
        words = ["hop", "train", "--recipe", recipe, "--robot", robot]
        words += ["--seed", str(config["seed"])]
        if config["source"] is not None:
            words += ["--source", config["source"]]
        if config["minutes_budget"] is not None:
            words += ["--minutes", f"{config['minutes_budget']:g}"]
        return shlex.join([*words, *recipes.words_of(config["recipe"], config["options"])])

    def snapshot(self, steps: int) -> Path:
        """Return the file of the policy as it was after so many steps."""
        return self.path / "snapshots" / f"{steps:012d}.onnx"

    def begin(self, *, resume: bool) -> checkpoint.Tree | None:
        """Prepare the folder; return the newest checkpoint if there is one to resume from.

        Raises:
            UsageError: The folder holds a run and ``resume`` is off, or another or finished run.
        """
        new = is_new(self.path, resume=resume)
        found = [] if new else checkpoint.list_checkpoints(self.checkpoints)
        if not new:
            self.check_same()
            refuse_finished(self.policy)
        tree = checkpoint.read_checkpoint(found[-1]) if found else self._from_source()
        if new:
            self.write("config.json", self.config)
            write_robot(self.path, self._robot)
        return tree

    def _from_source(self) -> checkpoint.Tree | None:
        if self._source is None:
            return None
        found = checkpoint.list_checkpoints(self._source / "checkpoints")
        if not found:
            raise UsageError(f"{self._source} holds no checkpoint to begin from.")
        return {**checkpoint.read_checkpoint(found[-1]), "history": []}

    def write(self, name: str, content: Any) -> None:  # noqa: ANN401
        """Write a JSON file of the folder, whole or not at all."""
        write_json(self.path / name, content)

    def check_same(self) -> None:
        """Raise ``UsageError`` where the run in the folder was asked for something else."""
        stored = read_json(self.path / "config.json")
        # A run from before an option existed was asked for what is its default.
        options = stored.get("options")
        if not isinstance(options, dict):
            raise UsageError(f"{self.path / 'config.json'} is damaged; give another --out.")
        _complete(options, self._defaults)
        asked = {key: self.config[key] for key in _ASKED}
        for config in (stored, asked):
            if isinstance(config.get("source"), str):
                config["source"] = str(Path(config["source"]).resolve())
        check_same(self.path, stored, asked)


def write_robot(folder: Path, robot: Robot) -> None:
    """Write the robot that a policy is made for into the policy's folder."""
    tree = robot_tree(robot, f"as '{robot.name}' had it when {folder.name} began")
    write_atomically(folder / ROBOT_FILE, robot_text(tree).encode())


def is_new(folder: Path, *, resume: bool) -> bool:
    """Tell whether a folder holds no run; ``UsageError`` where it must not be used."""
    if not (folder / "config.json").exists():
        if folder.is_dir() and any(entry.name != FOLDER_LOCK for entry in folder.iterdir()):
            raise UsageError(f"{folder} is not empty and holds no run; give another --out.")
        return True
    if not resume:
        raise UsageError(
            f"{folder} already holds a run; go on with --resume or give another --out."
        )
    return False


def check_same(folder: Path, stored: dict[str, Any], asked: dict[str, Any]) -> None:
    """Raise ``UsageError`` that names the first difference where a run was asked for another."""
    for key, value in asked.items():
        if stored.get(key) != value:
            raise UsageError(
                f"The run in {folder} has another {key.replace('_', ' ')}"
                f" ({_short(stored.get(key))} instead of {_short(value)});"
                " resume it with the options that it began with."
            )


def refuse_finished(policy: Path) -> None:
    """Raise ``UsageError`` where a run has left its policy."""
    if policy.exists():
        raise UsageError(f"The run in {policy.parent} is finished; its policy is {policy}.")


def _complete(options: dict[str, Any], defaults: dict[str, Any]) -> None:
    """Add what is missing, in the parts of the options, too."""
    for name, value in defaults.items():
        if isinstance(options.setdefault(name, value), dict) and isinstance(value, dict):
            _complete(options[name], value)


def as_stored(values: dict[str, Any]) -> dict[str, Any]:
    """Return values as JSON gives them back."""
    stored: dict[str, Any] = json.loads(json.dumps(values, default=_name))
    return stored


def read_json(file: Path) -> dict[str, Any]:
    """Return the object in a JSON file."""
    return parse_json(file.read_bytes(), str(file))


def read_result(path: Path) -> dict[str, Any]:
    """Return a finished run's ``result.json``; ``UsageError`` where there is none."""
    file = path / "result.json"
    if not file.exists():
        raise UsageError(
            f"{path} holds no finished run; repeat the command that began it, with --resume."
        )
    return read_json(file)


def library_versions() -> dict[str, str]:
    """Return the versions of the libraries that decide about a training's result."""
    return {k: v for k, v in versions(*_LIBRARIES).items() if k != "python"}


def _name(function: object) -> str:
    return str(getattr(function, "__qualname__", type(function).__qualname__))


def _short(value: Any) -> str:  # noqa: ANN401
    return "other values" if isinstance(value, dict) else repr(value)
