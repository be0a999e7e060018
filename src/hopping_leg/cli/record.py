"""Record a leg that tracks an excitation, for `hop identify`.

The leg is simulated; one with a table [reality] plays the real one (see the shipped `twin`). The
recordings do not give its parameters away: they are filed under the robot that it extends.

Examples:
  hop record fixed-base.parquet moving-base.parquet --robot twin --out recordings
  hop record fixed-base.parquet --robot my_twin.toml --believed legv2 --seed 3
"""

from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console
from rich.progress import Progress

from hopping_leg.control.joint_pd import JointGains
from hopping_leg.errors import UsageError
from hopping_leg.identify.excitation import load_excitation
from hopping_leg.identify.playing import play
from hopping_leg.identify.setup import Pair
from hopping_leg.robot import load_robot
from hopping_leg.robot.files import parent_robot
from hopping_leg.robot.model import TIMESTEP


@dataclass(frozen=True)
class Record:
    """What is played on which leg."""

    excitations: tyro.conf.Positional[tuple[Path, ...]]
    """Files from `hop excite`."""
    robot: str = "twin"
    """A shipped robot or a .toml file."""
    out: Path = Path("recordings")
    """Folder for the recordings, one Parquet file per excitation."""
    believed: str | None = None
    """Robot that the recordings are filed under, where identification begins; default: the one
    that --robot extends, or --robot itself if it extends none."""
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
    robot = load_robot(args.robot)
    believed = args.believed or parent_robot(args.robot) or args.robot
    load_robot(believed)
    gains = JointGains(args.stiffness, args.damping)
    loaded = [(path, load_excitation(path)) for path in args.excitations]
    names = [path.stem for path, _ in loaded]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise UsageError(
            f"Two excitations are called '{twice[0]}' and would share a recording; rename one."
        )
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
            console.print(f"Wrote {file}", highlight=False)
            for warning in recording.warnings:
                console.print(f"  {warning}", highlight=False)
