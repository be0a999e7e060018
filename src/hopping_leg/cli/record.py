"""Write an excitation, and record a leg that tracks it, for `hop identify`.

`fixed-base`, `moving-base` and `multisine` write the joints' targets, checked for reach, joint
range, speed and torque. `play` tracks them on a leg. Without a transport the leg is simulated; one
with a table [reality] plays the real one (see the shipped `twin`). The recordings do not give its
parameters away: they are filed under the robot that it extends. With --transport it is the real
leg, or `hop emulate`: its drives are checked as by `hop deploy`, the leg moves to the start of the
excitation and plays it under the same joint PD.

Examples:
  hop record fixed-base --robot legv2 --out fixed-base.parquet
  hop record moving-base --robot legv2 --out moving-base.parquet
  hop record multisine --centre 0.7 -1.4 --amplitude 0.3 0.4 --out multisine.parquet
  hop record play fixed-base.parquet moving-base.parquet --robot twin --out recordings
  hop record play fixed-base.parquet --robot my_leg.toml --transport /dev/fdcanusb
"""

import contextlib
from collections.abc import Generator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import tyro

from hopping_leg.cli import motors
from hopping_leg.cli.options import RobotFile, at_least, say, say_written, show_table
from hopping_leg.deploy import safety_limits, stop_reasons
from hopping_leg.errors import HardwareError, UsageError
from hopping_leg.identify import paper_excitation as paper
from hopping_leg.identify.excitation import (
    RATE,
    Excitation,
    Multisine,
    Template,
    demand,
    load_excitation,
    make_excitation,
)
from hopping_leg.identify.recording_format import Pair
from hopping_leg.robot import TIMESTEP, Robot, load_robot, parent_robot
from hopping_leg.terminal import Progress

if TYPE_CHECKING:
    from hopping_leg.controllers.joint_pd import JointGains
    from hopping_leg.identify.recording import Recording


@dataclass(frozen=True)
class Common:
    """What every excitation needs."""

    robot: RobotFile = "legv2"
    out: Path = Path("excitation.parquet")
    """Parquet file to write."""
    rate: float = RATE
    """Targets per second, Hz."""
    track_velocity: bool = False
    """Velocity targets are the positions' derivative, as in the lab's recordings, not zero."""


@dataclass(frozen=True)
class MovingBase(Common):
    """The paper's moving-base trajectory: vertical strokes on the ground."""

    amplitudes: tuple[float, ...] = paper.AMPLITUDES
    """Amplitudes of the strokes, the paper's A, m."""
    periods: tuple[float, ...] = paper.PERIODS
    """Periods of the strokes, the paper's T1, s."""
    duration: float = paper.DURATION
    """Duration of all strokes together, s."""
    margin: float = 0.0
    """How far the leg stays from straight, m; 0 is the paper's text, 0.005 the lab's recordings."""
    bend: paper.Bend = "backward"
    """Side of the knee; the lab's fixed-base recordings bend forward."""
    adapt: bool = True
    """Shrink amplitudes that the leg cannot follow; --no-adapt: refuse them."""


@dataclass(frozen=True)
class FixedBase(MovingBase):
    """The paper's fixed-base trajectory: the foot strokes while the leg swings."""

    swings: tuple[float, ...] = paper.SWINGS
    """Periods of the swinging leg, the paper's T2, s."""


@dataclass(frozen=True)
class MultisineCommand(Common):
    """Harmonics of hip and knee around a posture, base clamped."""

    signal: Annotated[Multisine, tyro.conf.arg(name="")] = field(default_factory=Multisine)


@dataclass(frozen=True)
class Play:
    """Play excitations on a leg and record it, e.g. `hop record play motion.parquet`."""

    excitations: tyro.conf.Positional[tuple[Path, ...]]
    """Files of the other kinds of `hop record`."""
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
    """Seed of jitter and sensor noise."""
    stiffness: Pair | None = None
    """Stiffness of the joint PD, hip and knee, N m/rad; default: fits leg V2."""
    damping: Pair | None = None
    """Damping of the joint PD, hip and knee, N m s/rad; default: fits leg V2."""
    timestep: float = TIMESTEP
    """Physics step, s."""


