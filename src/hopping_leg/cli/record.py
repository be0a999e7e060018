"""Record a leg that tracks an excitation, for `hop identify`.

The leg is simulated; one with a table [reality] plays the real one (see the shipped `twin`). The
recordings do not give its parameters away: they are filed under the robot that it extends.

With --transport it is the real leg, or `hop emulate`: its drives are checked as by `hop deploy`,
the leg moves to the start of the excitation and plays it under the same joint PD.

Examples:
  hop record fixed-base.parquet moving-base.parquet --robot twin --out recordings
  hop record fixed-base.parquet --robot my_twin.toml --believed legv2 --seed 3
  hop record fixed-base.parquet --robot my_leg.toml --transport /dev/fdcanusb --out recordings
"""

from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console
from rich.progress import Progress

from hopping_leg.cli import record_motors
from hopping_leg.controllers.joint_pd import JointGains
from hopping_leg.errors import UsageError
from hopping_leg.identify.excitation import load_excitation
from hopping_leg.identify.play_excitation import play
from hopping_leg.identify.recording_format import Pair
from hopping_leg.robot import load_robot
from hopping_leg.robot.model import TIMESTEP
from hopping_leg.robot.robot_files import parent_robot


@dataclass(frozen=True)
class Record:
    """What is played on which leg."""

    excitations: tyro.conf.Positional[tuple[Path, ...]]
    """Files from `hop excite`."""
    robot: str | None = None
    """A shipped robot or a .toml file; default twin, with --transport legv2."""
    transport: str | None = None
    """Record from motors: path of an fdcanusb, interface:channel of python-can, or pi3hat."""
    yes: bool = False
    """Arm motors without asking."""
    out: Path = Path("recordings")
    """Folder for the recordings, one Parquet file per excitation."""
    believed: str | None = None
    """Robot that the recordings are filed under, where identification begins; default: the one
    that --robot extends, or --robot itself if it extends none or the motors are real."""
    seed: int = 0
    """Of jitter and sensor noise."""
    stiffness: Pair = JointGains().stiffness
    """Of the joint PD, hip and knee, N m/rad."""
    damping: Pair = JointGains().damping
    """Of the joint PD, hip and knee, N m s/rad."""
    timestep: float = TIMESTEP
    """Physics step, s."""


def run(args: Record) -> None:
    """Play every excitation and write its recording."""
    if not args.excitations:
        raise UsageError("No excitation was given; write one with `hop excite`.")
    if args.seed < 0:
        raise UsageError(f"A seed of {args.seed} has no meaning; give 0 or more.")
    name = args.robot or ("twin" if args.transport is None else "legv2")
    robot = load_robot(name)
    parent = parent_robot(name) if args.transport is None else None
    believed = args.believed or parent or name
    load_robot(believed)
    gains = JointGains(args.stiffness, args.damping)
    loaded = [(path, load_excitation(path)) for path in args.excitations]
    names = [path.stem for path, _ in loaded]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise UsageError(
            f"Two excitations are called '{twice[0]}' and would share a recording; rename one."
        )
    if args.transport is not None:
        record_motors.record(
            [(path.stem, excitation) for path, excitation in loaded],
            robot,
            transport=args.transport,
            believed=believed,
            gains=gains,
            out=args.out,
            yes=args.yes,
        )
        return
    console = Console()
    with Progress(console=Console(stderr=True)) as bar:
        for number, (path, excitation) in enumerate(loaded):
            task = bar.add_task(path.stem, total=len(excitation))
            recording = play(
                excitation,
                robot,
                believed=believed,
                seed=args.seed + number,
                gains=gains,
                timestep=args.timestep,
                on_tick=lambda done, _, task=task: bar.update(task, completed=done),  # type: ignore[misc]
            )
            file = args.out / f"{robot.name}-{path.stem}.parquet"
            recording.save(file)
            console.print(f"Wrote {file}", highlight=False, soft_wrap=True)
            for warning in recording.warnings:
                console.print(f"  {warning}", highlight=False)
