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
    tree = load_tree(origin)
    robot = build(Robot, tree, "", origin)
    check_physics(robot, origin)
    return robot


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
    tree = _read(name)
    parent = tree.pop("extends", None)
    if parent is None:
        return tree
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