def run(
    args: FixedBase
    | MovingBase
    | Annotated[MultisineCommand, tyro.conf.subcommand(name="multisine")]
    | Play,
) -> None:
    """Write an excitation and show what it asks of the leg, or play some and record."""
    if isinstance(args, Play):
        _play(args)
        return
    robot = load_robot(args.robot)
    template: Template
    if isinstance(args, MultisineCommand):
        template = args.signal
    else:
        make = paper.moving_base
        if isinstance(args, FixedBase):
            make = partial(paper.fixed_base, swings=args.swings)
        template = make(
            args.amplitudes, args.periods,
            duration=args.duration, margin=args.margin, bend=args.bend,
        )  # fmt: skip
        if args.adapt:
            template = paper.adapt(template, robot, rate=args.rate)
    excitation = make_excitation(
        template, robot, rate=args.rate, track_velocity=args.track_velocity
    )
    excitation.save(args.out)
    asked = demand(robot, excitation.rig, excitation.position, excitation.rate)
    largest = {
        "lowest, rad": asked.position.min(axis=0),
        "highest, rad": asked.position.max(axis=0),
        "speed, rad/s": np.abs(asked.velocity).max(axis=0),
        "torque, N m": np.abs(asked.torque).max(axis=0),
    }
    show_table(
        ("", "hip", "knee"),
        [(name, *(f"{x:.3g}" for x in pair)) for name, pair in largest.items()],
        f"{args.out}: {len(excitation)} targets for {robot.name}",
    )
    say(*excitation.description.split("; "))


def _play(args: Play) -> None:
    from hopping_leg.controllers.joint_pd import JointGains

    if not args.excitations:
        raise UsageError("No excitation was given; write one with `hop record fixed-base`.")
    at_least(0, seed=args.seed)
    name = args.robot or ("twin" if args.transport is None else "legv2")
    robot = load_robot(name)
    parent = parent_robot(name) if args.transport is None else None
    believed = args.believed or parent or name
    load_robot(believed)
    own = {"stiffness": args.stiffness, "damping": args.damping}
    gains = JointGains(**{key: pair for key, pair in own.items() if pair is not None})
    loaded = {path.stem: load_excitation(path) for path in args.excitations}
    if len(loaded) < len(args.excitations):
        raise UsageError("Excitations share a name and would share a recording; rename one.")
    record = _simulated if args.transport is None else _measured
    with contextlib.closing(record(args, robot, loaded, believed, gains)) as recordings:
        for stem, recording in recordings:
            file = args.out / f"{robot.name}-{stem}.parquet"
            recording.save(file)
            say_written(file)
            say(*(f"  {warning}" for warning in recording.warnings))


def _simulated(
    args: Play, robot: Robot, excitations: dict[str, Excitation], believed: str, gains: "JointGains"
) -> "Generator[tuple[str, Recording]]":
    from hopping_leg.identify.play_excitation import play

    with Progress(parts=len(excitations)) as bar:
        for number, (stem, excitation) in enumerate(excitations.items()):
            played = play(
                excitation, robot, believed=believed, seed=args.seed + number, gains=gains,
                timestep=args.timestep,
                on_tick=lambda done, ticks: bar.show(stem, done / ticks),  # noqa: B023
            )  # fmt: skip
            yield stem, played


def _measured(
    args: Play, robot: Robot, excitations: dict[str, Excitation], believed: str, gains: "JointGains"
) -> "Generator[tuple[str, Recording]]":
    """Record motors; refuse a run that did not end by itself."""
    from hopping_leg.controllers import command_schedule, joint_pd
    from hopping_leg.deploy import hardware_trials, keyboard, motion_sequence
    from hopping_leg.identify.play_excitation import recording_of

    transport, rates = str(args.transport), {e.rate for e in excitations.values()}
    if len(rates) > 1:
        raise UsageError("The excitations have different rates; record them one by one.")
    rate = rates.pop()
    limits = safety_limits.recording_limits(robot, rate)
    with motors.connect(robot, transport) as link:
        drives = motors.check(link, robot, limits)
        for name, excitation in excitations.items():
            seconds = len(excitation) / rate
            motors.ask(
                f"{robot.name} on the {excitation.rig} will play {name} for {seconds:.0f} s; keep a"
                " hand on the switch.",
                yes=args.yes,
            )
            controller = joint_pd.JointPD(excitation.position, excitation.velocity, gains)
            fixed, poses = excitation.rig == "fixed-base", motion_sequence.hopping_poses(robot)
            sequence = motion_sequence.MotionSequence(
                controller,
                command_schedule.CommandSchedule(((float("nan"), 1.0),)),
                motion_sequence.Poses(excitation.position[0], np.zeros(2) if fixed else poses.rest),
                None,
                motion_sequence.SequenceTiming(hop=seconds),
                gains,
            )
            done = hardware_trials.perform(
                link, sequence, limits, hardware_trials.new_path(args.out / "traces", name),
                facts={"transport": transport, "drives": drives},
                beside=lambda loop: keyboard.keys(None, loop.stop, say),
            )  # fmt: skip
            say(*done.notices)
            state = done.outcome.supervisor
            if state.stop_cause.reason is not stop_reasons.Reason.FINISHED or done.complaint:
                raise HardwareError(
                    f"{name} was stopped: {state.stop_cause} {state.cause} {done.complaint} Its"
                    f" trace is {done.path}."
                )
            filed = {"believed": believed, "name": f"{robot.name}-{name}.parquet"}
            yield name, recording_of(done.trace, excitation, gains=gains, **filed)
