"""Stand, hop so many times, land, stand: hops made against asked, the height of a single one."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hopping_leg.controllers import Controller, RolloutConfig, rollout
from hopping_leg.controllers.stand_hop_land import STAND_SECONDS, StandHopLand
from hopping_leg.evaluate import metrics
from hopping_leg.evaluate.skills.landings import last_touchdown, peak_force
from hopping_leg.hop_detection import trace_hops
from hopping_leg.robot.parameters import Robot
from hopping_leg.trace import Trace

COUNTS = (1, 5)
"""Hops that are asked for."""

_HOP_SECONDS, _END_SECONDS = 0.8, 3.0
"""Time for each hop and, at the end, to land and stand, s."""

_REST_SECONDS, _STILL = 0.5, 0.005
"""At rest: the base moves less than this, m, in the last part of a run, s."""


@dataclass(frozen=True)
class Counted:
    """One controller asked for so many hops at one command; shares and medians over runs."""

    command_m: float
    asked: int
    """Hops."""
    exact: float
    """Share of runs with as many hops as were asked for."""
    fewest: int
    most: int
    at_rest: float
    """Share of runs that end standing still."""
    median_error_m: float
    """Apex minus command, all hops; of a run without one, standing height minus command."""
    worst_abs_error_m: float
    landing_force: float
    """Peak force of the ground in the last landing, weights of the leg, median over runs."""
    body_contacts: int
    """Times base or knee touched the ground."""
    runs: int


def count_hops(
    controller: Controller,
    setup: RolloutConfig,
    commands: Sequence[float],
    *,
    repeats: int,
    seed: int,
) -> list[Counted]:
    """Ask a controller for each of ``COUNTS`` at each command, all from standing."""
    rows: list[Counted] = []
    for asked in COUNTS:
        seconds = STAND_SECONDS + asked * _HOP_SECONDS + _END_SECONDS
        each = np.repeat(np.asarray(commands, float), repeats)
        supervised = StandHopLand(controller, setup.robot, asked, rate=setup.rate)
        run = rollout(supervised, setup, np.tile(each, (round(seconds * setup.rate), 1)), seed)
        traces = [run.trace(leg) for leg in range(len(each))]
        for k, command in enumerate(commands):
            own = traces[k * repeats : (k + 1) * repeats]
            rows.append(_row(command, asked, own, setup.robot))
    return rows


def _row(command: float, asked: int, traces: Sequence[Trace], robot: Robot) -> Counted:
    apexes = [trace_hops(trace).apex for trace in traces]
    made = [len(apex) for apex in apexes]
    errors = np.concatenate(
        [a if len(a) else t.column("height_m")[:1] for a, t in zip(apexes, traces, strict=True)]
    )
    errors -= command
    windows = [window for trace in traces for window in metrics.measure(trace)]
    return Counted(
        command_m=command,
        asked=asked,
        exact=float(np.mean([count == asked for count in made])),
        fewest=min(made),
        most=max(made),
        at_rest=float(np.mean([_rests(trace) for trace in traces])),
        median_error_m=float(np.median(errors)),
        worst_abs_error_m=float(np.abs(errors).max()),
        landing_force=float(np.median([_landing_force(robot, trace) for trace in traces])),
        body_contacts=sum(w.body_contacts for w in windows),
        runs=len(traces),
    )


def _landing_force(robot: Robot, trace: Trace) -> float:
    touchdown = last_touchdown(trace)
    return peak_force(robot, trace, touchdown) if touchdown else float("nan")


def _rests(trace: Trace) -> bool:
    last = trace.column("time_s") > trace.column("time_s")[-1] - _REST_SECONDS
    return bool(np.ptp(trace.column("height_m")[last]) < _STILL)
