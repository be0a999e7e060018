"""Search for the gains of energy shaping: CMA-ES, all candidates hopping at once.

A search can be killed at any moment: the costs of every finished generation are kept, and the same
call repeats the search from them without simulating.
"""

import dataclasses
import itertools
import json
import shlex
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hopping_leg import cma_strategy, errors, hop_detection, io
from hopping_leg.arrays import Array
from hopping_leg.controllers import Rollout, RolloutConfig, rollout
from hopping_leg.controllers.energy_shaping.controller import EnergyShaping
from hopping_leg.controllers.energy_shaping.gains import (
    ROBUST,
    GainFile,
    ShapingGains,
    load_gains,
    save_gains,
    scale_gains,
)
from hopping_leg.robot import Robot, load_robot

SETTLED = 2.0  # hops before this do not count, s
_RATE = 1.5  # fewer hops per second than this cost
_FLIGHT = 0.1  # cost of a lack of flight, m: a tenth of the time, 1 cm
_KNEE, _BASE = 0.012, 0.06  # less room than this between knee or base and the ground costs, m


@dataclass(frozen=True)
class CommandScore:
    """How a candidate hops at one command."""

    command: float
    """Desired apex, m."""
    median: float
    """Median of all apexes, m; NaN without hops."""
    std: float
    """Standard deviation of all apexes, m; NaN without hops."""
    rate: float
    """Hops per second."""
    flight: float
    """Share of the time with the foot off the ground."""
    knee_clearance: float
    """Least gap between knee and ground, m."""
    base_clearance: float
    """Least gap between base and ground, m."""


def score(rollout: Rollout, command: float, legs: slice) -> CommandScore:
    """Score the legs of a rollout that have one command."""
    data, kept = rollout.data, rollout.time >= SETTLED
    period = rollout.time[1] - rollout.time[0]
    names = ("height_m", "height_rate_m_s", "foot_clearance_m")
    columns = (data[name][kept, legs].T for name in names)
    hops = [
        hop_detection.measure_hops(h, v, c, 1 / period) for h, v, c in zip(*columns, strict=True)
    ]
    apex = np.concatenate([h.apex for h in hops])
    settled = len(hops) * kept.sum() * period
    return CommandScore(
        command,
        float(np.median(apex)) if len(apex) else float("nan"),
        float(np.std(apex)) if len(apex) else float("nan"),
        len(apex) / settled,
        sum(h.flight_ticks for h in hops) / sum(h.ticks for h in hops),
        float(data["knee_clearance_m"][kept, legs].min()),
        float(data["base_clearance_m"][kept, legs].min()),
    )


def cost(scores: list[CommandScore], flight: float = 0.0) -> float:
    """Return scatter, what bias no calibration removes, missed hops and lack of room, mm.

    Less than the asked share of the time in flight costs too.
    """
    if any(np.isnan(s.median) for s in scores):
        return 500.0
    _, _, residual = _line(scores)
    terms = [
        s.std
        + abs(r)
        + 0.03 * max(0.0, _RATE - s.rate)
        + _FLIGHT * max(0.0, flight - s.flight)
        + max(0.0, _KNEE - s.knee_clearance)
        + max(0.0, _BASE - s.base_clearance)
        for s, r in zip(scores, residual, strict=True)
    ]
    return 1e3 * float(np.mean(terms))


def calibrated(gains: ShapingGains, scores: list[CommandScore]) -> ShapingGains:
    """Return the gains with the affine height estimate that would have met the commands."""
    shift, scale, _ = _line([s for s in scores if not np.isnan(s.median)])
    return dataclasses.replace(
        gains,
        height_offset=shift + scale * gains.height_offset,
        height_scale=scale * gains.height_scale,
    )


def _line(scores: list[CommandScore]) -> tuple[float, float, Array]:
    """Fit median - 0.3 = shift + scale (command - 0.3), m; return both and the residuals, m."""
    lean = np.array([s.command for s in scores]) - 0.3
    reached = np.array([s.median for s in scores]) - 0.3
    scale, shift = np.polyfit(lean, reached, 1)
    return float(shift), float(scale), reached - shift - scale * lean


