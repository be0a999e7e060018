"""Continue a policy's training on the real leg, or on a twin that plays it.

The robot is reached through trials of some seconds alone, and nothing is known of it but what its
joints measure: heights are reckoned from the time in the air. After every trial the policy's
command is corrected by what its hops missed, at each height. A policy that became worse is rolled
back to the best; the run stops when hops are accurate, when nothing improves, or when the minutes
of robot time are used up. A killed run goes on with --resume.

Examples:
  hop finetune fast --on twin --minutes 3
  hop finetune fast --on my_twin.toml --seed 1 --out runs/finetuned --json finetuned.json
  hop finetune fast --robot my_leg.toml --transport /dev/fdcanusb --minutes 5
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from hopping_leg import errors
from hopping_leg.cli import motors, options
from hopping_leg.controllers.registry import load_policy, robot_of
from hopping_leg.deploy import hardware_trials, safety_limits
from hopping_leg.progress import said_if_slow
from hopping_leg.robot import Robot, load_robot

if TYPE_CHECKING:
    from hopping_leg.controllers.hardware_trial import TrialRobot
    from hopping_leg.controllers.policy import Policy
    from hopping_leg.rl.finetune.simulated import Guard


@dataclass(frozen=True)
class Finetune:
    """What goes on learning, on which robot, for how long."""

    policy: tyro.conf.Positional[str]
    """A shipped policy or an .onnx file."""
    on: str | None = None
    """The twin that plays the real leg: a shipped robot or a .toml file."""
    transport: str | None = None
    """The drives of the real leg instead, as for `hop deploy`."""
    robot: options.OwnRobot = None
    minutes: float = 10.0
    """Longest time on the robot."""
    commands: options.Heights = (0.25, 0.30, 0.35)
    """Heights of every trial, m."""
    trial_seconds: float = 15.0
    """Length of a trial, s."""
    tolerance: float = 0.004
    """Error that is good enough, on two trials in a row, m."""
    seed: int = 0
    """Seed of a twin's noise."""
    out: Path = Path("runs/finetune")
    """The run's folder."""
    resume: bool = False
    """Continue the run in the folder; start one if there is none."""
    yes: bool = False
    """Arm the drives without asking before every trial."""
    json: options.JsonFile = None


def run(args: Finetune) -> None:
    """Continue the training, say how it went."""
    with said_if_slow("Loading torch."):
        from hopping_leg.rl.finetune import finetuning

    policy, robot = load_policy(args.policy), load_robot(args.robot or robot_of([args.policy]))
    _refuse(args, policy, robot)
    config = finetuning.FinetuneConfig(
        commands=tuple(sorted(args.commands)),
        trial_seconds=args.trial_seconds,
        stopping_rules=finetuning.StoppingRules(minutes=args.minutes, tolerance=args.tolerance),
    )
    with options.going_on(f"the same command with --resume goes on in {args.out}."):
        result = finetuning.finetune(
            finetuning.Task(policy, robot, args.seed),
            _trial_robot(args, robot, policy.card.rate),
            config,
            args.out,
            resume=args.resume,
            on_trial=lambda row: options.say(line(row)),
        )
    written = args.out / finetuning.POLICY
    options.say(f"{result['why_it_ended']} Policy: {written}")
    options.say_next(["hop", "evaluate", written, *options.robot_words(args.robot)])
    options.save_json(args.json, result)


def line(row: dict[str, Any]) -> str:
    """Return what to show of a trial."""
    true = f", in truth {1e3 * row['true_error_m']:.1f} mm" if "true_error_m" in row else ""
    back = "Rolled back to the best." if row["rolled_back"] else ""
    said = (
        f"{row['minutes']:.2f} min: error {1e3 * row['error_m']:.1f} mm{true}, {row['hops']} hops."
    )
    return " ".join(filter(None, (said, row["complaint"], back)))


def guard_of(robot: Robot, rate: float) -> "Guard":
    """Return the supervisor's limits of measured joints, for a simulated leg."""
    import numpy as np

    from hopping_leg.rl.finetune.simulated import Guard

    limits = safety_limits.hopping_limits(robot, rate)
    pairs = (limits.lower, limits.upper, limits.speed, limits.braking)
    return Guard(*(np.array(pair) for pair in pairs))


def _refuse(args: Finetune, policy: "Policy", robot: Robot) -> None:
    """Refuse what cannot be done, before anything moves."""
    if (args.on is None) == (args.transport is None):
        raise errors.UsageError(
            "Give either --on, a twin that plays the leg, or --transport, its drives."
        )
    options.at_least(0, seed=args.seed)
    robot.require_leg()
    if not robot.reality.only_delays:
        raise errors.RobotError(
            f"{robot.name} has effects in [reality] that nobody can believe in; name what plays the"
            " leg with --on, and the robot that its file extends with --robot."
        )
    policy.check_robot(robot)
    low, high = policy.command_range
    for command in args.commands:
        if not low <= command <= high:
            raise errors.UsageError(
                f"A command of {command:g} m is outside of the policy's training; give heights from"
                f" {low:g} to {high:g} m."
            )


def _trial_robot(args: Finetune, robot: Robot, rate: float) -> "TrialRobot":
    if args.transport is None:
        from hopping_leg.rl.finetune.simulated import SimulatedTrials

        return SimulatedTrials(load_robot(str(args.on)), guard_of(robot, rate))
    limits, transport = safety_limits.hopping_limits(robot, rate), args.transport

    def ready(seconds: float) -> None:
        what = f"{robot.name} will move and hop for {seconds:g} s; keep a hand on the switch."
        motors.ask(what, yes=args.yes)

    return hardware_trials.DeployedRobot(
        robot,
        rate,
        args.out / "traces",
        lambda: motors.connect(robot, transport),
        lambda link: motors.check(link, robot, limits),
        ready,
    )
