"""Stored traces, simulated or from hardware, shown again."""

from pathlib import Path

from hopping_leg.errors import RobotError, UsageError
from hopping_leg.robot import load_robot
from hopping_leg.robot.parameters import Robot
from hopping_leg.trace import Trace
from hopping_leg.viewer.live import MOST
from hopping_leg.viewer.tracks import load_track


class Replay:
    """One or two traces side by side; both begin at zero.

    Attributes:
        tracks: One per trace.
        now: Time that is shown, s.
        length: Of the longest, s.
        notices: What the reader should be told.

    Args:
        paths: Of the traces.
        robot: Name or file of the leg; none takes the one that each trace names.

    Raises:
        TraceError: A trace cannot be read or holds no tick.
        RobotError: A trace's robot is no shipped one and ``robot`` was not given.
        UsageError: There are too many traces.
    """

    def __init__(self, paths: tuple[Path, ...], robot: str | None = None) -> None:
        if not 1 <= len(paths) <= MOST:
            raise UsageError(f"{len(paths)} traces were given; give one, or two side by side.")
        self.notices: list[str] = []
        self.now = 0.0
        self.tracks = [load_track(path, self._robot(path, robot)) for path in paths]
        for track in self.tracks:
            track.time[:] -= track.time[0]
        self.length = max(float(track.time[-1]) for track in self.tracks)

    def advance(self, seconds: float) -> None:
        """Let time pass; the end is followed by the beginning."""
        self.now += seconds
        if self.now > self.length:
            self.now = 0.0

    def seek(self, time: float) -> None:
        """Show another time, s."""
        self.now = min(max(time, 0.0), self.length)

    def _robot(self, path: Path, robot: str | None) -> Robot:
        header = Trace.load(path).header
        name = robot or str(header.get("robot", ""))
        try:
            found = load_robot(name)
        except RobotError as error:
            if robot is not None:
                raise
            raise RobotError(
                f"{path} was recorded from '{name}', which is no shipped robot; give its file with"
                " --robot."
            ) from error
        found.require_leg()
        if header.get("robot_digest", found.digest) != found.digest:
            self.notices.append(
                f"{path.name} was recorded from other parameters than those of {found.name}."
            )
        return found