SPACE: dict[str, tuple[float, float]] = {
    "exponent": (0.2, 2.0),
    "kp_y": (10.0, 400.0),
    "kd_y": (1.0, 20.0),
    "push_damping": (0.0, 100.0),
    "push_rate": (0.4, 1.3),
    "push_rate_slope": (0.0, 10.0),
    "liftoff_length": (0.17, 0.265),
    "liftoff_slope": (0.1, 1.0),
    "landing_length": (0.14, 0.235),
    "landing_slope": (0.0, 0.9),
    "retract_time": (0.03, 0.16),
    "hip_stiffness": (3.0, 25.0),
    "hip_damping": (0.05, 0.6),
    "knee_stiffness": (1.0, 8.0),
    "knee_damping": (0.0, 0.3),
    "touchdown_stiffness": (200.0, 2000.0),
    "touchdown_damping": (10.0, 80.0),
    "touchdown_rate": (-0.8, -0.2),
    "flight_min": (0.06, 0.17),
    "flight_min_slope": (0.0, 1.2),
    "position_pull": (0.05, 0.4),
}
"""Range of each searched gain; units as in ``ShapingGains``. What is not here stays as it is:
k0 only sets the first hops, the height calibration follows from the medians."""

_LOW, _HIGH = np.array(list(SPACE.values())).T


def to_unit(gains: ShapingGains) -> Array:
    """Return the searched gains as a point in the unit cube."""
    values = np.array([float(getattr(gains, name)) for name in SPACE])
    point: Array = np.clip((values - _LOW) / (_HIGH - _LOW), 0.0, 1.0)
    return point


def from_unit(point: Array, base: ShapingGains) -> ShapingGains:
    """Return ``base`` with the searched gains of a point in the unit cube."""
    values = _LOW + np.clip(point, 0.0, 1.0) * (_HIGH - _LOW)
    return dataclasses.replace(base, **dict(zip(SPACE, values.tolist(), strict=True)))


FIRST_GAINS = (0.85, 1.0, 1.15)
"""Factors on k0, one run each: the gain update must find its way from all of them."""

_LAST_SEED = 9
"""Of noise and delay where start and find are compared; 0 to 8 searched and calibrated."""


@dataclass(frozen=True)
class Search:
    """How long and how finely to search."""

    generations: int = 30
    """Generations of CMA-ES."""
    population: int = 12
    """Candidates per generation."""
    seconds: float = 6.0
    """Simulated time per run, the first 2 s of which do not count."""
    step: float = 0.12
    """First step size, as a share of each gain's range."""
    flight: float = 0.0
    """Share of the time in the air that is asked for at every height; less costs."""
    commands: tuple[float, ...] = (0.22, 0.25, 0.30, 0.35, 0.40)
    """Heights that a candidate is tried at, m: those that the leg's motors reach."""
    threads: int = 0
    """Physics threads, 0 for one per core."""

    def __post_init__(self) -> None:
        if self.generations < 1 or self.population < 4:
            raise errors.UsageError(
                "A search needs --generations of 1 and a --population of 4 or more."
            )
        if not 3 <= self.seconds <= 600 or not 0 < self.step <= 1:
            raise errors.UsageError("--seconds must lie between 3 and 600, --step between 0 and 1.")
        if not 0 <= self.flight < 1:
            raise errors.UsageError("--flight is a share of the time, from 0 to below 1, e.g. 0.5.")
        if len(self.commands) < 3 or not all(c > 0 for c in self.commands):
            raise errors.UsageError("A search needs at least three --commands, heights in m.")


def evaluate(
    candidates: list[ShapingGains],
    config: RolloutConfig,
    commands: tuple[float, ...],
    seconds: float,
    seed: int,
) -> list[list[CommandScore]]:
    """Return each candidate's scores at the commands, m, over all first gains, in one rollout."""
    firsts = len(FIRST_GAINS)
    runs = len(commands) * firsts
    fields = [field.name for field in dataclasses.fields(ShapingGains)]
    stacked = {n: np.repeat([getattr(c, n) for c in candidates], runs) for n in fields}
    stacked["k0"] = stacked["k0"] * np.tile(FIRST_GAINS, len(candidates) * len(commands))
    command = np.tile(np.repeat(commands, firsts), len(candidates))
    controller = EnergyShaping(config.robot, ShapingGains(**stacked), ROBUST, rate=config.rate)
    ticks = round(seconds * config.rate)
    run = rollout(controller, config, np.tile(command, (ticks, 1)), seed)
    return [
        [
            score(run, c, slice(first, first + firsts))
            for c, first in zip(commands, range(i, i + runs, firsts), strict=True)
        ]
        for i in range(0, len(candidates) * runs, runs)
    ]


