"""How well a controller knows its height, where it records what it believes."""

from collections.abc import Sequence

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.evaluate.metrics import START_SECONDS
from hopping_leg.evaluate.result import Estimator
from hopping_leg.hop_detection import trace_hops
from hopping_leg.trace import Trace

HEIGHT = "estimated_height_m"
"""Trace column: base height as estimated at each tick, m."""

APEX = "estimated_apex_m"
"""Trace column: height of the last apex as estimated after its flight, m."""


def has_estimate(trace: Trace) -> bool:
    """Tell whether a run has an estimated height and a true one to compare it with."""
    if HEIGHT not in trace.table.columns:
        return False
    both = trace.column(HEIGHT) - trace.column("height_m")
    return bool(np.isfinite(both).any())


def judge_estimator(controller: str, traces: Sequence[Trace]) -> Estimator | None:
    """Compare estimated with true heights over all runs, the first 2 s left out.

    Returns:
        None where the controller records no estimate.
    """
    estimating = [trace for trace in traces if has_estimate(trace)]
    if not estimating:
        return None
    flight = np.concatenate([_errors(trace, flying=True) for trace in estimating])
    stance = np.concatenate([_errors(trace, flying=False) for trace in estimating])
    apex = np.concatenate([apex_errors(trace) for trace in estimating])
    return Estimator(
        controller=controller,
        flight_bias_m=_mean(flight),
        flight_std_m=_std(flight),
        stance_bias_m=_mean(stance),
        stance_std_m=_std(stance),
        apex_bias_m=_mean(apex),
        apex_std_m=_std(apex),
        hops=len(apex),
    )


def _errors(trace: Trace, *, flying: bool) -> Array:
    error = trace.column(HEIGHT) - trace.column("height_m")
    settled = trace.column("time_s") >= START_SECONDS
    phase = (trace.column("foot_clearance_m") > 0) == flying
    chosen: Array = error[settled & phase & np.isfinite(error)]
    return chosen


def apex_errors(trace: Trace) -> Array:
    """Return estimated minus true apex of every hop that the controller noticed, m, (hops,).

    A controller corrects its apex after touchdown: its next value after a true apex is that hop's.
    """
    if APEX not in trace.table.columns:
        return np.empty(0)
    estimate = trace.column(APEX)
    hops = trace_hops(trace)
    ends = np.append(hops.tick, len(estimate))[1:]
    settled = trace.column("time_s")[hops.tick] >= START_SECONDS
    errors = []
    for start, end, apex, counts in zip(hops.tick, ends, hops.apex, settled, strict=True):
        changes = np.flatnonzero(np.diff(estimate[start:end]))
        if counts and len(changes):
            errors.append(estimate[start + changes[0] + 1] - apex)
    return np.array(errors)


def _mean(values: Array) -> float:
    return float(np.mean(values)) if len(values) else float("nan")


def _std(values: Array) -> float:
    return float(np.std(values)) if len(values) else float("nan")
