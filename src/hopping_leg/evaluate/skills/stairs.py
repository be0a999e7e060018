"""Hopping on a ground that rises and falls in steps that the controller does not know of."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers import Controller, RolloutConfig, rollout
from hopping_leg.evaluate import metrics
from hopping_leg.hop_detection import trace_hops
from hopping_leg.sim.perturbation import Perturbation
from hopping_leg.trace import Trace

STAIRS = (0.0, 0.01, 0.02, 0.03, 0.02, 0.01, 0.0)
"""Height of the ground, m, for a leg of the paper's size."""

_SECONDS = 3.0
"""On each step."""


@dataclass(frozen=True)
class Stair:
    """One controller on one step; heights are above the ground of the moment."""

    command_m: float
    step: int
    """Number of the step."""
    ground_m: float
    """Above where the leg began."""
    first_error_m: float
    """Apex minus command of the first hop on it, median over runs; after the start's own settling
    on the first step."""
    median_error_m: float
    """Median apex minus command of all later hops on it."""
    hops: int
    missed_runs: int
    """Runs without a hop on it: their errors are standing height minus command."""
    runs: int


@dataclass(frozen=True)
class Stairs:
    """One controller at one command, the whole way up and down."""

    command_m: float
    worst_first_error_m: float
    """Largest ``first_error_m`` of all steps by magnitude."""
    worst_error_m: float
    """Largest ``median_error_m`` of all steps by magnitude."""
    skipped_hops: int
    body_contacts: int
    runs: int


def climb(
    controller: Controller,
    setup: RolloutConfig,
    commands: Sequence[float],
    *,
    stairs: Sequence[float],
    repeats: int,
    seed: int,
) -> tuple[list[Stair], list[Stairs]]:
    """Let a controller hop over stairs, in MuJoCo; ``stairs`` are heights of the ground, m."""
    each = np.repeat(np.asarray(commands, float), repeats)
    ticks, count = round(_SECONDS * setup.rate), len(each)
    ground = np.repeat(np.asarray(stairs, float), ticks)
    calm = np.zeros((len(ground), count))
    perturbation = Perturbation(
        (setup.robot,) * count,
        np.zeros((*calm.shape, 2)),
        calm,
        np.repeat(ground[:, None], count, axis=1),
    )
    run = rollout(
        controller, setup, np.tile(each, (len(ground), 1)), seed, perturbation=perturbation
    )
    traces = [run.trace(leg) for leg in range(count)]
    rows: list[Stair] = []
    wholes: list[Stairs] = []
    for k, command in enumerate(commands):
        own = traces[k * repeats : (k + 1) * repeats]
        for step, level in enumerate(stairs):
            begin = step * ticks if step else round(metrics.START_SECONDS * setup.rate)
            rise = level - stairs[step - 1] if step else 0.0
            errors = [_errors(trace, range(begin, (step + 1) * ticks), rise) for trace in own]
            missed = [trace.column("height_m")[:1] - command for trace in own]
            first = [e[:1] if len(e) else m for e, m in zip(errors, missed, strict=True)]
            later = [e[1:] if len(e) > 1 else m for e, m in zip(errors, missed, strict=True)]
            centre, usual = (float(np.median(np.concatenate(hops))) for hops in (first, later))
            counts = (sum(map(len, errors)), sum(not len(e) for e in errors), len(own))
            rows.append(Stair(command, step, level, centre, usual, *counts))
        steps = rows[-len(stairs) :]
        wholes.append(
            Stairs(
                command_m=command,
                worst_first_error_m=max((s.first_error_m for s in steps), key=abs),
                worst_error_m=max((s.median_error_m for s in steps), key=abs),
                skipped_hops=sum(map(metrics.skipped_in_run, own)),
                body_contacts=sum(w.body_contacts for trace in own for w in metrics.measure(trace)),
                runs=len(own),
            )
        )
    return rows, wholes


def _errors(trace: Trace, steps: range, rise: float) -> Array:
    """Return apex minus command of the hops that began on a step, m.

    The ground is asked to rise at the first tick of ``steps`` and moves once the foot is clear.
    """
    height, rate = trace.column("height_m"), trace.column("height_rate_m_s")
    hops = trace_hops(trace)
    period = np.diff(trace.column("time_s")).mean()
    jump = np.diff(height) - period * (rate[1:] + rate[:-1]) / 2
    moved = np.flatnonzero(np.abs(jump) > abs(rise) / 2) if rise else np.array([steps.start])
    moved = moved[(moved >= steps.start - 1) & (moved < steps.stop)]
    landed = np.flatnonzero(~hops.in_flight)
    landed = landed[landed > moved[0]] if len(moved) else landed[:0]
    if not len(landed):
        return np.empty(0)
    counted = (hops.tick > landed[0]) & (hops.tick < steps.stop)
    errors: Array = hops.apex[counted] - trace.column("command_m")[0]
    return errors
