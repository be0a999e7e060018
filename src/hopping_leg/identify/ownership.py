"""Which robot recordings belong to, and whether a robot file is that robot's."""

from collections.abc import Sequence

from hopping_leg.errors import RecordingError, RobotError, UsageError
from hopping_leg.identify.recording import Recording
from hopping_leg.robot.parameters import Robot
from hopping_leg.robot.robot_files import load_robot

_TOLERANCE = 0.2
"""Share by which link lengths may differ between files of one leg."""


def robot_of(recordings: Sequence[Recording]) -> str:
    """Return the name or path of the robot that recordings were filed under.

    Raises:
        UsageError: There is no recording, or they name several robots.
    """
    names = list(dict.fromkeys(r.metadata.robot for r in recordings))
    if not names:
        raise UsageError("No recording was given; name at least one file.")
    if len(names) > 1:
        raise UsageError(
            f"The recordings belong to several robots ({', '.join(names)}); identify one at a time,"
            " or say with --robot where to start if these are the same leg."
        )
    return names[0]


def check_owner(recordings: Sequence[Recording], robot: Robot) -> None:
    """Refuse a robot whose kind or links are not those of the recordings' own.

    Raises:
        RecordingError: A recording belongs to another leg.
    """
    for recording in recordings:
        try:
            own = load_robot(recording.metadata.robot)
        except RobotError:
            continue  # filed under a robot that is not here: nothing to compare with
        if own.kind != robot.kind:
            raise RecordingError(
                f"{recording.name} is of '{recording.metadata.robot}', a {own.kind}, but"
                f" '{robot.name}' is a {robot.kind}; give its robot file with --robot."
            )
        for link in ("thigh", "shank"):
            measured, given = getattr(own, link).length, getattr(robot, link).length
            if abs(given / measured - 1) > _TOLERANCE:
                raise RecordingError(
                    f"{recording.name} is of '{recording.metadata.robot}', whose {link} is"
                    f" {measured:g} m long, but that of '{robot.name}' is {given:g} m: another"
                    " leg's robot file; leave --robot out or give this leg's."
                )