def search(
    start: ShapingGains,
    config: RolloutConfig,
    options: Search,
    seed: int,
    log: Path,
    report: Callable[[int, float], None],
) -> ShapingGains:
    """Improve gains; noise and delay take seeds 0 to 8 in turn.

    Args:
        start: Where to begin.
        config: The world to hop in.
        options: How long.
        seed: Seed of the search.
        log: One JSON line per generation; an interrupted search goes on from it.
        report: Called with (generations done, lowest cost so far).
    """
    strategy = cma_strategy.seeded_strategy(
        to_unit(start), options.step, [0.0, 1.0], options.population, seed
    )
    known = _read_log(log, options, seed)
    log.parent.mkdir(parents=True, exist_ok=True)
    lowest = np.inf
    for generation in range(options.generations):
        points = strategy.ask()
        if generation < len(known):
            costs = known[generation]
        else:
            candidates = [from_unit(np.asarray(p), start) for p in points]
            scores = evaluate(
                candidates, config, options.commands, options.seconds, generation % _LAST_SEED
            )
            costs = [cost(s, options.flight) for s in scores]
            entry = {
                "seed": seed, "flight": options.flight, "commands": options.commands,
                "costs": costs,
            }  # fmt: skip
            with log.open("a", encoding="utf-8") as file:
                file.write(json.dumps(entry) + "\n")
        strategy.tell(points, costs)
        lowest = min(lowest, *costs)
        report(generation + 1, lowest)
    return from_unit(np.asarray(strategy.result.xfavorite), start)


def tune(
    robot: Robot,
    robot_name: str,
    start: str,
    options: Search,
    seed: int,
    out: Path,
    report: Callable[[int, float], None],
) -> dict[str, Any]:
    """Search gains for a leg and write the better of start and find to ``out / "gains.toml"``.

    The gain file names the leg ``robot_name``; ``start`` is the shipped name or path of gains, and
    ``report`` is called with (generations done, lowest cost so far).

    Returns:
        Plain values: the search, its costs, gains, and scores of start and find, both calibrated.
    """
    config = RolloutConfig(robot, threads=options.threads)
    found = load_gains(start)
    first = scale_gains(found.gains, load_robot(found.robot), robot)
    pair = [first, search(first, config, options, seed, out / "log.jsonl", report)]
    for noise, i in itertools.product(range(2), range(2)):
        tried = evaluate([pair[i]] * 4, config, options.commands, options.seconds, noise)
        pair[i] = calibrated(pair[i], list(itertools.chain(*tried)))
    scores = [
        evaluate([g], config, options.commands, 2 * options.seconds, _LAST_SEED)[0] for g in pair
    ]
    costs = [cost(s, options.flight) for s in scores]
    better = pair[1] if costs[1] < costs[0] else pair[0]
    save_gains(
        out / "gains.toml", GainFile(robot_name, _command(robot_name, start, options, seed), better)
    )
    return {
        "generations": options.generations,
        "seed": seed,
        "flight": options.flight,
        "cost_before_mm": costs[0],
        "cost_after_mm": costs[1],
        "before": [dataclasses.asdict(s) for s in scores[0]],
        "after": [dataclasses.asdict(s) for s in scores[1]],
        "gains": {k: float(v) for k, v in vars(better).items()},
    }


def _command(robot: str, start: str, options: Search, seed: int) -> str:
    """Return the command that searches so, what goes without saying left out."""
    words = ["hop", "tune", "energy-shaping", "--robot", robot, "--start", start]
    words += ["--seed", str(seed)]
    usual = vars(Search()) | {"threads": options.threads}
    for name, value in vars(options).items():
        if value != usual[name]:
            words += [f"--{name}", *_word(value).split()]
    return shlex.join(words)


def _word(value: object) -> str:
    return " ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def _read_log(log: Path, options: Search, seed: int) -> list[list[float]]:
    """Return the costs of finished generations; a line cut short by a kill is dropped."""
    known: list[list[float]] = []
    if not log.is_file():
        return known
    lines = log.read_text(encoding="utf-8").splitlines(True)
    whole = [line for line in lines if line[-2:] == "}\n"]
    for entry in map(json.loads, whole):
        commands = tuple(entry.get("commands", Search().commands))
        found = entry["seed"], len(entry["costs"]), entry.get("flight", 0.0), commands
        if found != (seed, options.population, options.flight, options.commands):
            raise errors.UsageError(
                f"{log} belongs to a search with seed {found[0]}, population {found[1]}, flight"
                f" {found[2]:g} and commands {_word(commands)}; repeat with those or choose another"
                " --out."
            )
        known.append(entry["costs"])
    io.write_atomically(log, "".join(whole).encode())
    return known
