"""Run a controller on the real leg, or on `hop emulate`.

The drives are checked first; the leg is armed only when all is well and you agree. It rises to the
start pose, squats, hops, sinks down and stops. Any key but those for the height stops it at once,
as do Ctrl-C, SIGTERM and the end of the terminal; a second signal brakes and leaves. A stop stays
until you call this again. Everything is recorded, also when the process is killed:
`hop report` reads the trace, or the flight recording that a killed run leaves behind.

CONTROLLER is a name (fast, paper, energy-shaping), a policy (.onnx), a gain file (.toml), or a
Python class (path/to/file.py:Class). `hop record play --transport` plays joint trajectories.

Examples:
  hop deploy fast --transport /dev/fdcanusb --command 0.30 --seconds 20
  hop deploy energy-shaping --transport socketcan:can0 --schedule 0.25:5,0.30:5,0.35:5
  hop deploy runs/mine/policy.onnx --transport /dev/pts/5 --live --yes
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from hopping_leg.cli import motors, options
from hopping_leg.deploy import safety_limits, stop_reasons
from hopping_leg.errors import HardwareError, PolicyError, TraceError, UsageError
from hopping_leg.robot import CONTROL_RATE, Robot, SoftLimits, load_robot

if TYPE_CHECKING:
    from hopping_leg.deploy import hardware_trials, motion_sequence

_SECONDS = 10.0
_MOST_SHARE = 0.5  # Of a control period that a policy may take


@dataclass(frozen=True)
class Deploy:
    """What runs, on which leg, for how long."""

    controller: tyro.conf.Positional[str]
    """A name, a file (.onnx, .toml), or a Python class as FILE.py:CLASS."""
    transport: str
    """Path of an fdcanusb, interface:channel of python-can, or pi3hat."""
    robot: options.OwnRobot = None
    command: float | None = None
    """Height to hop to, m; default: the middle of the policy's training, 0.30 for others."""
    schedule: str | None = None
    """Heights in turn instead, each with its seconds, e.g. 0.25:5,0.30:5."""
    seconds: float | None = None
    """Time to hop, s; default 10, or as long as the schedule."""
    live: bool = False
    """Change the height while the leg hops: + and -, or the arrows."""
    soft_limits: bool = True
    """Pull back joints that pass their soft limits; --no-soft-limits: let them pass."""
    other_robot: bool = False
    """Let a policy run that was trained on another robot, at your own risk."""
    yes: bool = False
    """Arm without asking."""
    out: Path = Path("runs/deploy")
    """Folder for the trace."""


def run(args: Deploy) -> None:
    """Check everything, ask, run, record."""
    from hopping_leg.controllers.registry import robot_of

    robot = load_robot(args.robot or robot_of([args.controller]))
    robot.require_leg()
    done = _perform(args, robot, _sequence(args, robot))
    state, events = done.outcome.supervisor, done.trace.header["events"]
    reason, ending = state.stop_cause.reason, f"{state.stop_cause} {state.cause}"
    squats = [event["squat"]["upward"] for event in events if "squat" in event]
    options.say(
        *done.notices,
        *(event["fallback"] for event in events if "fallback" in event),
        *(f"In its squat the leg carried {upward:.0%} of its file's weight." for upward in squats),
        f"{ending} {done.outcome.ticks} ticks, {done.outcome.skipped} left out.",
    )
    options.say_written(done.path)
    if reason not in (stop_reasons.Reason.FINISHED, stop_reasons.Reason.OPERATOR_STOP):
        errors = [event.get("controller_error", "") for event in events]
        words = [f"The leg was stopped: {ending}", *errors, done.complaint]
        raise HardwareError(" ".join(filter(None, words)))
    if done.complaint:
        raise TraceError(done.complaint)


def _sequence(args: Deploy, robot: Robot) -> "motion_sequence.MotionSequence":
    """Return what the leg shall do; whatever is wrong with it is found here."""
    from hopping_leg.controllers import command_schedule, policy, registry
    from hopping_leg.controllers.fallback import with_fallback
    from hopping_leg.deploy import keyboard, motion_sequence
    from hopping_leg.sim import SoftLimiter

    if args.schedule is not None and args.command is not None:
        raise UsageError("--command and --schedule exclude each other; give one of them.")
    controller = registry.load_controller(args.controller, robot)
    if isinstance(controller, policy.Policy):
        stranger = controller.stranger(robot, args.controller)
        if stranger and not args.other_robot:
            remedy = "Train one for it with `hop train --robot`, or add --other-robot."
            raise PolicyError(f"{stranger} {remedy}")
        options.say(*filter(None, [stranger]))
        if controller.seconds > _MOST_SHARE / CONTROL_RATE:
            raise PolicyError(
                f"{args.controller} takes {controller.seconds * 1e3:.1f} ms of a control period of"
                f" {1e3 / CONTROL_RATE:g} ms here; make it smaller, or end other programs."
            )
    valid = command_schedule.command_range(controller, robot)
    if args.schedule is not None:
        schedule = command_schedule.CommandSchedule.parse(args.schedule)
    else:
        middle = sum(valid) / 2 if isinstance(controller, policy.Policy) else 0.30
        height = middle if args.command is None else args.command
        schedule = command_schedule.CommandSchedule(((height, _SECONDS),))
    command_schedule.check_heights([h for h, _ in schedule.steps], valid, controller.name)
    seconds = args.seconds or (_SECONDS if args.schedule is None else schedule.seconds)
    if not 0 < seconds <= 3600:
        raise UsageError(f"--seconds is {seconds:g} but must lie between 0 and 3600.")
    return motion_sequence.MotionSequence(
        with_fallback(controller, robot),
        keyboard.LiveHeight(schedule.at(0.0), valid) if args.live else schedule,
        motion_sequence.hopping_poses(robot),
        SoftLimiter(robot, SoftLimits()) if args.soft_limits else None,
        motion_sequence.SequenceTiming(hop=seconds),
        checked=robot,
    )


def _perform(
    args: Deploy, robot: Robot, sequence: "motion_sequence.MotionSequence"
) -> "hardware_trials.Performance":
    from hopping_leg.deploy import hardware_trials, keyboard

    limits, name = safety_limits.hopping_limits(robot, CONTROL_RATE), sequence.controller.name
    height = sequence.commands if isinstance(sequence.commands, keyboard.LiveHeight) else None
    with motors.connect(robot, args.transport) as link:
        drives = motors.check(link, robot, limits)
        motors.ask(
            f"All checks passed. {robot.name} will move and hop for {sequence.timing.hop:g} s with"
            f" {name}; keep a hand on the switch.",
            yes=args.yes,
        )
        return hardware_trials.perform(
            link, sequence, limits, hardware_trials.new_path(args.out, name),
            facts={"transport": args.transport, "drives": drives},
            beside=lambda loop: keyboard.keys(height, loop.stop, options.say),
        )  # fmt: skip
