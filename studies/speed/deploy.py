"""How well the loop keeps its time against emulated drives, and how high the leg hops through them.

Timing is real: the drives run in a process of their own behind a terminal. Heights through the wire
are compared in virtual time, which other load on the computer cannot touch, with the same
controller simulated in process.
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import find_peaks

from hopping_leg.arrays import Array
from hopping_leg.cli.options import JsonFile, RobotFile, say
from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.command_schedule import CommandSchedule
from hopping_leg.controllers.registry import load_controller
from hopping_leg.deploy.hardware_trials import Performance, perform
from hopping_leg.deploy.moteus_link import MoteusLink
from hopping_leg.deploy.motion_sequence import MotionSequence, Part, SequenceTiming, hopping_poses
from hopping_leg.deploy.realtime import Clock, RealClock, keeping_time
from hopping_leg.deploy.safety_limits import hopping_limits
from hopping_leg.deploy.transport import open_transport
from hopping_leg.emulator.server import EmulatorConfig
from hopping_leg.emulator.virtual_time import Lockstep
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.metrics import START_SECONDS
from hopping_leg.hop_detection import BOUNCE, FLIGHT_CLEARANCE, trace_hops
from hopping_leg.robot import DEFAULT_ROBOT, Robot, SoftLimits, load_robot
from hopping_leg.sim import CONTROL_RATE, NO_NOISE, SoftLimiter
from hopping_leg.trace import Trace
from studies.fault_campaign.emulator_process import EmulatorProcess
from studies.shared import Row, host, show_numbers

HEIGHTS = (0.25, 0.30, 0.35)
"""Commands that are compared, m."""

_TIMES = ("wake_late", "exchange", "control", "tick")
"""Parts of a tick whose times the trace has."""


@dataclass(frozen=True)
class Deploy:
    """Run a controller against emulated drives: ticks and wake-ups in real time, hop heights."""

    controller: str = "fast"
    """A name, an .onnx file or a gain file."""
    robot: RobotFile = DEFAULT_ROBOT
    minutes: float = 10.0
    """Of hopping in real time, through all heights in turn."""
    seconds: float = 15.0
    """Of hopping at each height in virtual time and in process."""
    json: JsonFile = None

    def measure(self) -> Row:
        """Run it, print and return every number; times in us, lengths in m."""
        if self.minutes < 0.05 or self.seconds < 3:
            raise UsageError("--minutes must be 0.05 or more, --seconds 3 or more.")
        robot = load_robot(self.robot)
        result: Row = {
            "controller": load_controller(self.controller, robot).name,
            "robot": robot.name,
            "rate_hz": CONTROL_RATE,
            "bare_wake_late_us": _bare_wake_ups(6 * self.minutes),
            **self._real_time(robot),
            "heights": [self._height(robot, height) for height in HEIGHTS],
            "host": host(),
        }
        show_numbers("Control loop", result)
        for row in result["heights"]:
            show_numbers("Median apex", row)
        say(*result["stops"], *result["notices"])
        return result

    def _real_time(self, robot: Robot) -> Row:
        """Hop in real time until the minutes are over, or the supervisor stops the leg."""
        say(f"{self.minutes:g} minutes in real time ...")
        part = 60 * self.minutes / len(HEIGHTS)
        schedule = CommandSchedule(tuple((height, part) for height in HEIGHTS))
        with EmulatorProcess(EmulatorConfig(robot=self.robot)) as emulator:
            link = MoteusLink(robot, open_transport(str(emulator.path)))
            performance = self._perform(link, robot, schedule)
            link.close()
        cause = performance.outcome.supervisor.stop_cause
        return {
            "stops": [] if cause.reason.name == "FINISHED" else [str(cause)],
            "notices": list(performance.notices),
            **_ticks(_hopping(performance.trace)),
        }

    def _height(self, robot: Robot, height: float) -> Row:
        """Compare the median apex through the wire with that in process."""
        commands = np.full((round(self.seconds * CONTROL_RATE), 1), height)
        controller = load_controller(self.controller, robot)
        trace = rollout(controller, RolloutConfig(robot, NO_NOISE), commands, seed=0).trace(0)
        hops = trace_hops(trace)
        plain = float(np.median(hops.apex[trace.column("time_s")[hops.tick] >= START_SECONDS]))
        lockstep = Lockstep(EmulatorConfig(robot=self.robot).build())
        schedule = CommandSchedule(((height, self.seconds),))
        performance = self._perform(lockstep.link, robot, schedule, lockstep)
        lockstep.link.close()
        wired = float(np.median(settled_apexes(performance.trace, np.array(lockstep.truth))))
        return {
            "command_m": height,
            "in_process_m": plain,
            "through_the_wire_m": wired,
            "relative_difference": wired / plain - 1,
        }

    def _perform(
        self, link: MoteusLink, robot: Robot, schedule: CommandSchedule, clock: Clock | None = None
    ) -> Performance:
        """Hop by a schedule, in real time unless there is a clock."""
        controller = load_controller(self.controller, robot)
        sequence = MotionSequence(
            controller, schedule, hopping_poses(robot), SoftLimiter(robot, SoftLimits()),
            SequenceTiming(hop=schedule.seconds),
        )  # fmt: skip
        limits = hopping_limits(robot, CONTROL_RATE)
        with tempfile.TemporaryDirectory() as folder:
            return perform(link, sequence, limits, Path(folder) / "run.parquet", clock=clock)


def _bare_wake_ups(seconds: float) -> dict[str, float]:
    """Return how late the computer wakes a loop of the same rate and priority that does nothing."""
    say(f"{seconds:.0f} s of a loop that does nothing ...")
    clock, late = RealClock(), []
    with keeping_time():
        due = clock.now()
        for _ in range(round(seconds * CONTROL_RATE)):
            due += 1 / CONTROL_RATE
            late.append(clock.wait_until(due) - due)
    return _percentiles(np.array(late))


def settled_apexes(trace: Trace, truth: Array) -> Array:
    """Return the heights of the settled apexes of a run, m.

    Args:
        trace: Of the run; it ends when the truth does.
        truth: Of the leg, as ``Lockstep`` has it.
    """
    hopping = _hopping(trace).column("time_s") - trace.column("time_s")[-1]
    at, height, clearance = truth.T[:3]
    peaks, _ = find_peaks(height, prominence=BOUNCE)
    since_end = at[peaks] - at[-1]
    counted = (hopping[0] + START_SECONDS <= since_end) & (since_end <= hopping[-1])
    apexes: Array = height[peaks[counted & (clearance[peaks] >= FLIGHT_CLEARANCE)]]
    return apexes


def _hopping(trace: Trace) -> Trace:
    return Trace(trace.table.filter(trace.table["part"] == Part.HOP), trace.header)


def _ticks(trace: Trace) -> Row:
    """Return percentiles, and the share of all ticks due that were done within their period."""
    if trace.table.is_empty():
        return {"ticks": 0}  # The leg was stopped before it hopped.
    took, skipped = trace.column("tick_s"), int(trace.column("skipped_ticks").sum())
    fresh = np.minimum(trace.column("hip_fresh"), trace.column("knee_fresh"))
    return {
        "minutes": len(took) / CONTROL_RATE / 60,
        "ticks": len(took),
        "skipped": skipped,
        "share_on_time": float((took <= 1 / CONTROL_RATE).sum() / (len(took) + skipped)),
        "ticks_without_all_replies": int((fresh == 0).sum()),
        **{f"{name}_us": _percentiles(trace.column(f"{name}_s")) for name in _TIMES},
    }


def _percentiles(seconds: Array) -> dict[str, float]:
    """Return percentiles and maximum, us."""
    found = 1e6 * np.percentile(seconds, (50, 99, 99.9, 100))
    return dict(zip(("p50", "p99", "p99.9", "max"), found.tolist(), strict=True))
