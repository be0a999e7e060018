"""Controllers by name: energy shaping, teacher, policies, a user's policy, gain file or class."""

import shlex
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from hopping_leg.controllers import energy_shaping, mpc, protocol, user_controllers
from hopping_leg.controllers.energy_shaping.gains import load_gains
from hopping_leg.controllers.policy import Policy
from hopping_leg.errors import PolicyError, UsageError, unknown_name
from hopping_leg.io import parse_toml
from hopping_leg.robot import DEFAULT_ROBOT, Robot, load_robot, shipped_robots
from hopping_leg.sim import CONTROL_RATE

ENERGY_SHAPING = "energy-shaping"
"""The baseline, tuned on the leg of its gain file."""

ENERGY_SHAPING_TUNED = "energy-shaping-tuned"
"""The same, tuned on drawn twins, for a leg that nobody tuned it on."""

_FLYING = "energy-shaping-flying"  # tuned to fly half of the time, as is asked of policies
_LITERAL = "energy-shaping-literal"  # the paper's law and gains as printed

MPC_TRUE_STATE = "mpc-true-state"
"""Plans every push in the true state: in simulation alone."""

POLICY_FILES = (".onnx", ".zip")
"""How names of policies, and of networks of which they are made, end."""

ROBOT_FILE = "robot.toml"
"""The robot of a training, in the folder of its policy."""

_BUILT_IN = (ENERGY_SHAPING, ENERGY_SHAPING_TUNED, _FLYING, _LITERAL, MPC_TRUE_STATE)
_SHIPPED = resources.files("hopping_leg") / "policies"


def shipped_policies() -> list[str]:
    """Return the names of the policies that come with the package."""
    return sorted(
        f.name.removesuffix(".onnx") for f in _SHIPPED.iterdir() if f.name.endswith(".onnx")
    )


def controller_names() -> list[str]:
    """Return every name that ``load_controller`` knows."""
    return [*_BUILT_IN, *shipped_policies()]


def load_policy(name_or_path: str | Path) -> Policy:
    """Load a shipped policy or a file; PolicyError for a bad file, UsageError for no such name."""
    name = str(name_or_path)
    if name in shipped_policies():
        return Policy((_SHIPPED / f"{name}.onnx").read_bytes(), f"shipped policy '{name}'", name)
    if name.endswith(POLICY_FILES):
        return Policy.load(Path(name))
    if name.endswith((".urdf", ".xml")):
        words = shlex.join(["hop", "robots", "import", name])
        raise UsageError(f"{name} is no controller; make a robot file of it: {words}.")
    if Path(name).exists():
        raise PolicyError(
            f"{name} is not a policy file, {' or '.join(POLICY_FILES)}; `hopping_leg.export_policy`"
            " writes one of a model in memory."
        )
    raise UsageError(
        unknown_name("controller", name, controller_names())
        + " Or give an .onnx file, or a Python class as path/to/file.py:CLASS."
    )


def robot_of(controllers: Sequence[str]) -> str:
    """Return the robot that the first policy or gain file among controllers was made for alone.

    It is a shipped name, or the file that a training leaves beside its policy or that ``NAME.toml``
    there names; without any, the default robot.
    """
    for text in controllers:
        name = text if Path(text).exists() else text.rpartition("=")[2]
        if name in shipped_policies() or (name.endswith(POLICY_FILES) and Path(name).is_file()):
            policy = load_policy(name)
            if not policy.for_any_leg:
                card, told = policy.card, Path(name).with_suffix(".toml")
                own = parse_toml(told.read_bytes(), str(told)) if told.is_file() else {}
                files = [told.with_name(ROBOT_FILE), told.parent / str(own.get("robot", ""))]
                shipped = [card.robot] if card.robot in shipped_robots() else []
                there = [*shipped, *map(str, filter(Path.is_file, files))]
                fit = (r for r in there if load_robot(r).has_digest(card.robot_digest))
                return next(fit, shipped[0] if shipped else DEFAULT_ROBOT)
        if name.endswith(".toml") and Path(name).is_file():
            robot = load_gains(name).robot
            return robot if robot in shipped_robots() or Path(robot).is_file() else DEFAULT_ROBOT
    return DEFAULT_ROBOT


def load_controller(
    name_or_path: str | Path,
    robot: Robot,
    *,
    rate: float = CONTROL_RATE,
    simulated: bool = False,
) -> protocol.Controller:
    """Load a controller for a robot that it shall drive at a rate, Hz.

    It is one of ``controller_names()``, a file for ``Policy.load``, a gain file (``.toml``) for
    energy shaping, or a Python class, see ``user_controllers``; of a ``simulated`` leg it may see
    the true state.

    Raises:
        PolicyError: The file is missing, truncated or foreign, or does not fit the rate.
        ControllerError: A Python class cannot be loaded or is no controller.
        UsageError: There is no such controller, or it needs a simulated leg.
    """
    name = str(name_or_path)
    if name == MPC_TRUE_STATE:
        if not simulated:
            raise UsageError(
                f"{name} sees the true state, which only `hop evaluate` and studies know; choose"
                f" another controller, e.g. {ENERGY_SHAPING}."
            )
        return mpc.TrueStateMpc(robot, rate=rate)
    if name == _LITERAL:
        return energy_shaping.paper_energy_shaping(robot, rate=rate)
    if name in _BUILT_IN or name.endswith(".toml"):
        return energy_shaping.tuned_energy_shaping(robot, rate=rate, gains=name)
    if user_controllers.is_user_controller(name):
        return user_controllers.load_user_controller(name, robot, rate)
    policy = load_policy(name_or_path)
    if rate != (trained := policy.card.rate):
        raise PolicyError(
            f"{policy.origin} was trained at {trained:g} Hz and cannot run at {rate:g} Hz;"
            f" set --rate {trained:g}."
        )
    policy.set_robot(robot)
    return policy
