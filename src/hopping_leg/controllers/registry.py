"""Controllers by name: energy shaping, mpc, policies, a user's policy, gain file or class."""

from collections.abc import Callable, Sequence
from functools import partial
from importlib import resources
from pathlib import Path

from hopping_leg.controllers import energy_shaping, mpc, protocol, user_controllers
from hopping_leg.controllers.policy import OtherRobot, Policy
from hopping_leg.errors import PolicyError, UsageError, unknown_name
from hopping_leg.robot import DEFAULT_ROBOT, Robot, shipped_robots
from hopping_leg.sim import CONTROL_RATE

ENERGY_SHAPING = "energy-shaping"
"""The tuned baseline."""

ENERGY_SHAPING_FLYING = "energy-shaping-flying"
"""The same, tuned to fly for half of the time at every command, as is asked of policies."""

ENERGY_SHAPING_LITERAL = "energy-shaping-literal"
"""The paper's law and gains as printed."""

MPC_TRUE_STATE = "mpc-true-state"
"""Plans every push in the true state: in simulation alone."""

_FACTORIES: dict[str, Callable[..., protocol.Controller]] = {
    ENERGY_SHAPING: energy_shaping.tuned_energy_shaping,
    ENERGY_SHAPING_FLYING: partial(
        energy_shaping.tuned_energy_shaping, gains=ENERGY_SHAPING_FLYING
    ),
    ENERGY_SHAPING_LITERAL: energy_shaping.paper_energy_shaping,
    MPC_TRUE_STATE: mpc.TrueStateMpc,
}
_SHIPPED = resources.files("hopping_leg") / "policies"


def shipped_policies() -> list[str]:
    """Return the names of the policies that come with the package."""
    return sorted(
        f.name.removesuffix(".onnx") for f in _SHIPPED.iterdir() if f.name.endswith(".onnx")
    )


def shipped_card(name: str) -> str:
    """Return the model card of a shipped policy, Markdown."""
    return (_SHIPPED / f"{name}.md").read_text(encoding="utf-8")


def controller_names() -> list[str]:
    """Return every name that ``load_controller`` knows."""
    return [*_FACTORIES, *shipped_policies()]


def load_policy(name_or_path: str | Path) -> Policy:
    """Load a shipped policy by name or a policy file.

    Raises:
        PolicyError: The file is missing, truncated or foreign.
        UsageError: There is no such shipped policy.
    """
    name = str(name_or_path)
    if name in shipped_policies():
        return Policy((_SHIPPED / f"{name}.onnx").read_bytes(), f"shipped policy '{name}'", name)
    if name.endswith(".onnx"):
        return Policy.load(Path(name))
    if Path(name).exists():
        raise PolicyError(f"{name} is not a policy file; those end in .onnx.")
    raise UsageError(
        unknown_name("controller", name, controller_names())
        + " Or give an .onnx file, or a Python class as path/to/file.py:CLASS."
    )


def robot_of(controllers: Sequence[str]) -> str:
    """Return the shipped robot that the first policy among controllers was trained on.

    Without such a policy it is the default robot.
    """
    for name in controllers:
        if name in shipped_policies() or (name.endswith(".onnx") and Path(name).is_file()):
            robot = load_policy(name).card.robot
            return robot if robot in shipped_robots() else DEFAULT_ROBOT
    return DEFAULT_ROBOT


def load_controller(
    name_or_path: str | Path,
    robot: Robot,
    *,
    rate: float = CONTROL_RATE,
    other: OtherRobot = "warn",
    simulated: bool = False,
) -> protocol.Controller:
    """Load a controller for a robot.

    Args:
        name_or_path: One of ``controller_names()``, the path of an ``.onnx`` file or of a gain
            file (``.toml``) for energy shaping, or a Python class, see ``user_controllers``.
        robot: The leg it shall drive.
        rate: Control rate, Hz.
        other: See ``OtherRobot``.
        simulated: Whether the leg is a simulated one, whose true state a controller may see.

    Raises:
        PolicyError: The file is missing, truncated or foreign, or does not fit the robot or rate.
        ControllerError: A Python class cannot be loaded or is no controller.
        UsageError: There is no such controller, or it needs a simulated leg.
    """
    name = str(name_or_path)
    if name in _FACTORIES:
        if name == MPC_TRUE_STATE and not simulated:
            raise UsageError(
                f"{name} sees the true state, which only `hop evaluate` and studies know; choose"
                f" another controller, e.g. {ENERGY_SHAPING}."
            )
        return _FACTORIES[name](robot, rate=rate)
    if name.endswith(".toml"):
        return energy_shaping.tuned_energy_shaping(robot, rate=rate, gains=name)
    if user_controllers.is_user_controller(name):
        return user_controllers.load_user_controller(name, robot, rate)
    policy = load_policy(name_or_path)
    policy.check_robot(robot, rate, other=other)
    return policy
