"""Long runs of the deployed loop on emulated drives, in virtual time.

Everything that `hop deploy` does is done: the checks before arming, supervisor, flight recorder,
the bytes on the wire. Motors warm up as the emulator's do.
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress
from rich.table import Table

from hopping_leg.cli.options import at_least
from hopping_leg.controllers.command_schedule import CommandSchedule
from hopping_leg.controllers.registry import load_controller, robot_of
from hopping_leg.deploy.drive_info import inspect
from hopping_leg.deploy.hardware_trials import header_of, perform
from hopping_leg.deploy.motion_sequence import (
    MotionSequence,
    Part,
    SequenceTiming,
    hopping_poses,
)
from hopping_leg.deploy.preflight import check_drives, require_fit
from hopping_leg.deploy.safety_limits import hopping_limits
from hopping_leg.emulator.server import EmulatorConfig
from hopping_leg.emulator.virtual_time import Lockstep
from hopping_leg.evaluate.result_files import ResultCache
from hopping_leg.hop_detection import measure_hops
from hopping_leg.robot import JOINTS, SoftLimits, load_robot
from hopping_leg.sim import CONTROL_RATE, SoftLimiter
from hopping_leg.terminal import plain_console
from hopping_leg.workers import ProcessWorkers

Row = dict[str, Any]

_SETTLE = 3.0
"""Time after the start of the first hop that no statistic counts, s."""


@dataclass(frozen=True)
class Endurance:
    """Let controllers hop for long at each height, on emulated drives."""

    controllers: tuple[str, ...] = ("precise", "energy-shaping")
    """Names or files."""
    robot: str | None = None
    """A shipped name or a .toml file; default: that of the first policy."""
    commands: tuple[float, ...] = (0.22, 0.26, 0.30, 0.34, 0.38, 0.42)
    """Heights, m, a run each."""
    minutes: float = 10.0
    """Of hopping, in the emulator's time."""
    seed: int = 0
    """Of sensor noise and jitter."""
    jobs: int = 0
    """Processes; 0 takes one per core."""
    out: Path = Path("runs/endurance")
    """Where results are kept: finished runs are not repeated."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        at_least(0, jobs=self.jobs)
        robot = self.robot or robot_of(self.controllers)
        tasks = [
            (name, robot, command, self.minutes, self.seed)
            for name in self.controllers
            for command in self.commands
        ]
        cache = ResultCache(self.out)
        with ProcessWorkers(self.jobs) as workers, Progress() as progress:
            bar = progress.add_task("hopping", total=len(tasks))
            rows: list[Row] = []
            for begin in range(0, len(tasks), workers.count):
                part = tasks[begin : begin + workers.count]
                asked = {"tasks": part, "robot": load_robot(robot).digest}
                found = cache.load_or_run(
                    f"runs-{begin}", f"runs {begin}", asked,
                    lambda part=part: {"rows": workers.map(hop, part)},  # type: ignore[misc]
                )  # fmt: skip
                rows += found["rows"]
                progress.advance(bar, len(part))
        table = Table("controller", "command, m", "ended by", "s", "error, mm", "std, mm", "deg C")
        for row in rows:
            numbers = (1e3 * row["median_error_m"], 1e3 * row["std_m"], row["hottest_c"])
            cells = [f"{row['command_m']:.2f}", row["reason"], f"{row['seconds']:.0f}"]
            table.add_row(row["controller"], *cells, *(f"{value:.1f}" for value in numbers))
        plain_console().print(table)
        return {"robot": robot, "minutes": self.minutes, "seed": self.seed, "rows": rows}


def hop(name: str, robot_name: str, command: float, minutes: float, seed: int) -> Row:
    """Return how a run at one height went."""
    robot = load_robot(robot_name)
    controller = load_controller(name, robot)
    limits = hopping_limits(robot, CONTROL_RATE)
    sequence = MotionSequence(
        controller,
        CommandSchedule(((command, 100.0),)),
        hopping_poses(robot),
        SoftLimiter(robot, SoftLimits()),
        SequenceTiming(hop=60 * minutes),
    )
    lockstep = Lockstep(EmulatorConfig(robot=robot_name, seed=seed).build())
    with tempfile.TemporaryDirectory() as folder:
        try:
            require_fit(check_drives(robot, limits, inspect(lockstep.link)))
            done = perform(
                lockstep.link, sequence, limits, Path(folder) / "run.parquet",
                header_of(robot, controller, CONTROL_RATE), clock=lockstep, realtime=False,
            )  # fmt: skip
        finally:
            lockstep.link.close()
    trace = done.trace
    time, height, clearance = np.array(lockstep.truth).T
    begin = time[0] + sequence.timing.before_hop + _SETTLE
    inside = (time > begin) & (time < begin - _SETTLE + 60 * minutes)
    height, clearance = height[inside], clearance[inside]
    hops = measure_hops(height, np.gradient(height, 1 / CONTROL_RATE), clearance, CONTROL_RATE)
    in_hop = trace.column("part") == Part.HOP
    torque = {joint: trace.column(f"{joint}_sent_nm")[in_hop] for joint in JOINTS}
    return {
        "controller": controller.name,
        "command_m": command,
        "reason": done.outcome.supervisor.stop_cause.reason.name.lower(),
        "seconds": float(in_hop.sum() / CONTROL_RATE),
        "hops": len(hops.apex),
        "skipped_hops": hops.skipped,
        "median_error_m": float(np.median(hops.apex) - command) if len(hops.apex) else np.nan,
        "std_m": float(hops.apex.std()) if len(hops.apex) else np.nan,
        "hottest_c": max(float(trace.column(f"{j}_temperature_c").max()) for j in torque),
        **{f"rms_{j}_torque_nm": float(np.sqrt(np.nanmean(t**2))) for j, t in torque.items()},
    }
