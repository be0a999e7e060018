"""How well the loop keeps its time against emulated drives, and how high the leg hops through them.

Timing is real: the drives run in a process of their own behind a terminal. Heights are compared
with the same controller simulated in process, once in real time and once in virtual time, which
other load on the computer cannot touch.
"""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.signal import find_peaks

from hopping_leg.arrays import Array
from hopping_leg.cli.options import mm
from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.command_schedule import CommandSchedule
from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.registry import load_controller
from hopping_leg.deploy.hardware_trials import Performance, header_of, perform
from hopping_leg.deploy.moteus_link import MoteusLink
from hopping_leg.deploy.motion_sequence import MotionSequence, Part, SequenceTiming, hopping_poses
from hopping_leg.deploy.realtime import RealClock, keeping_time
from hopping_leg.deploy.safety_limits import hopping_limits
from hopping_leg.deploy.transport import open_transport
from hopping_leg.emulator.process import EmulatorProcess
from hopping_leg.emulator.server import EmulatorConfig
from hopping_leg.emulator.virtual_time import Lockstep
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.metrics import START_SECONDS
from hopping_leg.hop_detection import BOUNCE, FLIGHT_CLEARANCE, find_hops
from hopping_leg.robot import DEFAULT_ROBOT, Robot, SoftLimits, load_robot
from hopping_leg.sim import CONTROL_RATE, NO_NOISE, SoftLimiter
from hopping_leg.terminal import plain_console
from hopping_leg.trace import Trace
from studies.shared import host
from studies.speed.inference import bench_inference


@dataclass
class Truth:
    """What the emulated leg did; times are since the emulator's start, s."""

    time: list[float] = field(default_factory=list)
    height: list[float] = field(default_factory=list)
    clearance: list[float] = field(default_factory=list)


@contextmanager
def watched(emulator: EmulatorProcess, truth: Truth) -> Iterator[None]:
    """Tell what the emulated leg did until a run is over."""
    yield
    for time, height, clearance in emulator.truth():
        truth.time.append(time)
        truth.height.append(height)
        truth.clearance.append(clearance)


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


HEIGHTS = (0.25, 0.30, 0.35)
"""Commands that are compared, m."""

MOST_STOPS = 5
"""Stops by the supervisor after which the benchmark gives up."""

_PERCENTILES = (50.0, 99.0, 99.9)
_COLUMNS = {
    "wake_late_s": "wake_late_us",
    "exchange_s": "exchange_us",
    "control_s": "control_us",
    "tick_s": "tick_us",
}


