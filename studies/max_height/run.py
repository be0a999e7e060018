"""How high the leg can hop with its torque: a search over ways to push, with nothing hidden.

No noise, no delay, and the true state decides: in flight the leg is held at a length, on the ground
hip and knee pull with torques that depend on whether the base falls or rises and on the leg's
length. CMA-ES looks for what keeps hopping highest. It is a lower bound of what is physically
possible and an upper one of what a policy, which must also be accurate, can be asked for.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress
from rich.table import Table

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.cli.options import at_least
from hopping_leg.cma_strategy import seeded_strategy
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.result_files import ResultCache
from hopping_leg.hop_detection import FLIGHT_CLEARANCE
from hopping_leg.robot import DEFAULT_ROBOT, JOINTS, Robot, load_robot
from hopping_leg.robot.kinematics import foot_position, joint_angles
from hopping_leg.sim import LegSimulator
from hopping_leg.terminal import plain_console

KNOTS = (0.45, 0.65, 0.85, 0.97)
"""Leg lengths, over the straight leg's, between which the torques are interpolated."""

_SIZE = 1 + 4 * len(KNOTS)
_FLIGHT = (0.6, 0.97)
"""Shortest and longest leg in flight, over the straight leg's."""

_START = 0.7
"""Leg length of the standing start, over the straight leg's."""

_STIFFNESS, _DAMPING = 20.0, 0.5
"""Joint PD in flight, N m/rad and N m s/rad."""

_SETTLE = 0.5
"""Share of a trial at its start that does not count."""

_SHORTEST_FLIGHT = 0.1
"""s."""

_LEAST_HOPS = 3
"""Hops in the rest without which a leg does not hop on."""

_STEP = 0.3
"""First step size of the search; parameters lie between 0 and 1."""


