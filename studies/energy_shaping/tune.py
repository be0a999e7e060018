"""Search the gains of energy shaping with CMA-ES; writes a gain file.

All candidates hop at once, each at the given heights and from three first gains, with the paper's
noise and delay: on the robot itself, or told that robot on twins of it, whose differences then
count as scatter. An interrupted search goes on where it was: call it again with the same options.
"""

import dataclasses
import itertools
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cma
import numpy as np

from hopping_leg import hop_detection
from hopping_leg.arrays import Array
from hopping_leg.cli import COMMAND
from hopping_leg.cli.options import JsonFile, RobotFile, say
from hopping_leg.controllers import Rollout, RolloutConfig, rollout
from hopping_leg.controllers.energy_shaping.controller import EnergyShaping
from hopping_leg.controllers.energy_shaping.gains import (
    GainFile,
    ShapingGains,
    load_gains,
    scale_gains,
)
from hopping_leg.io import write_atomically
from hopping_leg.robot import DEFAULT_ROBOT, Robot, load_robot
from hopping_leg.sim import LegSimulator
from hopping_leg.sim.randomization import draw_twin
from studies.shared import Row, main, once, show_rows

SETTLED = 2.0  # hops before this do not count, s
_RATE = 1.5  # fewer hops per second than this cost
_SKIPPED = 0.1  # cost of a skipped hop on twins, m: about what it lacks in height
_FLIGHT = 0.1  # cost of a lack of flight, m: a tenth of the time, 1 cm
_ALONE, _ON_TWINS = (0.012, 0.06), (0.01, 0.02)  # less room of knee and base than this costs, m

FIRST_GAINS = (0.85, 1.0, 1.15)
"""Factors on k0, one run each: the gain update must find its way from all of them."""

_LAST_SEED = 9
"""Of noise and delay where start and find are compared; 0 to 8 searched and calibrated."""

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

ON_TWINS = SPACE | {
    "exponent": (0.2, 2.5),
    "liftoff_length": (0.17, 0.275),
    "landing_slope": (-0.2, 0.9),
    "knee_damping": (0.0, 1.2),
    "touchdown_damping": (5.0, 80.0),
    "touchdown_force": (15.0, 60.0),
    "flight_min": (0.06, 0.22),
    "position_pull": (0.02, 0.4),
}
"""Ranges on twins, whose belts and drives want more damping."""

Space = dict[str, tuple[float, float]]


def to_unit(gains: ShapingGains, space: Space = SPACE) -> Array:
    """Return the searched gains as a point in the unit cube."""
    low, high = np.array(list(space.values())).T
    values = np.array([float(getattr(gains, name)) for name in space])
    point: Array = np.clip((values - low) / (high - low), 0.0, 1.0)
    return point


def from_unit(point: Array, base: ShapingGains, space: Space = SPACE) -> ShapingGains:
    """Return ``base`` with the searched gains of a point in the unit cube."""
    low, high = np.array(list(space.values())).T
    values = low + np.clip(point, 0.0, 1.0) * (high - low)
    return dataclasses.replace(base, **dict(zip(space, values.tolist(), strict=True)))


def save_gains(path: Path, found: GainFile) -> None:
    """Write a tuned set; an existing file is replaced only once the new one is complete."""
    # A JSON string is a TOML one.
    lines = [f"robot = {json.dumps(found.robot)}", f"source = {json.dumps(found.source)}", ""]
    lines += ["[gains]", *(f"{name} = {float(v)!r}" for name, v in vars(found.gains).items())]
    write_atomically(path, ("\n".join(lines) + "\n").encode())


@dataclass(frozen=True)
class CommandScore:
    """How a candidate hops at one command, over all runs."""

    command: float  # desired apex, m
    median: float  # of all apexes, m; NaN without hops
    std: float  # of all apexes, m; NaN without hops
    rate: float  # hops per second
    skipped: float  # skipped hops per hop
    flight: float  # share of the time with the foot off the ground
    knee_clearance: float  # least gap between knee and ground, m
    base_clearance: float  # least gap between base and ground, m


