"""List the legs, show every number of one with its source, import or check your own.

A robot is a TOML file; your own may extend a shipped one and change only what differs, or be
imported from URDF or MJCF.

Examples:
  hop robots list
  hop robots show legv2-paper
  hop robots import leg.urdf --motor qdd100
  hop robots check examples/my_leg.toml
  hop robots draw twins --count 20 --out runs/twins
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from hopping_leg.cli.options import answer, at_least, say, show_table
from hopping_leg.errors import UsageError
from hopping_leg.io import write_atomically
from hopping_leg.robot import Robot, build_model, importing, numbers, robot_files
from hopping_leg.robot.planar_leg import NoFootError, read_leg


@dataclass(frozen=True)
class List:
    """List the robots that come with the package."""


@dataclass(frozen=True)
class Show:
    """Show every number of a robot with unit and source, e.g. `hop robots show legv2`."""

    robot: tyro.conf.Positional[str]
    """A shipped name or the path of a .toml file."""


@dataclass(frozen=True)
class Check:
    """Check a robot file, e.g. `hop robots check my_leg.toml`; exit code 2 when it is wrong."""

    robot: tyro.conf.Positional[str]
    """The path of a .toml file, or a shipped name."""


@dataclass(frozen=True)
class Import:
    """Make a robot file of a leg's URDF or MJCF, e.g. `hop robots import leg.urdf --motor qdd100`.

    Meshes are not read. What the file does not say is assumed and listed, or asked for by its name;
    every number in the robot file says where it comes from.
    """

    description: tyro.conf.Positional[Path]
    """The URDF or MJCF file."""
    hip: str | None = None
    """Hip's joint; default: found by structure and usual names."""
    knee: str | None = None
    """Knee's joint; default: found likewise."""
    foot: str | None = None
    """Link, body, site or geom at the foot's centre; default: found, or at `--set shank.length`."""
    motor: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ()
    """Motor of both joints, or the hip's and the knee's: qdd100, ak80-9 or ak80-6."""
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=NUMBER ...")] = ()
    """Numbers that the file does not say, or says wrongly, in SI units, e.g. `--set
    knee.belt_ratio=2 motor.gear_ratio=9`; motor.X is that of both joints."""
    out: Path | None = None
    """The robot file; default: the file's name with .toml, in this folder."""


@dataclass(frozen=True)
class Draw:
    """Draw legs that nobody built and write their robot files, e.g. `hop robots draw twins`."""

    kind: tyro.conf.Positional[Literal["twins", "legs"]]
    """Twins, which differ from leg V2 in what a fit can find and in what it cannot; or legs of
    other links, masses and motors, whose files tell all of them."""
    count: int = 20
    """How many."""
    seed: int = 0
    """Seed of the first; each has the next."""
    out: Path = Path("runs/robots")
    """Folder for the files."""


def run(
    args: List | Show | Annotated[Import, tyro.conf.subcommand(name="import")] | Check | Draw,
) -> None:
    """List, show, import, check or draw robots."""
    if isinstance(args, List):
        for robot in map(robot_files.load_robot, robot_files.shipped_robots()):
            print(f"{robot.name:<12}  {robot.description}\n{'':<12}  {_summary(robot)}")
    elif isinstance(args, Import):
        _import(args)
    elif isinstance(args, Draw):
        from hopping_leg.sim.any_leg import draw_leg
        from hopping_leg.sim.randomization import draw_twin

        at_least(1, count=args.count)
        at_least(0, seed=args.seed)
        draw = draw_twin if args.kind == "twins" else draw_leg
        for drawn in map(draw, range(args.seed, args.seed + args.count)):
            drawn.save(args.out / f"{drawn.robot.name}.toml")
        print(f"Wrote {args.count} robot files to {args.out}.")
    else:
        tree = robot_files.load_tree(args.robot)
        robot = robot_files.robot_from_tree(tree, args.robot)
        if isinstance(args, Show):
            rows = [(p, f"{e['value']:g}", e["unit"], e["source"]) for p, e in numbers(tree)]
            rows.append(("digest", robot.digest, "", "computed"))
            title = f"{robot.name}: {robot.description} ({_summary(robot)})"
            show_table(("number", "value", "unit", "source"), rows, title)
        else:
            build_model(robot)
            print(f"{args.robot} is a valid robot: {robot.name} ({_summary(robot)}).")
        say(*(f"But {doubt}" for doubt in robot_files.doubts(args.robot)))


def _import(args: Import) -> None:
    out = args.out or Path(f"{args.description.stem}.toml")
    if out.exists():
        raise UsageError(f"{out} exists and is not replaced; remove it, or give another --out.")
    values = importing.read_values(args.set)
    names = args.description, args.hip, args.knee, args.foot
    try:
        leg = read_leg(*names, values.get("shank.length"))
    except NoFootError as error:
        if not (said := answer(f"{error}\nLength of the shank, from knee to foot, in m:")):
            raise
        values |= importing.read_values((f"shank.length={said}",))
        leg = read_leg(*names, values["shank.length"])
    tree, comment = importing.imported_robot(leg, str(args.description), args.motor, values)
    robot = robot_files.robot_from_tree(tree, str(out))
    build_model(robot)
    write_atomically(out, robot_files.robot_text(tree, comment).encode())
    say(*comment.splitlines())
    for path, entry in numbers(tree):
        if (why := entry["source"]).startswith("assumed: "):
            unit = f" {entry['unit']}".removesuffix(" 1")
            say(f"Assumed: {path} = {entry['value']:g}{unit} ({why[9:]})")
    say(f"Wrote {out}: {robot.name} ({_summary(robot)}).")
    say(*(f"But {doubt}" for doubt in [*leg.doubts, *robot_files.doubts(out)]))


def _summary(robot: Robot) -> str:
    return (
        f"links {robot.thigh.length:g} + {robot.shank.length:g} m, mass {robot.mass:.3f} kg,"
        f" torque limits {robot.hip.torque_limit:g} and {robot.knee.torque_limit:g} N m"
    )
