"""Robot files: one TOML per leg, every number with its unit and source."""

import tomllib
from importlib import resources
from pathlib import Path

from hopping_leg.errors import RobotError, unknown_name
from hopping_leg.robot.fields import Tree, build, check_physics
from hopping_leg.robot.parameters import Robot

_SHIPPED = resources.files("hopping_leg.robot") / "robots"


def shipped_robots() -> list[str]:
    """Return the names of the robots that come with the package."""
    names = (file.name for file in _SHIPPED.iterdir())
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def load_robot(name_or_path: str | Path) -> Robot:
    """Load a robot by shipped name or from a TOML file.

    Args:
        name_or_path: ``"legv2"``, or the path of a file that ends in ``.toml``.

    Raises:
        RobotError: Naming the file, the field and what was valid.
    """
    origin = str(name_or_path)
    return robot_from_tree(_read(origin), origin)


def robot_from_tree(tree: Tree, origin: str) -> Robot:
    """Return the robot that a file's tables describe, ``extends`` resolved.

    Args:
        tree: The tables as in a file.
        origin: The file's path or another name for it, for messages.

    Raises:
        RobotError: Naming origin, field and what was valid.
    """
    robot = build(Robot, _extend(tree, origin, ()), "", origin)
    check_physics(robot, origin)
    return robot


def parent_robot(name_or_path: str | Path) -> str | None:
    """Return the name or path of the robot that a file extends, None if it stands alone.

    Raises:
        RobotError: The file is missing or not TOML.
    """
    origin = str(name_or_path)
    parent = _read(origin).get("extends")
    return _beside(origin, parent) if isinstance(parent, str) else None


def load_tree(name_or_path: str | Path) -> Tree:
    """Return a robot file as nested tables with units and sources, ``extends`` resolved.

    Raises:
        RobotError: The file, or one that it extends, is missing or not TOML.
    """
    return _resolve(str(name_or_path), ())


def _resolve(name: str, chain: tuple[str, ...]) -> Tree:
    if name in chain:
        circle = " -> ".join((*chain, name))
        raise RobotError(f"{name}: robots extend each other in a circle ({circle}).")
    return _extend(_read(name), name, chain)


def _extend(tree: Tree, name: str, chain: tuple[str, ...]) -> Tree:
    parent = tree.get("extends")
    if "extends" not in tree:
        return tree
    tree = {key: value for key, value in tree.items() if key != "extends"}
    if not isinstance(parent, str):
        raise RobotError(f"{name}: 'extends' must be a robot's name or file, not {parent!r}.")
    return _merge(_resolve(_beside(name, parent), (*chain, name)), tree)


def _beside(name: str, parent: str) -> str:
    """Resolve a parent's path relative to the file that names it."""
    if parent.endswith(".toml") and name.endswith(".toml"):
        return str(Path(name).parent / parent)
    return parent


def _read(name: str) -> Tree:
    shipped = shipped_robots()
    if name.endswith(".toml"):
        path = Path(name)
        if not path.is_file():
            raise RobotError(
                f"There is no robot file {path}; give a .toml file or one of: {', '.join(shipped)}."
            )
        content = path.read_bytes()
    elif name in shipped:
        content = (_SHIPPED / f"{name}.toml").read_bytes()
    else:
        raise RobotError(unknown_name("robot", name, shipped) + " Or give a .toml file.")
    try:
        return tomllib.loads(content.decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RobotError(f"{name} is not valid TOML: {error}.") from error


def _merge(parent: Tree, child: Tree) -> Tree:
    """Return the parent's tables with the child's entries; a number is replaced as a whole."""
    merged = dict(parent)
    for key, value in child.items():
        inherited = merged.get(key)
        if isinstance(value, dict) and isinstance(inherited, dict) and "value" not in value:
            value = _merge(inherited, value)
        merged[key] = value
    return merged
