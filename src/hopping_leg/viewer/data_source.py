"""Sources of the viewer besides the live simulation: stored traces, the leg of `hop deploy`."""

from pathlib import Path
from typing import Protocol

import polars as pl

from hopping_leg import errors, trace
from hopping_leg.deploy.flight_recorder import SUFFIX, FlightRecorderTail
from hopping_leg.robot import Robot, load_robot
from hopping_leg.sim import CONTROL_RATE
from hopping_leg.viewer.live_leg import MOST
from hopping_leg.viewer.tracks import Track


class DataSource(Protocol):
    """A live simulation, a replay, or a run on the real leg."""

    tracks: list[Track]  # one per leg
    now: float  # time that is shown, s
    notices: list[str]  # to be told; whoever shows them empties the list

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        ...


class ReplaySource:
    """One or two traces side by side; both begin at zero.

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
            raise errors.UsageError(
                f"{len(paths)} traces were given; give one, or two side by side."
            )
        self.notices: list[str] = []
        self.now = 0.0
        self.tracks = [self._load(path, robot) for path in paths]
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

    def _load(self, path: Path, robot: str | None) -> Track:
        stored = trace.Trace.load(path)
        if not len(stored.table):
            raise errors.TraceError(f"{path} holds no tick; there is nothing to show.")
        name = str(stored.header.get("robot", ""))
        leg = load_robot(robot) if robot else _load_shipped(name, f"{path} was recorded from")
        leg.require_leg()
        if not leg.has_digest(stored.header.get("robot_digest", leg.digest)):
            self.notices.append(
                f"{path.name} was recorded from other parameters than those of {leg.name}."
            )
        track = Track(str(stored.header.get("controller", path.stem)), leg)
        track.extend_by_trace(stored)
        return track


def _load_shipped(name: str, origin: str) -> Robot:
    try:
        return load_robot(name)
    except errors.RobotError as error:
        raise errors.RobotError(
            f"{origin} '{name}', which is no shipped robot; give its file with --robot."
        ) from error


KEPT_SECONDS = 20.0
"""Of the past."""

_LOOK = 0.5
"""Seconds between looks for a newer run."""


class RecorderSource:
    """Shows the newest run; the robot that runs it learns nothing of it.

    Args:
        path: Of a black box, or of the folder in which `hop deploy` writes them.
        robot: Name or file of the leg; none takes the one that the run names.

    Raises:
        UsageError: There is neither such a file nor such a folder.
    """

    def __init__(self, path: Path, robot: str | None = None) -> None:
        if not path.exists():
            raise errors.UsageError(
                f"There is no {path}; give a {SUFFIX} file or the folder of `hop deploy --out`."
            )
        self.tracks: list[Track] = []
        self.notices: list[str] = []
        self.now = 0.0
        self._path, self._robot = path, robot
        self._tail: FlightRecorderTail | None = None
        self._over = False
        self._wait = 0.0
        if path.is_dir():
            self.notices.append(f"Waiting for a run in {path}.")

    def advance(self, seconds: float) -> None:
        """Read what is new.

        Raises:
            RobotError: The run's robot is no shipped one and none was given.
            TraceError: The file is no flight recording.
        """
        self._wait -= seconds
        if self._wait <= 0:
            self._wait = _LOOK
            self._look()
        rows = self._tail.rows() if self._tail else ()
        if self._tail is None or not len(rows):
            return
        if not self.tracks:
            header = self._tail.header
            name = self._robot or str(header.get("robot", ""))
            robot = _load_shipped(name, f"{self._tail.path} is of")
            depth = round(KEPT_SECONDS * CONTROL_RATE)
            self.tracks = [Track(str(header.get("controller", "")), robot, depth=depth)]
        table = pl.DataFrame(rows, schema=list(self._tail.columns), orient="row")
        self.tracks[0].extend_by_trace(trace.Trace(table))
        self.now = float(self.tracks[0].time[-1])

    def _look(self) -> None:
        """Turn to a newer run, if there is one; say when this one is over."""
        if self._tail is not None and self._tail.over and not self._over:
            self._over = True
            self.notices.append("The run is over; its trace is on disk.")
        boxes = [self._path]
        if self._path.is_dir():  # of those written in one tick of the file system, the last by name
            boxes = sorted(self._path.glob(f"*{SUFFIX}"), key=lambda b: (b.stat().st_mtime_ns, b))
        if not boxes or (self._tail is not None and boxes[-1] == self._tail.path):
            return
        if self._tail is not None:
            self._tail.close()
        self._tail, self._over, self.tracks, self.now = FlightRecorderTail(boxes[-1]), False, [], 0
        self.notices.append(f"Following {boxes[-1].name}.")
