"""What follows a change in the middle of a run that the controller does not know of.

Also the answer to a step of the command.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hopping_leg import hop_detection, io
from hopping_leg.arrays import Array
from hopping_leg.controllers import Controller, RolloutConfig, rollout
from hopping_leg.evaluate.metrics import START_SECONDS
from hopping_leg.evaluate.robustness.axes import Case, axis_named, times
from hopping_leg.evaluate.statistics import with_misses
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim.perturbation import Perturbation
from hopping_leg.trace import Trace

SECONDS, AT = 12.0, 5.0
"""Duration of each run, and when it changes, s."""

RUNS = 7
"""Runs of a change and command per seed of the suite: with few of them, noise decides on which side
of the bound a median falls."""

HOPS = 5
"""Hops after a change that have a row of their own."""

BACK = 0.01
"""Distance from command or steady state at which a controller is back, m."""


def _on_axis(name: str, level: float) -> Callable[[Robot], Robot]:
    return lambda robot: axis_named(name).alter(Case(robot), level).robot


CHANGES: dict[str, Callable[[Robot], Robot]] = {
    "payload +20 %": _on_axis("payload", 0.2),
    "payload -20 %": _on_axis("payload", -0.2),
    "ground time constant 0.02 s": lambda robot: io.replace_at(
        robot, "contact.time_constant", 0.02
    ),
    "ground time constant x2": lambda robot: times(robot, 2.0, "contact.time_constant"),
    "delay +5 ms": _on_axis("delay", 0.005),
    "rail friction x3": lambda robot: times(robot, 3.0, "rail.friction"),
}
"""What a leg becomes."""


@dataclass(frozen=True)
class _Run:
    """One leg: what it becomes, and its command before and after."""

    change: str
    before: float
    after: float


def study_changes(
    controller: Controller,
    setup: RolloutConfig,
    commands: Sequence[float],
    repeats: int,
    seed: int,
    on_tick: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Let a controller that knows ``setup`` alone meet all changes and steps, in one batch.

    Steps go from the lowest command to the highest and back.

    Returns:
        ``recovery``, a row per change and command, and ``steps``, a row per step. Of recoveries,
        ``back_after_hops`` counts hops until their median distance is small, scatter included,
        and ``centred_after_hops`` until the median of their errors is.
    """
    runs = [_Run(change, command, command) for change in CHANGES for command in commands]
    low, high = min(commands), max(commands)
    runs += [_Run("", *pair) for pair in ((low, high), (high, low)) if low < high]
    legs = [run for run in runs for _ in range(repeats)]
    robots = {change: alter(setup.robot) for change, alter in CHANGES.items()} | {"": setup.robot}
    ticks, change = round(SECONDS * setup.rate), round(AT * setup.rate)
    late = np.arange(ticks)[:, None] >= change
    asked = np.where(late, [run.after for run in legs], [run.before for run in legs])
    nothing = np.zeros((ticks, len(legs)))
    record = rollout(
        controller,
        setup,
        asked,
        int(np.random.SeedSequence([seed, len(legs)]).generate_state(1)[0]),
        on_tick,
        perturbation=Perturbation(
            (setup.robot,) * len(legs),
            np.zeros((ticks, len(legs), 2)),
            nothing,
            nothing,
            tuple(robots[run.change] for run in legs),
            change,
        ),
    )
    traces = [record.trace(leg) for leg in range(len(legs))]
    groups = [traces[k * repeats : (k + 1) * repeats] for k in range(len(runs))]
    pairs = list(zip(runs, groups, strict=True))
    return {
        "recovery": [_recovery(run, group, change) for run, group in pairs if run.change],
        "steps": [_step(run, group, change) for run, group in pairs if not run.change],
    }


def hops_after(trace: Trace, tick: int) -> Array:
    """Return the apexes whose flight began after a tick, in order, m, (hops,)."""
    hops = hop_detection.trace_hops(trace)
    grounded = np.flatnonzero(~hops.in_flight[tick:])
    return hops.apex[hops.tick > tick + grounded[0]] if len(grounded) else np.empty(0)


def _recovery(run: _Run, traces: Sequence[Trace], change: int) -> dict[str, Any]:
    start = round(START_SECONDS * change / AT)
    stood = [float(trace.column("height_m")[0]) for trace in traces]
    found = [hop_detection.trace_hops(trace) for trace in traces]
    before = [h.apex[(h.tick >= start) & (h.tick < change)] - run.before for h in found]
    every = [hops_after(trace, change) - run.after for trace in traces]
    after = [_padded(e, s - run.after) for e, s in zip(every, stood, strict=True)]
    sizes = [_median(np.abs(_kth(after, hop))) for hop in range(HOPS)]
    centres = [_median(_kth(after, hop)) for hop in range(HOPS)]
    later = _all([errors[HOPS:] for errors in every], [s - run.after for s in stood])
    settled, centre = _median(np.abs(later)), _median(later)
    return {
        "change": run.change,
        "command_m": run.after,
        "before_abs_error_m": _median(np.abs(_all(before, [s - run.before for s in stood]))),
        "hop_abs_errors_m": sizes,
        "later_abs_error_m": settled,
        "later_error_m": centre,
        "back_after_hops": _back([*sizes, settled]),
        "hop_errors_m": centres,
        "centred_after_hops": _back([*centres, centre]),
    }


def _step(run: _Run, traces: Sequence[Trace], change: int) -> dict[str, Any]:
    after = [hops_after(trace, change) for trace in traces]
    steady = [np.median(apexes[HOPS:]) if len(apexes) > HOPS else run.after for apexes in after]
    stood = [float(trace.column("height_m")[0]) for trace in traces]
    padded = [_padded(apexes, s) for apexes, s in zip(after, stood, strict=True)]
    distances = [np.abs(a - s) for a, s in zip(padded, steady, strict=True)]
    sizes = [_median(_kth(distances, hop)) for hop in range(HOPS)]
    return {
        "from_m": run.before,
        "to_m": run.after,
        "steady_error_m": _median(np.array([np.median(a[HOPS:]) - run.after for a in padded])),
        "hop_distances_m": sizes,
        "settled_after_hops": _back(sizes),
    }


def _padded(values: Array, miss: float) -> Array:
    """Return a value for each of the first hops; those that a run lacks are misses."""
    return np.append(values, np.full(max(0, HOPS + 1 - len(values)), miss))


def _all(errors: Sequence[Array], misses: Sequence[float]) -> Array:
    """Return the errors of runs of equal length in one row, m."""
    return np.concatenate(with_misses(errors, [1.0] * len(errors), misses))


def _kth(rows: Sequence[Array], hop: int) -> Array:
    return np.array([row[hop] for row in rows])


def _median(values: Array) -> float:
    return float(np.median(values))


def _back(sizes: Sequence[float]) -> int | None:
    """Return the number of hops after which all others are near; None if the last is not."""
    far = [k + 1 for k, size in enumerate(sizes) if abs(size) > BACK]
    last = max(far, default=0)
    return last if last < len(sizes) else None