@dataclass(frozen=True)
class Deploy:
    """Run a controller against emulated drives: ticks and wake-ups in real time, hop heights."""

    controller: str = "fast"
    """A name, an .onnx file or a gain file."""
    robot: str = DEFAULT_ROBOT
    """A shipped name or the path of a .toml file; stands on both sides of the wire."""
    minutes: float = 10.0
    """Of hopping in real time, through all heights in turn."""
    seconds: float = 15.0
    """Of hopping at each height in virtual time and in process."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        for name, value, least in (("minutes", self.minutes, 0.05), ("seconds", self.seconds, 3.0)):
            if not least <= value <= 600:
                raise UsageError(f"--{name} is {value:g} but must lie between {least:g} and 600.")
        console = plain_console()
        result = bench_deploy(self, lambda words: console.print(f"{words} ..."))
        _print(console, result)
        return result


def bench_deploy(study: Deploy, on_progress: Callable[[str], None]) -> dict[str, Any]:
    """Measure wake-ups without and with a loop, ticks and heights.

    Args:
        study: What is measured.
        on_progress: Told what begins.

    Returns:
        Percentiles in us, ``share_on_time`` of all ticks that were due, heights in m.
    """
    robot = load_robot(study.robot)
    controller = load_controller(study.controller, robot)
    result: dict[str, Any] = {
        "controller": controller.name,
        "robot": robot.name,
        "rate_hz": CONTROL_RATE,
        "bare_wake_late_us": _bare_wake_ups(study, on_progress),
        **_real_time(study, robot, on_progress),
        "heights": _heights(study, robot, on_progress),
        "host": host(),
    }
    if isinstance(controller, Policy):
        row = bench_inference([study.controller])["rows"][0]
        result["inference_us"] = {k: row[f"inference_{k}_us"] for k in ("median", "p99")}
    return result


def _bare_wake_ups(study: Deploy, on_progress: Callable[[str], None]) -> dict[str, float]:
    """Return how late the computer wakes a loop of the same rate and priority that does nothing."""
    seconds = 6 * study.minutes
    on_progress(f"{seconds:.0f} s of a loop that does nothing")
    clock, late = RealClock(), []
    with keeping_time(realtime=True):
        due = clock.now()
        for _ in range(round(seconds * CONTROL_RATE)):
            due += 1 / CONTROL_RATE
            late.append(clock.wait_until(due) - due)
    return _percentiles(np.array(late))


def _real_time(study: Deploy, robot: Robot, on_progress: Callable[[str], None]) -> dict[str, Any]:
    """Hop in real time until the minutes are over; start again after a stop."""
    wanted, done = 60 * study.minutes, 0.0
    traces: list[Trace] = []
    rows: list[tuple[float, float]] = []
    stops: list[str] = []
    notices: tuple[str, ...] = ()
    while done < wanted - 1 and len(stops) < MOST_STOPS:
        on_progress(f"{(wanted - done) / 60:.1f} minutes in real time")
        with EmulatorProcess(EmulatorConfig(robot=study.robot)) as emulator, _folder() as folder:
            link, truth = MoteusLink(robot, open_transport(str(emulator.path))), Truth()
            part = (wanted - done) / len(HEIGHTS)
            schedule = CommandSchedule(tuple((height, part) for height in HEIGHTS))
            sequence = _sequence(study, robot, schedule, wanted - done)
            performance = _perform(
                link,
                sequence,
                robot,
                folder / "run.parquet",
                beside=lambda loop, e=emulator, t=truth: watched(e, t),
            )
            link.close()
        notices = performance.notices
        hopping = _hopping(performance.trace)
        traces.append(hopping)
        rows += apexes_of(performance.trace, truth)
        done += hopping.table.height / CONTROL_RATE
        cause = performance.outcome.supervisor.stop_cause
        if cause.reason.name != "FINISHED":
            stops.append(str(cause))
    return {
        "minutes": done / 60,
        "stops": stops,
        "notices": list(notices),
        **_ticks(traces),
        "real_time_heights": [
            {"command_m": height, "apex_m": _median([a for c, a in rows if c == height])}
            for height in HEIGHTS
        ],
    }


def _heights(
    study: Deploy, robot: Robot, on_progress: Callable[[str], None]
) -> list[dict[str, float | None]]:
    """Compare the median apex through the wire with that in process, at every height."""
    found = []
    for height in HEIGHTS:
        on_progress(f"{height:g} m through the wire and in process")
        plain, wired = _in_process(study, robot, height), _in_lockstep(study, robot, height)
        error = None if plain is None or wired is None else wired / plain - 1
        found.append(
            {
                "command_m": height,
                "in_process_m": plain,
                "through_the_wire_m": wired,
                "relative_difference": error,
            }
        )
    return found


def _in_process(study: Deploy, robot: Robot, height: float) -> float | None:
    controller = load_controller(study.controller, robot)
    commands = np.full((round(study.seconds * CONTROL_RATE), 1), height)
    trace = rollout(controller, RolloutConfig(robot, NO_NOISE), commands, seed=0).trace(0)
    hops = find_hops(
        trace.column("height_m"),
        trace.column("height_rate_m_s"),
        trace.column("foot_clearance_m"),
    )
    counted = trace.column("time_s")[hops.tick] >= START_SECONDS
    return _median(hops.apex[counted])


def _in_lockstep(study: Deploy, robot: Robot, height: float) -> float | None:
    lockstep = Lockstep(EmulatorConfig(robot=study.robot).build())
    schedule = CommandSchedule(((height, study.seconds),))
    sequence = _sequence(study, robot, schedule, study.seconds)
    with _folder() as folder:
        performance = _perform(
            lockstep.link, sequence, robot, folder / "run.parquet", clock=lockstep, realtime=False
        )
    lockstep.link.close()
    time, heights, clearances = np.array(lockstep.truth).T
    truth = Truth(time.tolist(), heights.tolist(), clearances.tolist())
    return _median([apex for _, apex in apexes_of(performance.trace, truth)])


def _sequence(
    study: Deploy, robot: Robot, schedule: CommandSchedule, seconds: float
) -> MotionSequence:
    controller = load_controller(study.controller, robot)
    limiter = SoftLimiter(robot, SoftLimits())
    return MotionSequence(
        controller, schedule, hopping_poses(robot), limiter, SequenceTiming(hop=seconds)
    )


def _perform(
    link: MoteusLink,
    sequence: MotionSequence,
    robot: Robot,
    path: Path,
    **options: Any,  # noqa: ANN401
) -> Performance:
    envelope = hopping_limits(robot, CONTROL_RATE)
    header = header_of(robot, sequence.controller, CONTROL_RATE)
    return perform(link, sequence, envelope, path, header, **options)


def _hopping(trace: Trace) -> Trace:
    return Trace(trace.table.filter(trace.table["part"] == Part.HOP), trace.header)


def _ticks(traces: list[Trace]) -> dict[str, Any]:
    """Return percentiles, and the share of all ticks due that were done within their period."""

    def pooled(column: str) -> Array:
        return np.concatenate([trace.column(column) for trace in traces])

    result: dict[str, Any] = {}
    for column, name in _COLUMNS.items():
        result[name] = _percentiles(pooled(column))
    skipped = float(pooled("skipped_ticks").sum())
    on_time = int((pooled("tick_s") <= 1 / CONTROL_RATE).sum())
    ticks = len(pooled("tick_s"))
    fresh = np.minimum(pooled("hip_fresh"), pooled("knee_fresh"))
    return {
        "ticks": ticks,
        "skipped": int(skipped),
        "share_on_time": on_time / (ticks + skipped),
        "ticks_without_all_replies": int((fresh == 0).sum()),
        **result,
    }


def _percentiles(seconds: Array) -> dict[str, float]:
    """Return percentiles and maximum, us."""
    values = 1e6 * seconds
    found = {f"p{p:g}": float(np.percentile(values, p)) for p in _PERCENTILES}
    return found | {"max": float(values.max())}


def _median(values: list[float] | Array) -> float | None:
    return float(np.median(values)) if len(values) else None


@contextmanager
def _folder() -> Iterator[Path]:
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


def _print(console: Console, result: dict[str, Any]) -> None:
    names = ("bare_wake_late_us", "wake_late_us", "exchange_us", "control_us", "tick_us")
    table = Table("us", *result["tick_us"])
    for name in names:
        cells = [f"{value:.0f}" for value in result[name].values()]
        table.add_row(name.removesuffix("_us").replace("_", " "), *cells)
    console.print(table)
    console.print(
        f"{100 * result['share_on_time']:.3f} % of {result['ticks'] + result['skipped']} ticks on"
        f" time in {result['minutes']:.1f} minutes; stops: {len(result['stops'])}."
    )
    for sentence in (*result["stops"], *result["notices"]):
        console.print(f"- {sentence}", soft_wrap=True)
    heights = Table("command, mm", "in process", "through the wire", "in real time")
    rows = zip(result["heights"], result["real_time_heights"], strict=True)
    for row, live in rows:
        values = (row["in_process_m"], row["through_the_wire_m"], live["apex_m"])
        heights.add_row(mm(row["command_m"]), *map(mm, values))
    console.print(heights)
