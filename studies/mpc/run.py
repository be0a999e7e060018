"""The shape of the teacher's hops: its search, and how high, how calm and how accurate they are.

A shape is good where a controller that sees no more than a policy scatters little, without stopping
short of the commands, without much torque at the hip, outside no soft limit, and with time in the
air. CMA-ES searches for it over all shipped legs of the paper at once.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress
from rich.table import Table

from hopping_leg.arrays import Array
from hopping_leg.cli.options import at_least
from hopping_leg.cma_strategy import seeded_strategy
from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.mpc import HopShape, TrueStateMpc
from hopping_leg.controllers.protocol import Controller
from hopping_leg.evaluate.motor_load import motor_load
from hopping_leg.evaluate.result import ResultCache
from hopping_leg.hop_detection import measure_hops
from hopping_leg.robot import Robot, load_robot
from hopping_leg.terminal import plain_console
from hopping_leg.workers import ProcessWorkers
from studies.mpc.late import LateMpc

ROBOTS = ("legv2-identified", "legv2", "legv2-paper")

_HEIGHTS = (0.22, 0.25, 0.28, 0.31, 0.34, 0.37, 0.40, 0.42)
_LEGS, _SECONDS, _SETTLE = 3, 8.0, 2.0

_SPACE = {
    "flight_length": (0.45, 0.8),
    "clearance": (0.12, 0.25),
    "squat": (0.42, 0.66),
    "squat_per_drop": (0.0, 0.35),
    "liftoff": (0.68, 0.86),
    "least_push": (0.02, 0.25),
    "liftoff_per_drop": (0.0, 0.3),
    "taper": (0.03, 0.35),
    "braking": (0.3, 1.0),
    "most_landing": (3.0, 10.0),
    "lean_from": (2.0, 6.0),
    "lean": (0.02, 0.2),
    "most_lean": (0.1, 0.35),
    "hip_stiffness": (0.8, 2.9),
    "hip_damping": (0.1, 0.6),
    "knee_stiffness": (0.6, 2.3),
    "knee_damping": (0.05, 0.45),
    "slew": (0.4, 1.2),
}
_LOW, _HIGH = np.array(list(_SPACE.values())).T


@dataclass(frozen=True)
class Hops:
    """Hops at one height."""

    command_m: float
    median_error_m: float
    std_m: float
    hops: int
    hops_per_s: float
    skipped_hops: int
    flight_fraction: float
    rms_hip_torque_nm: float
    mean_power_w: float
    outside_limits_fraction: float
    peak_knee_speed_rad_s: float
    least_clearance_m: float
    """Of base and knee to the ground."""

    @property
    def cost(self) -> float:
        """What is bad about them, in mm of scatter."""
        if self.hops < 5:
            return 120.0
        wanted = float(np.interp(self.command_m, (0.22, 0.30, 0.42), (0.30, 0.48, 0.60)))
        cost = 1e3 * self.std_m
        cost += 0.5 * min(max(1e3 * abs(self.median_error_m) - 1, 0.0), 60.0)
        cost += 20 * self.skipped_hops / self.hops
        cost += 100 * max(0.0, wanted - self.flight_fraction)
        cost += 30 * max(0.0, 1.6 - self.hops_per_s)
        cost += 4 * max(0.0, self.rms_hip_torque_nm - 1.7) + 0.04 * self.mean_power_w
        cost += 300 * max(0.0, self.outside_limits_fraction - 0.003)
        cost += 1e3 * max(0.0, 0.015 - self.least_clearance_m)
        cost += 0.5 * max(0.0, self.peak_knee_speed_rad_s - 21.5)
        return min(cost, 120.0)


def measure(
    controller: Controller, robot: Robot, heights: Sequence[float], seed: int
) -> list[Hops]:
    """Let a controller hop at heights, m, with torque noise."""
    config = RolloutConfig(robot, threads=1)
    schedule = np.tile(np.repeat(heights, _LEGS), (round(_SECONDS * config.rate), 1))
    run = rollout(controller, config, schedule, seed)
    traces = [run.trace(leg) for leg in range(schedule.shape[1])]
    start = round(_SETTLE * config.rate)
    settled = [replace(trace, table=trace.table[start:]) for trace in traces]
    found = []
    for index, height in enumerate(heights):
        parts = settled[index * _LEGS : (index + 1) * _LEGS]
        hops = [
            measure_hops(
                part.column("height_m"), part.column("height_rate_m_s"),
                part.column("foot_clearance_m"), config.rate,
            )
            for part in parts
        ]  # fmt: skip
        apex = np.concatenate([h.apex for h in hops])
        ticks, load = sum(h.ticks for h in hops), motor_load(parts, robot)
        gaps = [p.column(c).min() for p in parts for c in ("knee_clearance_m", "base_clearance_m")]
        found.append(
            Hops(
                command_m=float(height),
                median_error_m=float(np.median(apex) - height) if len(apex) else float("nan"),
                std_m=float(apex.std()) if len(apex) else float("nan"),
                hops=len(apex),
                hops_per_s=len(apex) * config.rate / ticks,
                skipped_hops=sum(h.skipped for h in hops),
                flight_fraction=sum(h.flight_ticks for h in hops) / ticks,
                rms_hip_torque_nm=load.rms_hip_torque_nm,
                mean_power_w=load.mean_power_w,
                outside_limits_fraction=load.outside_limits_fraction,
                peak_knee_speed_rad_s=load.peak_knee_speed_rad_s,
                least_clearance_m=float(min(gaps)),
            )
        )
    return found


def cost(name: str, shape: HopShape, seed: int) -> float:
    """Return what is bad about a shape on a robot: mean over heights, mm."""
    robot = load_robot(name)
    hops = measure(LateMpc(robot, shape, seed), robot, _HEIGHTS, seed)
    return float(np.mean([h.cost for h in hops]))


def from_unit(point: Array) -> HopShape:
    """Return the shape at a point of the unit cube."""
    values = _LOW + np.clip(point, 0, 1) * (_HIGH - _LOW)
    return replace(HopShape(), **dict(zip(_SPACE, values.tolist(), strict=True)))


def to_unit(shape: HopShape) -> Array:
    """Return where a shape lies in the unit cube."""
    values = np.array([getattr(shape, name) for name in _SPACE])
    point: Array = np.clip((values - _LOW) / (_HIGH - _LOW), 0.02, 0.98)
    return point


@dataclass(frozen=True)
class Reach:
    """How high, how calm and how accurate the teacher hops, with the true state."""

    robots: tuple[str, ...] = ROBOTS
    """Shipped names or .toml files."""
    seed: int = 1000
    """Of torque noise."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        heights = np.arange(0.22, 0.4601, 0.02).round(3)
        rows = []
        table = Table("robot", "command, m", "error, mm", "std, mm", "hip RMS, N m", "power, W")
        for name in self.robots:
            robot = load_robot(name)
            for hops in measure(TrueStateMpc(robot), robot, heights.tolist(), self.seed):
                rows.append({"robot": name, **asdict(hops)})
                numbers = (1e3 * hops.median_error_m, 1e3 * hops.std_m, hops.rms_hip_torque_nm)
                cells = [f"{value:.1f}" for value in (*numbers, hops.mean_power_w)]
                table.add_row(name, f"{hops.command_m:.2f}", *cells)
        plain_console().print(table)
        return {"rows": rows, "seed": self.seed}


