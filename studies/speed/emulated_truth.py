"""What an emulated leg did while a run lasted, which the host behind the wire cannot know."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import find_peaks

from hopping_leg.deploy.motion_sequence import Part
from hopping_leg.emulator.process import EmulatorProcess
from hopping_leg.evaluate.metrics import START_SECONDS
from hopping_leg.hop_detection import BOUNCE, FLIGHT_CLEARANCE
from hopping_leg.robot import kinematics
from hopping_leg.robot.parameters import Robot
from hopping_leg.trace import Trace

_SAMPLE_SECONDS = 0.01


@dataclass
class Truth:
    """What the emulated leg did; times are since the emulator's start, s."""

    time: list[float] = field(default_factory=list)
    height: list[float] = field(default_factory=list)
    clearance: list[float] = field(default_factory=list)


@contextmanager
def watched(emulator: EmulatorProcess, robot: Robot, truth: Truth) -> Iterator[None]:
    """Write down what the emulated leg does while a run lasts."""
    over = threading.Event()

    def watch() -> None:
        while not over.wait(_SAMPLE_SECONDS):
            state = emulator.state()
            truth.time.append(state.time)
            truth.height.append(state.height)
            standing = float(kinematics.stance_height(robot, np.array(state.q)))
            truth.clearance.append(state.height - standing)

    thread = threading.Thread(target=watch, name="truth", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def apexes_of(trace: Trace, truth: Truth) -> list[tuple[float, float]]:
    """Return command and height of every settled apex of a run.

    The two clocks are matched at the end: the truth is watched until the run is over.
    """
    if not truth.time:
        return []
    height, clearance = np.array(truth.height), np.array(truth.clearance)
    peaks, _ = find_peaks(height, prominence=BOUNCE)
    peaks = peaks[clearance[peaks] >= FLIGHT_CLEARANCE]
    time, part, command = (trace.column(name) for name in ("time_s", "part", "command_m"))
    at = np.array(truth.time)[peaks] - truth.time[-1] + time[-1]
    tick = np.clip(np.searchsorted(time, at), 0, len(time) - 1)
    switches = time[np.flatnonzero(np.diff(np.where(part == Part.HOP, command, 0.0)))]
    found = []
    for peak, index in zip(peaks, tick, strict=True):
        since = time[index] - switches[switches <= time[index]]
        if part[index] == Part.HOP and len(since) and since.min() >= START_SECONDS:
            found.append((float(command[index]), float(height[peak])))
    return found
