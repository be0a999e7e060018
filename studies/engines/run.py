"""The same controllers in both physics engines: what of their accuracy is MuJoCo's?

A ladder of worlds, each with one thing changed: the engine with the robot's ground, the ground as
PyBullet's own spring and damper, PyBullet's rigid ground beside MuJoCo's stiff one. No controller
is told or trained again.
"""

import itertools
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress
from rich.table import Table

from hopping_leg.cli.options import Heights, at_least, mm
from hopping_leg.controllers import RolloutConfig
from hopping_leg.controllers.registry import robot_of
from hopping_leg.errors import PhysicsError
from hopping_leg.evaluate.entries import load_entries
from hopping_leg.evaluate.result import Summary
from hopping_leg.evaluate.runner import evaluate, software_versions
from hopping_leg.evaluate.trials import FIXED_SECONDS, on_floor
from hopping_leg.robot import TIMESTEP, Robot, load_robot
from hopping_leg.robot.kinematics import joint_angles
from hopping_leg.sim import CONTROL_RATE, Engine, Ground, make_simulator
from hopping_leg.sim.pybullet.world import import_pybullet
from hopping_leg.terminal import plain_console
from hopping_leg.workers import ProcessWorkers

BAR = 0.015
"""Largest median error that a controller may have in the other engine, m."""

_SHOWN = (
    "median_error_m",
    "std_m",
    "hops",
    "skipped_hops",
    "hop_rate_hz",
    "flight_fraction",
    "min_base_height_m",
    "max_sink_m",
    "body_contacts",
)


@dataclass(frozen=True)
class World:
    """Where the controllers hop.

    Attributes:
        name: In all tables.
        engine: What computes the physics.
        ground: What the foot stands on.
        floor: ``soft``, the robot's contact, or ``stiff``, the engine's.
    """

    name: str
    engine: Engine
    ground: Ground = "robot"
    floor: str = "soft"


WORLDS = (
    World("MuJoCo", "mujoco"),
    World("PyBullet, the robot's ground", "pybullet"),
    World("PyBullet, its spring and damper", "pybullet", "spring"),
    World("MuJoCo, stiff ground", "mujoco", floor="stiff"),
    World("PyBullet, rigid ground", "pybullet", "rigid"),
)

RATES = ((400.0, 1), (400.0, 3), (400.0, 6), (CONTROL_RATE, 10))
"""Control rate, Hz, and physics steps in a control period, tried on PyBullet's rigid ground."""

RATED = "energy-shaping"
"""Controller that tries the rates."""


@dataclass(frozen=True)
class Engines:
    """Let controllers hop in PyBullet as well, without retraining; needs the extra `bullet`."""

    controllers: tuple[str, ...] = (RATED, "fast", "precise", "paper")
    """Names or .onnx files."""
    robot: str | None = None
    """A shipped name or the path of a .toml file; default: that on which each policy was trained,
    else legv2-identified."""
    commands: Heights | None = None
    """Apex heights, m; default 0.25,0.30,0.35, scaled to the leg's length."""
    seeds: int = 2
    """Realisations of noise and delay per command."""
    seed: int = 1000
    """All of them follow from it; choose one that selected nothing."""
    timestep: float = TIMESTEP
    """Physics step, s."""
    workers: int = 2
    """Processes that share the work; the numbers do not depend on it."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        at_least(1, seeds=self.seeds, workers=self.workers)
        at_least(0, seed=self.seed)
        with Progress(transient=True) as bar:
            task = bar.add_task("hopping", total=None)
            result = bench_engines(
                self, on_done=lambda done, total: bar.update(task, completed=done, total=total)
            )
        _print(result)
        return result

    def leg(self, controller: str) -> Robot:
        """Return the robot on which a controller hops."""
        return load_robot(self.robot or robot_of([controller]))


def bench_engines(
    study: Engines,
    worlds: Sequence[World] = WORLDS,
    rates: Sequence[tuple[float, int]] = RATES,
    on_done: Callable[[int, int], None] = lambda _done, _total: None,
) -> dict[str, Any]:
    """Let all controllers hop in all worlds, and drop the leg in each.

    Args:
        study: What is compared.
        worlds: Where.
        rates: Control rates and physics steps in a control period.
        on_done: Called with (parts done, parts in all).

    Returns:
        ``rows``, one per world, controller and command; ``worlds``, one per world and controller,
        with the largest median error and whether higher commands gave higher hops; ``drops`` and
        ``rates``.
    """
    import_pybullet()
    places = list(itertools.product(worlds, study.controllers))
    with ProcessWorkers(study.workers) as pool:
        hops = [pool.submit(_hop_timed, study, *place) for place in places]
        tried = [pool.submit(_rate, study, *rate) for rate in rates]
        drops = [pool.submit(_drop, study, world) for world in worlds]
        parts: list[Future[Any]] = [*hops, *tried, *drops]
        for done, part in enumerate(as_completed(parts), 1):
            part.result()
            on_done(done, len(parts))
    summaries = [(*place, *part.result()) for place, part in zip(places, hops, strict=True)]
    return {
        "rows": [_row(world, row) for world, _, summary, _ in summaries for row in summary],
        "worlds": [
            _judge(world, name, summary) | {"robot": study.leg(name).name, "cpu_s_per_s": cost}
            for world, name, summary, cost in summaries
        ],
        "drops": [part.result() for part in drops],
        "rates": [part.result() for part in tried],
        "bar_m": BAR,
        "seeds": study.seeds,
        "seed": study.seed,
        "timestep_s": study.timestep,
        "versions": software_versions("pybullet"),
    }


def _hop_timed(study: Engines, world: World, name: str) -> tuple[list[Summary], float]:
    """Return what the hops were like, and the processor's time per simulated time of one leg."""
    started = time.process_time()
    summary = _hop(study, world, name)
    return summary, (time.process_time() - started) / (sum(s.runs for s in summary) * FIXED_SECONDS)