@dataclass(frozen=True)
class Reach:
    """Search for the highest lasting hops within torques, with the true state and no noise."""

    robot: str = DEFAULT_ROBOT
    """A shipped name or the path of a .toml file."""
    torques: tuple[tuple[float, float], ...] = ((6, 6), (8, 18), (10, 20))
    """Largest torques of hip and knee, N m at the joints, one search each, which begins with what
    the one before found: what `paper` and the other recipes may ask for, and the motors' limit of
    leg V2."""
    generations: int = 100
    """Of CMA-ES, for each pair."""
    population: int = 32
    """Candidates per generation."""
    seconds: float = 5.0
    """Of a trial; its first half does not count."""
    seed: int = 0
    """Of the search."""
    threads: int = 0
    """Threads of the physics, 0 for all cores; results do not depend on it."""
    folder: Path = Path("runs/bench-reach")
    """Where what was found for a pair is kept; it is not searched again."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        at_least(1, generations=self.generations)
        at_least(4, population=self.population)
        at_least(0, threads=self.threads, seed=self.seed)
        if not self.torques or not all(t > 0 for pair in self.torques for t in pair):
            raise UsageError("--torques must be pairs of positive torques, N m; e.g. 6 6 10 20.")
        with Progress(transient=True) as bar:
            task = bar.add_task("searching", total=None)
            result = measure_reach(
                self,
                ResultCache(self.folder),
                lambda done, total: bar.update(task, completed=done, total=total),
            )
        table = Table("hip, N m", "knee, N m", "apex, m", "hops/s", "rms hip", "rms knee", "hits")
        for row in result["rows"]:
            limits = [f"{row[f'{joint}_limit_nm']:g}" for joint in JOINTS]
            names = ("apex_m", "hop_rate_hz", "rms_hip_torque_nm", "rms_knee_torque_nm")
            cells = [f"{row[name]:.3g}" for name in names]
            table.add_row(*limits, *cells, str(row["body_contacts"]))
        plain_console().print(table)
        return result

    @cached_property
    def leg(self) -> Robot:
        """The robot."""
        return load_robot(self.robot)


def measure_reach(
    study: Reach, cache: ResultCache, on_done: Callable[[int, int], None] | None = None
) -> dict[str, Any]:
    """Search for the highest lasting hops within each pair of torques.

    Args:
        study: What is searched.
        cache: Keeps what was found for each pair.
        on_done: Called with the generations that are done and all.

    Returns:
        ``rows``, one per pair: median apex, hops per second, share in flight, RMS torques.
    """
    total = study.generations * len(study.torques)

    def say(earlier: int, done: int) -> None:
        if on_done is not None:
            on_done(earlier * study.generations + done, total)

    rows, way, before = [], np.full(_SIZE, 0.5), np.zeros(2)
    for earlier, limit in enumerate(map(np.array, study.torques)):
        first = _with_limit(way, before, limit)
        found = cache.load_or_run(
            "{:g}-{:g}".format(*limit),
            "{:g} and {:g} N m".format(*limit),
            _asked(study, limit, first),
            partial(_find, study, limit, first, partial(say, earlier)),
        )
        way, before = np.array(found["way"]), limit
        rows.append(found["row"])
    return {
        "rows": rows,
        "robot": study.leg.name,
        "generations": study.generations,
        "population": study.population,
        "seed": study.seed,
        "duration_s": study.seconds,
    }


def _asked(study: Reach, limit: Array, first: Array) -> dict[str, Any]:
    return {
        "robot": study.leg.digest,
        "limit": limit.tolist(),
        "first": first.tolist(),
        "generations": study.generations,
        "population": study.population,
        "seconds": study.seconds,
        "seed": study.seed,
    }


def _find(
    study: Reach, limit: Array, first: Array, on_done: Callable[[int], None]
) -> dict[str, Any]:
    """Return the best way to push within a limit and how it hops, as JSON values."""
    way = _search(study, limit, first, on_done)
    return {"way": way.tolist(), "row": _row(study, way, limit)}


def _with_limit(way: Array, before: Array, limit: Array) -> Array:
    """Return the way with the same torques, as far as another limit allows, (size,)."""
    torques = (way[1:] - 0.5).reshape(2, 2, len(KNOTS)) * (before / limit)[:, None]
    return np.append(way[0], np.clip(0.5 + torques, 0, 1).ravel())


def _search(study: Reach, limit: Array, start: Array, on_done: Callable[[int], None]) -> Array:
    """Return the best way to push that was found, no worse than the first, (size,)."""
    strategy = seeded_strategy(start, _STEP, [0.0, 1.0], study.population, study.seed)
    (first,) = hop(study, start[None], limit)
    best, found = first.score, start
    for generation in range(study.generations):
        candidates = strategy.ask()
        scores = [trial.score for trial in hop(study, np.array(candidates), limit)]
        strategy.tell(candidates, [-score for score in scores])
        if max(scores) > best:
            best, found = max(scores), np.array(candidates[int(np.argmax(scores))])
        on_done(generation + 1)
    return found


def _row(study: Reach, way: Array, limit: Array) -> dict[str, Any]:
    (trial,) = hop(study, way[None], limit)
    return {
        "hip_limit_nm": float(limit[0]),
        "knee_limit_nm": float(limit[1]),
        "apex_m": trial.apex,
        "hop_rate_hz": trial.hops / (study.seconds * (1 - _SETTLE)),
        "flight_fraction": trial.flight,
        "rms_hip_torque_nm": float(trial.rms[0]),
        "rms_knee_torque_nm": float(trial.rms[1]),
        "body_contacts": trial.contacts,
    }


@dataclass(frozen=True)
class Trial:
    """How one way to push hopped after the start.

    Attributes:
        apex: Median apex, m; 0 where the leg does not hop on.
        hops: Whole flights.
        flight: Share of the time with the foot off the ground.
        rms: Of the torques of hip and knee, N m, (2,).
        contacts: Ticks with base or knee on the ground, from the start on.
    """

    apex: float
    hops: int
    flight: float
    rms: Array
    contacts: int

    @property
    def score(self) -> float:
        """Apex, less for every touch of base or knee, m."""
        return self.apex - 0.01 * self.contacts


def hop(study: Reach, ways: Array, limit: Array) -> list[Trial]:
    """Let legs hop, each in its way.

    Args:
        study: Robot and duration.
        ways: Leg length in flight, then torques over the limit at the knots, for the falling hip
            and knee and the rising hip and knee; 0 to 1, (n, 1 + 4 knots).
        limit: Largest torques of hip and knee, N m, (2,).
    """
    robot, count = study.leg, len(ways)
    straight = robot.thigh.length + robot.shank.length
    legs = LegSimulator(robot, count, threads=study.threads)
    legs.stand(slice(None), joint_angles(robot, np.array([_START * straight, 0.0])))
    low, high = _FLIGHT
    lengths = straight * (low + (high - low) * ways[:, 0])
    posture = joint_angles(robot, np.stack([lengths, np.zeros(count)], axis=1))
    share = 2 * ways[:, 1:].reshape(count, 2, 2, len(KNOTS)) - 1
    ticks = round(study.seconds * legs.rate)
    height, clearance = np.empty((ticks, count)), np.empty((ticks, count))
    given, touched = np.empty((ticks, count, 2)), np.empty((ticks, count), np.bool_)
    for tick in range(ticks):
        height[tick], clearance[tick] = legs.height, legs.foot_clearance()
        touched[tick] = np.minimum(legs.base_clearance(), legs.knee_clearance()) <= 0
        held = _STIFFNESS * (posture - legs.q) - _DAMPING * legs.qd
        length = np.linalg.norm(foot_position(robot, legs.q), axis=1) / straight
        pushed = limit * _interpolate(share, legs.height_rate >= 0, length)
        torque = np.where((clearance[tick] > 0)[:, None], held, pushed)
        given[tick] = legs.step(np.clip(torque, -limit, limit))
    first = round(_SETTLE * ticks)
    shortest = round(_SHORTEST_FLIGHT * legs.rate)
    trials = []
    for leg in range(count):
        flying = clearance[first:, leg] >= FLIGHT_CLEARANCE
        tops = flight_tops(height[first:, leg], flying, shortest)
        trials.append(
            Trial(
                apex=float(np.median(tops)) if len(tops) >= _LEAST_HOPS else 0.0,
                hops=len(tops),
                flight=float(np.mean(flying)),
                rms=np.sqrt(np.mean(np.square(given[first:, leg]), axis=0)),
                contacts=int(touched[:, leg].sum()),
            )
        )
    return trials


def flight_tops(height: Array, flying: BoolArray, shortest: int) -> Array:
    """Return the highest point of every whole flight, m, (flights,).

    A leg that is thrown about in the air moves its base up and down, so apexes would count double.

    Args:
        height: Base height, m, (ticks,).
        flying: Whether the foot is clear of the ground, (ticks,).
        shortest: Ticks below which it is no flight but a bounce.
    """
    edges = np.flatnonzero(flying[1:] != flying[:-1]) + 1
    flights = [(a, b) for a, b in itertools.pairwise(edges) if flying[a] and b - a >= shortest]
    return np.array([height[a:b].max() for a, b in flights])


def _interpolate(share: Array, rising: BoolArray, length: Array) -> Array:
    """Return torques over the limit for leg lengths over the straight leg's, (n, 2)."""
    rows = np.arange(len(share))
    at = np.clip(np.interp(length, KNOTS, range(len(KNOTS))), 0, len(KNOTS) - 1)
    lower = np.minimum(at.astype(np.int64), len(KNOTS) - 2)
    rest = (at - lower)[:, None]
    now = share[rows, rising.astype(np.int64)]
    result: Array = now[rows, :, lower] * (1 - rest) + now[rows, :, lower + 1] * rest
    return result
