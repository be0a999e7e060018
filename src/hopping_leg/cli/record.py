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
from functools import partial
from pathlib import Path

import numpy as np
import tyro

from hopping_leg.cli import motors, options
from hopping_leg.controllers import command_schedule, joint_pd
from hopping_leg.deploy import hardware_trials, keyboard, safety_limits, stop_reasons
from hopping_leg.deploy.motion_sequence import MotionSequence, Poses, SequenceTiming, hopping_poses
from hopping_leg.errors import HardwareError, UsageError
from hopping_leg.identify import play_excitation, recording_format
from hopping_leg.identify.excitation import Excitation, load_excitation
from hopping_leg.progress import ShareProgress
from hopping_leg.robot import TIMESTEP, Robot, load_robot, parent_robot


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
    """Seed of jitter and sensor noise."""
    stiffness: recording_format.Pair = joint_pd.JointGains().stiffness
    """Stiffness of the joint PD, hip and knee, N m/rad."""
    damping: recording_format.Pair = joint_pd.JointGains().damping
    """Damping of the joint PD, hip and knee, N m s/rad."""
    timestep: float = TIMESTEP
    """Physics step, s."""


def run(args: Record) -> None:
    """Play every excitation and write its recording."""
    if not args.excitations:
        raise UsageError("No excitation was given; write one with `hop excite`.")
    options.at_least(0, seed=args.seed)
    name = args.robot or ("twin" if args.transport is None else "legv2")
    robot = load_robot(name)
    parent = parent_robot(name) if args.transport is None else None
    believed = args.believed or parent or name
    load_robot(believed)
    gains = joint_pd.JointGains(args.stiffness, args.damping)
    loaded = [(path.stem, load_excitation(path)) for path in args.excitations]
    names = [name for name, _ in loaded]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise UsageError(
            f"Two excitations are called '{twice[0]}' and would share a recording; rename one."
        )
    if args.transport is not None:
        _record_motors(args, args.transport, robot, loaded, believed, gains)
        return
    files = []
    with ShareProgress(parts=len(loaded)) as bar:
        for number, (stem, excitation) in enumerate(loaded):
            show = partial(bar.show_tick, stem, len(excitation))
            recording = play_excitation.play(
                excitation,
                robot,
                believed=believed,
                seed=args.seed + number,
                gains=gains,
                timestep=args.timestep,
                on_tick=show,
            )
            file = args.out / f"{robot.name}-{stem}.parquet"
            recording.save(file)
            files.append(file)
            options.say_written(file)
            options.say(*(f"  {warning}" for warning in recording.warnings))
    options.say_next(["hop", "identify", *files, "--robot", believed])


def _record_motors(
    args: Record,
    transport: str,
    robot: Robot,
    excitations: list[tuple[str, Excitation]],
    believed: str,
    gains: joint_pd.JointGains,
) -> None:
    rates = {excitation.rate for _, excitation in excitations}
    if len(rates) > 1:
        raise UsageError("The excitations have different rates; record them one by one.")
    rate = rates.pop()
    limits = safety_limits.recording_limits(robot, rate)
    with motors.connect(robot, transport) as link:
        drives = motors.check(link, robot, limits)
        for name, excitation in excitations:
            seconds = len(excitation) / rate
            motors.ask(
                f"{robot.name} on the {excitation.rig} will play {name} for {seconds:.0f} s; keep a"
                " hand on the switch.",
                yes=args.yes,
            )
            controller = joint_pd.JointPD(excitation.position, excitation.velocity, gains)
            header = hardware_trials.header_of(
                robot, controller, rate, transport=transport, drives=drives
            )
            rest = np.zeros(2) if excitation.rig == "fixed-base" else hopping_poses(robot).rest
            done = hardware_trials.perform(
                link,
                MotionSequence(
                    controller,
                    command_schedule.CommandSchedule(((float("nan"), 1.0),)),
                    Poses(excitation.position[0], rest),
                    None,
                    SequenceTiming(hop=seconds),
                    gains,
                ),
                limits,
                hardware_trials.new_path(args.out / "traces", name),
                header,
                beside=lambda loop: keyboard.keys(None, loop.stop, options.say),
            )
            cause = done.outcome.supervisor.stop_cause
            if cause.reason is not stop_reasons.Reason.FINISHED or done.complaint:
                raise HardwareError(
                    f"{name} was stopped: {cause} {done.complaint} Its trace is {done.path}."
                )
            file = args.out / f"{robot.name}-{name}.parquet"
            recording = play_excitation.recording_of(
                done.trace, excitation, believed=believed, gains=gains, name=file.name
            )
            recording.save(file)
            options.say(*(f"  {notice}" for notice in (*done.notices, *recording.warnings)))
            options.say_written(file)