@dataclass(frozen=True)
class Search:
    """Search the shape of hops of least scatter with CMA-ES, beginning at the shipped one."""

    robots: tuple[str, ...] = ROBOTS
    """Legs on which a shape is tried; their costs are averaged."""
    generations: int = 60
    """Generations of CMA-ES."""
    population: int = 14
    """Candidates per generation."""
    seed: int = 0
    """Of the search; noise takes the number of the generation, the judgement at the end 1000."""
    out: Path = Path("runs/mpc")
    """Where generations are kept: a killed search goes on."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        at_least(1, generations=self.generations)
        at_least(4, population=self.population)
        strategy = seeded_strategy(to_unit(HopShape()), 0.15, [0, 1], self.population, self.seed)
        cache = ResultCache(self.out)
        with ProcessWorkers(0) as workers, Progress() as progress:
            task = progress.add_task("searching", total=self.generations)
            legs = {name: load_robot(name).digest for name in self.robots}
            for generation in range(self.generations):
                points = strategy.ask()
                shapes = [from_unit(np.asarray(point)) for point in points]
                tasks = [(name, shape, generation) for shape in shapes for name in self.robots]
                found = cache.load_or_run(
                    f"generation-{generation}",
                    f"generation {generation}",
                    {"shapes": [asdict(shape) for shape in shapes], "robots": legs},
                    lambda tasks=tasks: {"costs": workers.map(cost, tasks)},  # type: ignore[misc]
                )
                costs = np.reshape(found["costs"], (len(shapes), -1)).mean(axis=1).tolist()
                strategy.tell(points, costs)
                progress.update(
                    task, completed=generation + 1, description=f"lowest cost {min(costs):.2f} mm"
                )
            best = from_unit(np.asarray(strategy.result.xfavorite))
            pair = {"shipped": HopShape(), "found": best}
            tasks = [(name, shape, 1000) for shape in pair.values() for name in self.robots]
            judged = np.reshape(workers.map(cost, tasks), (2, -1)).tolist()
        table = Table("number", *pair)
        shape = [
            {"name": field.name, **{k: getattr(s, field.name) for k, s in pair.items()}}
            for field in fields(HopShape)
        ]
        for row in shape:
            table.add_row(row["name"], f"{row['shipped']:.3f}", f"{row['found']:.3f}")
        plain_console().print(table)
        costs = dict(zip(pair, judged, strict=True))
        return {"shape": shape, "robots": self.robots, "costs_mm": costs, "seed": self.seed}


Options = Reach | Search