@dataclass(frozen=True)
class Tune:
    """Search the gains of energy shaping with CMA-ES."""

    robot: RobotFile = DEFAULT_ROBOT
    start: str = "by-hand"
    """Gains to begin from: by-hand, energy-shaping (the shipped result) or a gain file's path."""
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
    twins: int = 0
    """How many twins of the robot to draw and try every candidate on instead of the robot."""
    damped: bool = False
    """Search the ranges of twins also without any."""
    seed: int = 0
    """Seed of the search, and of the first twin; noise and delay take seeds 0 to 9."""
    threads: int = 0
    """Physics threads, 0 for one per core."""
    out: Path = Path("runs/tune")
    """Folder for the generations and the gains."""
    json: JsonFile = None

    def measure(self) -> Row:
        """Search, print what came out, write the gains; return scores and gains."""
        tuned = self.find()
        for row in ("before", "after"):
            show_rows(tuned[row], "command", "median", "std", "rate", "flight")
        say(f"Gains: {self.gains}")
        return tuned

    @property
    def gains(self) -> Path:
        """The gain file."""
        return self.out / "gains.toml"

    @property
    def legs(self) -> tuple[Robot, ...]:
        """What every candidate is tried on."""
        seeds = range(self.seed, self.seed + self.twins)
        return tuple(draw_twin(s, self.robot).robot for s in seeds) or (load_robot(self.robot),)

    def find(self) -> Row:
        """Write the better of start and find, both calibrated; return scores, costs and gains."""
        found, robot, legs = load_gains(self.start), load_robot(self.robot), self.legs
        config = RolloutConfig(robot, threads=self.threads)
        first = scale_gains(found.gains, load_robot(found.robot), robot)
        pair = [first, self.search(first, config)]
        for noise, i in itertools.product(range(2), range(2)):
            tried = evaluate([pair[i]] * 4, config, self.commands, self.seconds, noise, legs)
            pair[i] = calibrated(pair[i], list(itertools.chain(*tried)))
        scores = [
            evaluate([g], config, self.commands, 2 * self.seconds, _LAST_SEED, legs)[0]
            for g in pair
        ]
        costs = [self.cost(s) for s in scores]
        better = pair[1] if costs[1] < costs[0] else pair[0]
        save_gains(self.gains, GainFile(self.robot, COMMAND.get(), better))
        return {
            "generations": self.generations,
            "seed": self.seed,
            "flight": self.flight,
            "cost_before_mm": costs[0],
            "cost_after_mm": costs[1],
            "before": [dataclasses.asdict(s) for s in scores[0]],
            "after": [dataclasses.asdict(s) for s in scores[1]],
            "gains": {k: float(v) for k, v in vars(better).items()},
        }

    def search(self, start: ShapingGains, config: RolloutConfig) -> ShapingGains:
        """Improve gains; noise and delay take seeds 0 to 8 in turn."""
        normal = np.random.default_rng(self.seed).standard_normal
        settings = {"popsize": self.population, "bounds": [0.0, 1.0], "seed": np.nan, "verbose": -9}
        settings["randn"] = lambda *shape: normal(shape)
        space = ON_TWINS if self.twins or self.damped else SPACE
        strategy = cma.CMAEvolutionStrategy(to_unit(start, space), self.step, settings)
        for generation in range(self.generations):
            points = strategy.ask()
            candidates = [from_unit(np.asarray(point), start, space) for point in points]
            asked = {
                "robot": config.robot.digest,
                "candidates": [vars(candidate) for candidate in candidates],
                "commands": self.commands,
                "seconds": self.seconds,
                "flight": self.flight,
                "legs": [leg.digest for leg in self.legs],
            }
            file = self.out / "generations" / f"{generation}.json"
            costs = once(file, asked, self._costs, candidates, config, generation % _LAST_SEED)
            strategy.tell(points, costs["mm"])
        return from_unit(np.asarray(strategy.result.xfavorite), start, space)

    def _costs(self, candidates: list[ShapingGains], config: RolloutConfig, seed: int) -> Row:
        scores = evaluate(candidates, config, self.commands, self.seconds, seed, self.legs)
        return {"mm": [self.cost(one) for one in scores]}

    def cost(self, scores: list[CommandScore]) -> float:
        """Return scatter, what bias no calibration removes, missed hops and lack of room, mm.

        Less than the asked share of the time in flight costs too. On twins, whose heights tempt a
        search to keep close together, scatter and bias are those after a calibration.
        """
        if any(np.isnan(s.median) for s in scores):
            return 500.0
        _, scale, residual = _line(scores)
        stretch = 1.0 / max(scale, 0.1) if self.twins else 1.0
        knee, base = _ON_TWINS if self.twins else _ALONE
        terms = [
            stretch * (s.std + abs(r))
            + 0.03 * max(0.0, _RATE - s.rate)
            + (_SKIPPED * s.skipped if self.twins else 0.0)
            + _FLIGHT * max(0.0, self.flight - s.flight)
            + max(0.0, knee - s.knee_clearance)
            + max(0.0, base - s.base_clearance)
            for s, r in zip(scores, residual, strict=True)
        ]
        return 1e3 * float(np.mean(terms))


def score(rollout: Rollout, command: float, legs: slice) -> CommandScore:
    """Score the legs of a rollout that have one command."""
    data, kept = rollout.data, rollout.time >= SETTLED
    period = rollout.time[1] - rollout.time[0]
    columns = (data[name][kept, legs].T for name in hop_detection.COLUMNS)
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
        sum(h.skipped for h in hops) / max(len(apex), 1),
        sum(h.flight_ticks for h in hops) / sum(h.ticks for h in hops),
        float(data["knee_clearance_m"][kept, legs].min()),
        float(data["base_clearance_m"][kept, legs].min()),
    )


def evaluate(
    candidates: list[ShapingGains], config: RolloutConfig, commands: Sequence[float],
    seconds: float, seed: int, robots: Sequence[Robot],
) -> list[list[CommandScore]]:  # fmt: skip
    """Return each candidate's scores at the commands, m, over robots and first gains, in one run.

    Each robot hops once from one of the first gains, in turn; a single one from all of them.
    """
    firsts = max(len(FIRST_GAINS), len(robots))
    runs = len(commands) * firsts
    count = len(candidates) * runs
    fields = [field.name for field in dataclasses.fields(ShapingGains)]
    stacked: dict[str, Any] = {
        n: np.repeat([getattr(c, n) for c in candidates], runs) for n in fields
    }
    stacked["k0"] = stacked["k0"] * np.resize(np.resize(FIRST_GAINS, firsts), count)
    legs = LegSimulator(
        config.robot, count, rate=config.rate, timestep=config.timestep, threads=config.threads,
        robots=[robots[i % firsts % len(robots)] for i in range(count)],
    )  # fmt: skip
    controller = EnergyShaping(config.robot, ShapingGains(**stacked), rate=config.rate)
    asked = np.tile(np.repeat(commands, firsts), (round(seconds * config.rate), len(candidates)))
    run = rollout(controller, config, asked, seed, legs=legs)
    return [
        [
            score(run, c, slice(first, first + firsts))
            for c, first in zip(commands, range(i, i + runs, firsts), strict=True)
        ]
        for i in range(0, count, runs)
    ]


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


if __name__ == "__main__":
    raise SystemExit(main("energy_shaping.tune", Tune))
