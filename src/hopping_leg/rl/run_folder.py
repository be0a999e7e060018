"""The folder of one training: what it was asked for, checkpoints, results, the model card."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from hopping_leg.controllers.observation_history import OBSERVATION_HISTORIES, Dated
from hopping_leg.controllers.registry import ROBOT_FILE
from hopping_leg.errors import UsageError
from hopping_leg.io import parse_json, versions, write_atomically, write_json
from hopping_leg.locks import FOLDER_LOCK
from hopping_leg.rl import checkpoint
from hopping_leg.rl.recipe import Recipe
from hopping_leg.robot import TIMESTEP, Robot, robot_text, robot_tree, shipped_robots
from hopping_leg.sim.any_leg import GROUND, TRANSMISSIONS, WEAK

_LIBRARIES = ("hopping-leg", "mujoco", "numpy", "onnxruntime", "stable-baselines3", "torch")

_ASKED = ("recipe", "robot_digest", "seed", "minutes_budget", "options")
"""What a run must have been asked for alike to go on."""

MISSED = 0.02
"""Median error beyond which a policy misses its command, m; the robustness suite's."""

NOT_MET = (
    "Not met in training: loads that slosh or swing, wrong homing, links that are longer or shorter"
    f" than told, knees with less than {TRANSMISSIONS[3].low:g} N m/rad (leg V2's size), ground"
    f" slower than {GROUND[0].high:g} s, hips with less than {100 * WEAK[0].low:.0f} % torque."
)
"""What a policy for any leg has not learned."""


class RunFolder:
    """Paths and files of one run."""

    def __init__(
        self, path: Path, recipe: Recipe, robot: Robot, seed: int, minutes: float | None
    ) -> None:
        self.path, self.checkpoints = path, path / "checkpoints"
        self.policy = path / "policy.onnx"
        """The selected policy, once the training is over."""
        self._robot = robot
        config = {
            "recipe": recipe.name,
            "options": asdict(recipe),
            "robot": robot.name,
            "robot_digest": robot.digest,
            "seed": seed,
            "minutes_budget": minutes,
            "versions": {k: v for k, v in versions(*_LIBRARIES).items() if k != "python"},
        }
        named = json.dumps(
            config, default=lambda f: getattr(f, "__qualname__", type(f).__qualname__)
        )
        self.config: dict[str, Any] = json.loads(named)
        """What the run was asked for, as JSON values."""

    def begin(self, *, new: bool) -> checkpoint.Tree | None:
        """Return a run's last checkpoint, if any; ``UsageError`` where the run is finished."""
        if new:
            write_json(self.path / "config.json", self.config)
            write_robot(self.path, self._robot)
            return None
        if self.policy.exists():
            raise UsageError(f"The run in {self.path} is finished; it made {self.policy}.")
        found = checkpoint.list_checkpoints(self.checkpoints)
        return checkpoint.read_checkpoint(found[-1]) if found else None

    def check_same(self) -> None:
        """Raise ``UsageError`` that names what else the run in the folder was asked for."""
        file = self.path / "config.json"
        stored = parse_json(file.read_bytes(), str(file))
        for key in _ASKED:
            if stored.get(key) != self.config[key]:
                raise UsageError(
                    f"The run in {self.path} has another {key.replace('_', ' ')}; resume it with"
                    " the options that it began with."
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
    return parse_json(file.read_bytes(), str(file))


def model_card(result: dict[str, Any]) -> str:
    """Return the card of a training, as Markdown, from its result."""
    selected, task, name = result["selected"], result["options"]["task"], result["robot"]
    commands = result["command_bounds"]
    versions = ", ".join(f"{name} {number}" for name, number in result["versions"].items())
    robot = f"`{name}`" if name in shipped_robots() else f"{name}, `{ROBOT_FILE}` in this folder"
    any_leg = result["options"]["legs"] == "any"
    legs = "any leg of this kind;\nthe trials below are on" if any_leg else "robot"
    dated = issubclass(OBSERVATION_HISTORIES[task["observation"]], Dated)
    age = ",\namong them the age of each joint sample, which the paper's 15 lack" if dated else ""
    steps, took, tried = selected["steps"], selected["minutes"], len(result["history"])
    chosen = f"- Selection: the policy after {steps} steps ({took:.1f} min) of {tried} snapshots.\n"
    limits = "".join(f"\n{limit}\n" for limit in known_limits(selected["trials"], any_leg))
    return f"""# Policy `{result["recipe"]}`, seed {result["seed"]}

One network from joint measurements to joint torques, for {legs} {robot}
(parameters {result["robot_digest"]}), commands {commands[0]:g} to {commands[1]:g} m,
{task["rate"]:g} Hz, inputs `{task["observation"]}`{age}. Made by

    {result["command"]}

- Training: {result["steps"]} control steps, {result["minutes"]:.1f} min of wall-clock time, physics
  step {1000 * task["timestep"]:g} ms.
{chosen if tried > 1 else ""}- Versions: {versions}.

Trials on the selection seeds {", ".join(map(str, selected["seeds"]))}, noise and delay on, physics
step {1000 * TIMESTEP:g} ms, the first 2 s of each trial dropped. These seeds chose the policy;
`hop evaluate policy.onnx` judges it on others, in this folder.

| command m | median error mm | std mm | hops/s | flight % | skipped | body contact ticks\
 | lowest base m |
|---|---|---|---|---|---|---|---|
{"".join(map(_row, selected["trials"]))}{limits}"""


def _row(trial: dict[str, Any]) -> str:
    """Return the line of a command's trials in the table."""
    skipped, error, std = trial["skipped_hops"], trial["median_error_m"], trial["std_m"]
    return (
        f"| {trial['command_m']:g} | {_mm(error)} | {_mm(std)} | {trial['hops_per_s']:.2f}"
        f" | {100 * trial['flight_fraction']:.0f} | {skipped} of {trial['hops'] + skipped}"
        f" | {trial['body_contact_ticks']} | {trial['min_height_m']:.3f} |\n"
    )


def known_limits(trials: list[dict[str, Any]], any_leg: bool) -> tuple[str, ...]:
    """Return sentences on commands missed in its own simulation and on what training never met."""
    missed = [
        f"{command:g} m ({'no hops' if error is None else f'{1000 * error:+.0f} mm'})"
        for command, error in ((t["command_m"], t["median_error_m"]) for t in trials)
        if error is None or abs(error) > MISSED
    ]
    own = f"Commands missed in its own simulation: {', '.join(missed)}; not for any other leg."
    return (*((own,) if missed else ()), *((NOT_MET,) if any_leg else ()))


def _mm(metres: float | None) -> str:
    return "no hops" if metres is None else f"{1000 * metres:.1f}"
