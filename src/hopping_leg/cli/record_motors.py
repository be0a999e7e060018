"""`hop record --transport`: excitations played on real motors."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console

from hopping_leg.cli.motors import ask, check, connect
from hopping_leg.controllers.joint_pd import JointGains, JointPD
from hopping_leg.deploy.hardware_trials import Performance, header_of, new_path, perform
from hopping_leg.deploy.keyboard import keys
from hopping_leg.deploy.motion_sequence import MotionSequence, Poses, SequenceTiming, hopping_poses
from hopping_leg.deploy.safety_limits import recording_limits
from hopping_leg.deploy.schedule import Schedule
from hopping_leg.deploy.stop_reasons import Reason
from hopping_leg.errors import HardwareError, UsageError
from hopping_leg.identify.excitation import Excitation
from hopping_leg.identify.play_excitation import recording_of
from hopping_leg.robot.parameters import Robot

if TYPE_CHECKING:
    from hopping_leg.deploy.moteus_link import MoteusLink

_HANGING = np.zeros(2)


def record(
    excitations: Sequence[tuple[str, Excitation]],
    robot: Robot,
    *,
    transport: str,
    believed: str,
    gains: JointGains,
    out: Path,
    yes: bool,
) -> None:
    """Play excitations one after the other and write their recordings and traces.

    Args:
        excitations: Name and excitation.
        robot: Whose drives.
        transport: As on the command line.
        believed: Robot file that the recordings are filed under.
        gains: Of the joint PD.
        out: Folder.
        yes: Arm without asking.

    Raises:
        HardwareError: The drives are not fit, or the leg was stopped.
        UsageError: The excitations have different rates.
    """
    rates = {excitation.rate for _, excitation in excitations}
    if len(rates) > 1:
        raise UsageError("The excitations have different rates; record them one by one.")
    limits, console = recording_limits(robot, rates.pop()), Console()
    with connect(robot, transport) as link:
        found = check(link, robot, limits)
        for name, excitation in excitations:
            ask(
                f"{robot.name} on the {excitation.rig} will play {name} for"
                f" {len(excitation) / excitation.rate:.0f} s; keep a hand on the switch.",
                yes=yes,
            )
            facts = {"transport": transport, "drives": found}
            done = _play(link, robot, excitation, gains, out / "traces", facts, name)
            cause = done.outcome.supervisor.stop_cause
            if cause.reason is not Reason.FINISHED:
                raise HardwareError(f"{name} was stopped: {cause} Its trace is {done.path}.")
            file = out / f"{robot.name}-{name}.parquet"
            recording = recording_of(
                done.trace, excitation, believed=believed, gains=gains, name=file.name
            )
            recording.save(file)
            for notice in (*done.notices, *recording.warnings):
                console.print(f"  {notice}", highlight=False, soft_wrap=True)
            console.print(f"Wrote {file}", highlight=False, soft_wrap=True)


def _play(
    link: "MoteusLink",
    robot: Robot,
    excitation: Excitation,
    gains: JointGains,
    folder: Path,
    facts: dict[str, Any],
    name: str,
) -> Performance:
    controller = JointPD(excitation.position, excitation.velocity, gains)
    fixed = excitation.rig == "fixed-base"
    rest = _HANGING if fixed else hopping_poses(robot).rest
    sequence = MotionSequence(
        controller,
        Schedule(((float("nan"), 1.0),)),
        Poses(excitation.position[0], rest),
        None,
        SequenceTiming(hop=len(excitation) / excitation.rate),
        gains,
    )
    header = header_of(robot, controller, excitation.rate, **facts)
    return perform(
        link,
        sequence,
        recording_limits(robot, excitation.rate),
        new_path(folder, name),
        header,
        beside=lambda loop: keys(None, loop.stop, Console().print),
    )
