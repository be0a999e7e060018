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

_ASKED = ("recipe", "robot_digest", "seed", "minutes_budget", "source", "options")
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
        self.path, self.checkpoints = path, path / "checkpoints"
        self.policy = path / "policy.onnx"
        """The selected policy, once the training is over."""
        self._recipe, self._robot, self._source = recipe, robot, source
        config = {
            "recipe": recipe.name,
            "options": asdict(recipe),
            "robot": robot.name,
            "robot_digest": robot.digest,
            "seed": seed,
            "minutes_budget": minutes,
            "source": str(source) if source else None,
            "versions": {k: v for k, v in versions(*_LIBRARIES).items() if k != "python"},
        }
        self.config: dict[str, Any] = json.loads(json.dumps(config, default=_name))
        """What the run was asked for, as JSON values."""

    @property
    def command(self) -> str:
        """The command that makes such a run."""
        robot = self._robot.name
        if robot not in shipped_robots() or load_robot(robot) != self._robot:
            robot = str(self.path / ROBOT_FILE)
        words = ["hop", "train", "--recipe", self._recipe.source or self._recipe.name]
        words += ["--robot", robot, "--seed", str(self.config["seed"])]
        if self._source is not None:
            words += ["--source", str(self._source)]
        if self.config["minutes_budget"] is not None:
            words += ["--minutes", f"{self.config['minutes_budget']:g}"]
        return shlex.join([*words, *recipes.words_of(self._recipe)])

    def begin(self, *, resume: bool) -> checkpoint.Tree | None:
        """Prepare the folder; return the newest checkpoint if there is one to resume from.

        Raises:
            UsageError: The folder holds a run and ``resume`` is off, another or finished run,
                or checkpoints of an older version alone.
        """
        new = is_new(self.path, resume=resume)
        if not new:
            self.check_same()
            if self.policy.exists():
                raise UsageError(f"The run in {self.path} is finished; it made {self.policy}.")
        found = checkpoint.list_checkpoints(self.checkpoints)
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
        """Raise ``UsageError`` that names what else the run in the folder was asked for."""
        stored = _read_json(self.path / "config.json")
        for key in _ASKED:
            there, asked = stored.get(key), self.config[key]
            if key == "source" and there and asked:
                there, asked = (str(Path(str(source)).resolve()) for source in (there, asked))
            if there != asked:
                raise UsageError(
                    f"The run in {self.path} has another {key.replace('_', ' ')}"
                    f" ({_short(there)} instead of {_short(asked)});"
                    " resume it with the options that it began with."
                )


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
        raise UsageError(f"{folder} already holds a run; give --resume or another --out.")
    return False


def read_result(path: Path) -> dict[str, Any]:
    """Return a finished run's ``result.json``; ``UsageError`` where there is none."""
    file = path / "result.json"
    if not file.exists():
        raise UsageError(
            f"{path} holds no finished run; repeat the command that began it, with --resume."
        )
    return _read_json(file)


def _read_json(file: Path) -> dict[str, Any]:
    return parse_json(file.read_bytes(), str(file))


def _name(function: object) -> str:
    return str(getattr(function, "__qualname__", type(function).__qualname__))


def _short(value: Any) -> str:  # noqa: ANN401
    return "other values" if isinstance(value, dict) else repr(value)
