"""List the legs, show every number of one with its source, check your own file.

A robot is a TOML file; your own may extend a shipped one and change only what differs.

Examples:
  hop robots list
  hop robots show legv2-paper
  hop robots check examples/my_leg.toml
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import tyro

from hopping_leg.cli.options import save_json, say, show_table
from hopping_leg.robot import Robot, build_model, numbers, robot_files

Target = tyro.conf.Positional[str]


@dataclass(frozen=True)
class List:
    """List the robots that come with the package."""

    json: Path | None = None
    """Write the list to this file as JSON."""


@dataclass(frozen=True)
class Show:
    """Show every number of a robot with unit and source, e.g. `hop robots show legv2`."""

    robot: Target
    """A shipped name or the path of a .toml file."""
    json: Path | None = None
    """Write the numbers to this file as JSON."""


@dataclass(frozen=True)
class Check:
    """Check a robot file, e.g. `hop robots check my_leg.toml`; exit code 2 when it is wrong."""

    robot: Target
    """The path of a .toml file, or a shipped name."""


def run(args: List | Show | Check) -> None:
    """List, show or check robots."""
    if isinstance(args, List):
        robots = [robot_files.load_robot(name) for name in robot_files.shipped_robots()]
        for robot in robots:
            print(f"{robot.name:<12}  {robot.description}\n{'':<12}  {_summary(robot)}")
        save_json(args.json, [{"name": r.name, **derived(r)} for r in robots])
    elif isinstance(args, Show):
        tree = robot_files.load_tree(args.robot)
        robot, doubted = (
            robot_files.robot_from_tree(tree, args.robot),
            robot_files.doubts(args.robot),
        )
        rows = [(p, f"{e['value']:g}", e["unit"], e["source"]) for p, e in numbers(tree)]
        for path, value in derived(robot).items():
            shown = f"{value:g}" if isinstance(value, float) else value
            rows.append((path, shown, "", "computed"))
        title = f"{robot.name}: {robot.description}"
        show_table(("number", "value", "unit", "source"), rows, title)
        say(*doubted)
        facts = {**asdict(robot), "derived": derived(robot), "doubts": doubted}
        save_json(args.json, facts)
    else:
        robot = robot_files.robot_from_tree(robot_files.load_tree(args.robot), args.robot)
        doubted = robot_files.doubts(args.robot)
        build_model(robot)
        print(f"{args.robot} is a valid robot: {robot.name} ({_summary(robot)}).")
        say(*(f"But {doubt}" for doubt in doubted))


def derived(robot: Robot) -> dict[str, Any]:
    """Return the numbers that follow from a robot's parameters, SI units."""
    return {
        "mass_kg": robot.mass,
        "straight_height_m": robot.straight_height,
        "hip_torque_limit_nm": robot.hip.torque_limit,
        "knee_torque_limit_nm": robot.knee.torque_limit,
        "hip_armature_kg_m2": robot.hip.armature,
        "knee_armature_kg_m2": robot.knee.armature,
        "digest": robot.digest,
    }


def _summary(robot: Robot) -> str:
    return (
        f"links {robot.thigh.length:g} + {robot.shank.length:g} m, mass {robot.mass:.3f} kg,"
        f" torque limits {robot.hip.torque_limit:g} and {robot.knee.torque_limit:g} N m"
    )