def _hop(
    study: Engines,
    world: World,
    name: str,
    rate: float = CONTROL_RATE,
    timestep: float | None = None,
) -> list[Summary]:
    robot = study.leg(name)
    setup = RolloutConfig(
        robot,
        engine=world.engine,
        ground=world.ground,
        rate=rate,
        timestep=timestep or study.timestep,
        threads=1,
    )
    judged = evaluate(
        load_entries([name], robot, rate),
        setup,
        commands=study.commands,
        repeats=study.seeds,
        seed=study.seed,
        floor=world.floor,
        kinds=("fixed",),
    )
    return judged.evaluation.summary


def _row(world: World, row: Summary) -> dict[str, Any]:
    place = {"world": world.name, "engine": world.engine, "controller": row.controller}
    return place | {"command_m": row.command_m} | {name: getattr(row, name) for name in _SHOWN}


def _judge(world: World, name: str, summary: Sequence[Summary]) -> dict[str, Any]:
    """Condense a controller's commands; one without hops has no order."""
    errors = np.array([row.median_error_m for row in summary], np.float64)
    apexes = errors + [row.command_m for row in summary]
    hopped = all(row.hops for row in summary)
    largest = float(np.abs(errors).max())
    ordered = hopped and all(a < b for a, b in itertools.pairwise(apexes))
    return {
        "world": world.name,
        "controller": name,
        "largest_median_error_m": largest,
        "mean_median_error_m": float(np.abs(errors).mean()),
        "mean_std_m": float(np.mean([row.std_m for row in summary])) if hopped else None,
        "skipped_hops": sum(row.skipped_hops for row in summary),
        "ordered": ordered,
        "within_bar": largest <= BAR and ordered,
    }


def _drop(study: Engines, world: World) -> dict[str, Any]:
    """Drop the leg from 0.1 m with its joints held at 1 kHz; return how deep the foot sinks."""
    robot = study.leg(RATED)
    setup = on_floor(RolloutConfig(robot, engine=world.engine, ground=world.ground), world.floor)
    legs = make_simulator(
        setup.robot,
        1,
        engine=setup.engine,
        ground=setup.ground,
        rate=1000.0,
        timestep=min(study.timestep, 1e-3),
        threads=1,
    )
    reach = robot.thigh.length + robot.shank.length
    posture = joint_angles(robot, np.array([0.7 * reach, 0.0]))
    legs.stand(slice(None), posture, clearance=0.1)
    gaps = []
    for _ in range(1500):
        legs.step(60.0 * (posture - legs.q) - 0.3 * legs.qd)
        gaps.append(float(legs.foot_clearance()[0]))
    rebound = max(gaps[int(np.argmin(gaps)) :])
    return {
        "world": world.name,
        "deepest_sink_m": -min(gaps),
        "rebound_m": max(rebound, 0.0),
        "rest_sink_m": -gaps[-1],
    }


def _rate(study: Engines, rate: float, substeps: int) -> dict[str, Any]:
    """Try a control rate and physics steps in PyBullet, where the paper had energy shaping."""
    world = World(f"PyBullet, {rate:g} Hz", "pybullet", "rigid")
    row = {"controller": RATED, "rate_hz": rate, "physics_hz": rate * substeps}
    shown = ("largest_median_error_m", "mean_std_m", "skipped_hops")
    try:
        summary = _hop(study, world, RATED, rate, 1 / (rate * substeps))
    except PhysicsError:
        return row | dict.fromkeys(shown)
    judged = _judge(world, RATED, summary)
    return row | {name: judged[name] for name in shown}


def _print(result: dict[str, Any]) -> None:
    table = Table(
        "world", "controller", "largest median error, mm", "std, mm", "skipped", "in order"
    )
    for row in result["worlds"]:
        table.add_row(
            row["world"],
            row["controller"],
            mm(row["largest_median_error_m"]),
            mm(row["mean_std_m"]),
            str(row["skipped_hops"]),
            "yes" if row["ordered"] else "no",
        )
    plain_console().print(table)
