"""What a teacher reaches: heights that it does not reach on a leg are not asked of its student.

The teacher hops at heights of the whole range; the longest run of those that it reaches is what the
leg is asked for in training. A training for any leg draws its legs, and leaves out those with fewer
than two such heights; what was found is kept in a file, so that a training that goes on does not
look again.
"""

import itertools
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from hopping_leg import io
from hopping_leg.controllers.mpc import HopShape, Planning, TrueStateMpc
from hopping_leg.errors import UsageError
from hopping_leg.rl.dagger import DaggerConfig
from hopping_leg.rl.onnx_export import every_centimetre
from hopping_leg.rl.policy_evaluation import CommandResult, evaluate_policy
from hopping_leg.rl.recipe import Recipe
from hopping_leg.robot import Robot
from hopping_leg.sim import NO_NOISE, compile_physics
from hopping_leg.sim.any_leg import TaskLeg, draw_any_leg
from hopping_leg.workers import ProcessWorkers, RayWorkers

_REACHED = 0.005  # median error with which the teacher reaches a height on the robot, m
_REACHED_DRAWN = 0.006  # the same on a drawn leg of the paper's size, m
_HEIGHTS, _LEAST = 9, 2  # tried on a drawn leg, and reached at least
_SECONDS, _STEP = 3.5, 5e-4
_AT_ONCE = 8  # legs in one task of a worker; what it found is kept at its end
_BETWEEN_SEEDS = 1_000_000  # legs of which no two trainings draw the same


def within_reach(recipe: Recipe, robot: Robot) -> Recipe:
    """Return a recipe for the heights that its teacher reaches.

    A recipe without a teacher stays as it is. The heights are the longest run of centimetres
    without a skipped hop or a body on the ground, and with a small median error.

    Raises:
        UsageError: There are none.
    """
    if not isinstance(recipe.algorithm, DaggerConfig):
        return recipe
    rate, heights = recipe.task.rate, every_centimetre(recipe.task.command_bounds)
    teacher = TrueStateMpc(robot, recipe.algorithm.teacher, rate=rate)
    results = evaluate_policy(teacher, robot, heights, rate=rate, legs=2, seconds=5.0)
    longest = _longest_run(results, lambda result: _hops(result, _REACHED))
    if len(longest) < 3:
        raise UsageError(
            f"The teacher reaches no range of heights between {heights[0]:g} and {heights[-1]:g} m"
            f" on {robot.name}; check masses, lengths and motors with `hop robots check`, or give"
            " other --heights."
        )
    if len(longest) == len(heights):
        return recipe
    return recipe.within(longest[0].command_m, longest[-1].command_m)


def _longest_run(
    results: list[CommandResult], reached: Callable[[CommandResult], bool]
) -> list[CommandResult]:
    runs = [list(run) for good, run in itertools.groupby(results, key=reached) if good]
    return max(runs, key=len, default=[])


def _hops(result: CommandResult, most: float) -> bool:
    """Tell whether hops missed by so much at most, m, none skipped and no body on the ground."""
    clean = result.hops > 0 and result.skipped_hops == 0 and result.body_contact_ticks == 0
    return clean and abs(result.median_error_m) <= most


@dataclass(frozen=True)
class Reach:
    """Heights, m, that the teacher reaches on a drawn leg."""

    leg: int
    """Seed of the leg."""
    low: float
    high: float


def find_reach(
    leg: int, heights: tuple[float, float], shape: HopShape, planning: Planning
) -> Reach | None:
    """Return the heights that the teacher reaches on a leg, None for hardly any.

    The range, m, is that of a leg of the paper's size and grows with the leg.
    """
    robot = draw_any_leg(leg).true
    asked = tuple(robot.size * float(h) for h in np.linspace(*heights, _HEIGHTS))
    results = evaluate_policy(
        TrueStateMpc(robot, shape, planning), robot, asked, legs=1, seconds=_SECONDS,
        disturbance=NO_NOISE, timestep=_STEP, threads=1,
    )  # fmt: skip
    most = robot.size * _REACHED_DRAWN
    longest = _longest_run(results, lambda result: _hops(result, most))
    if len(longest) < _LEAST:
        return None
    return Reach(leg, longest[0].command_m, longest[-1].command_m)


def _find_some(
    legs: range, heights: tuple[float, float], shape: HopShape, planning: Planning
) -> list[Reach]:
    return [r for leg in legs if (r := find_reach(leg, heights, shape, planning)) is not None]


def find_legs(
    recipe: Recipe,
    seed: int,
    file: Path,
    processes: int,
    ray: str | None,
    on_progress: Callable[[float], None],
) -> list[TaskLeg]:
    """Return the legs of a training for any leg, none for others; the seed decides on them.

    Args:
        recipe: Of the training.
        seed: Of the training.
        file: What it holds already is not looked for again.
        processes: Of this machine, which find out what the teacher reaches.
        ray: Address of a Ray cluster that does it instead.
        on_progress: Told the share that is done, 0 to 1.

    Raises:
        UsageError: The file is damaged.
    """
    if recipe.legs == "robot":
        return []
    assert isinstance(recipe.algorithm, DaggerConfig), "a teacher says what legs reach"
    count, heights = recipe.schedule.num_envs, recipe.task.command_bounds
    teacher = recipe.algorithm.teacher, recipe.algorithm.planning
    asked = io.plain({"seed": seed, "heights": heights, "teacher": [asdict(t) for t in teacher]})
    tried, found = 0, list[Reach]()
    if file.exists():
        stored = io.parse_json(file.read_bytes(), str(file))
        if stored.get("asked") == asked:
            found = [io.read_dataclass(Reach, row, str(file)) for row in stored["legs"]]
            tried = stored["tried"]
    compile_physics()
    first = seed * _BETWEEN_SEEDS + tried
    parts = (range(first + k, first + k + _AT_ONCE) for k in itertools.count(0, _AT_ONCE))
    with ProcessWorkers(processes) as local:
        workers = local if ray is None else RayWorkers(ray)
        reached = workers.map(_find_some, ((legs, heights, *teacher) for legs in parts))
        while len(found) < count:
            found += next(reached)
            tried += _AT_ONCE
            rows = [asdict(reach) for reach in found]
            io.write_json(file, {"asked": asked, "tried": tried, "legs": rows})
            on_progress(min(len(found) / count, 1.0))
    return [
        replace(draw_any_leg(reach.leg), command_range=(reach.low, reach.high))
        for reach in found[:count]
    ]
