"""From recordings to identified parameters, judged on data that the fit has not seen."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import polars as pl

from hopping_leg.errors import PhysicsError, RecordingError, RobotError, UsageError
from hopping_leg.identify import hops, validation
from hopping_leg.identify.cost import Objective
from hopping_leg.identify.identifiability import Identifiability, identifiability
from hopping_leg.identify.optimizers import Pass, Report, SearchOptions, jacobian, search
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.plan import FitPlan, check_recordings, make_plan
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.recording_format import PAIRS, Pair
from hopping_leg.identify.result import Identified
from hopping_leg.identify.simulate import cut
from hopping_leg.robot import Robot, check_physics

_SHARE = 4  # one stretch in so many is held out
_STRETCH = 5.0  # usual length of a stretch, s
_SHORTEST = 1.0  # a stretch below this, s, judges nothing
_CREEP = 0.02  # rad/s; intervals hold what friction that fades below it makes of the values


@dataclass(frozen=True)
class IdentifyOptions:
    """What to identify and how."""

    parameters: tuple[str, ...] | None = None
    """What to fit; None decides by what the recordings can tell, to which ``+NAME`` adds."""
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Bounds that differ from the widest ones."""
    search: str | None = None
    """``least-squares``, ``cma`` or ``two-pass``; None lets the plan decide."""
    effort: SearchOptions = field(default_factory=SearchOptions)
    threads: int = 0
    """Worker threads, 0 for one per core; they change no bit of the result."""
    ray: str | None = None
    """Address of a Ray cluster to simulate on; it changes no bit of the result either."""


def identify(
    recordings: Sequence[Recording],
    robot: Robot,
    *,
    validate: Sequence[Recording] = (),
    options: IdentifyOptions | None = None,
    seed: int = 0,
    report: Report = lambda stage, share, cost: None,
) -> Identified:
    """Identify a robot.

    A quarter of the recordings is held out, in stretches, unless others are given to
    ``validate``. The robot's table [reality] is left out, but for the transmission of a joint of
    which a number is fitted.

    Raises:
        UsageError: An option has no meaning.
        RecordingError: A recording is another leg's, too short, or lacks what is needed.
        PhysicsError: The fit failed.
    """
    options = options or IdentifyOptions()
    if seed < 0 or options.threads < 0:
        raise UsageError("The seed and the number of threads must not be negative.")
    recordings = [hops.with_height(recording, robot) for recording in recordings]
    validate = [hops.with_height(recording, robot) for recording in validate]
    check_recordings([*recordings, *validate], robot)
    names, bounds, how = options.parameters, options.bounds, options.search
    plan = make_plan(recordings, robot, parameters=names, bounds=bounds, search=how)
    fit, held, split = _split(recordings, validate, plan, seed)
    for recording in (*recordings, *validate):
        _check_conventions(recording, plan.start)
    windows = cut(fit, plan.window, unscored=plan.unscored)
    if not windows:
        raise RecordingError("No flight was found; record hops that begin at rest, with torques.")
    scoring, threads = plan.scoring, options.threads
    objective = Objective(tuple(fit), tuple(windows), plan.parameters, scoring, threads)
    passes = search(plan, objective, options.effort, seed=seed, report=report, ray=options.ray)
    report("finding intervals", 1.0, passes[-1].found.cost)
    hypothesis, known = _conclude(objective, passes[-1])
    report("judging", 1.0, passes[-1].found.cost)
    before, after = (validation.validate(held, h, threads) for h in (plan.start, hypothesis))
    rigs = dict.fromkeys(r.metadata.rig for r in held)
    groups = {rig: [r for r in held if r.metadata.rig == rig] for rig in rigs if len(rigs) > 1}
    by_rig = {k: validation.validate(group, hypothesis, threads) for k, group in groups.items()}
    parts = (tuple(passes), known, tuple(fit), tuple(held), split, after, before, by_rig, seed)
    return Identified(hypothesis, plan.start, plan, *parts)


_RIGHT = ((1, 1), (1, 1), (0, 0))
_MISTAKES: dict[str, list[tuple[Pair, ...]]] = {
    "the sign of hip or knee, with its angle, velocity, torque and commands": [
        ((1, -1), (1, -1), (0, 0))
    ],
    "the sign of the hip's torque": [((1, 1), (-1, 1), (0, 0))],
    "the sign of the knee's torque": [((1, 1), (1, -1), (0, 0))],
    "the line that the knee's angle counts from (the vertical?)": [(*_RIGHT, (0, 1))],
    "the zero of hip or knee, by quarter turns,": [
        ((1, 1), (1, 1), turns) for n in (-1, 1, 2) for turns in ((n, 0), (0, n))
    ],
}
"""Factors of angles and torques, quarter turns, shares of the hip's angle that undo a mistake."""
_TURN = 2 * np.pi
_SOON = 0.2  # s, over which the robot to start from predicts well enough to tell
_BETTER, _TOLD = 1.8, 0.5
"""Times that others must explain more, and what they may leave unexplained of both joints."""


def _check_conventions(recording: Recording, start: LegHypothesis) -> None:
    """Refuse a clamped leg's recording whose motion follows far better with other conventions."""
    driven = validation.as_torque_driven(recording)
    if recording.metadata.rig != "fixed-base" or not driven.has("torque_command"):
        return
    given = _unexplained(driven, start, *_RIGHT)
    left = {m: min(_unexplained(driven, start, *c) for c in cs) for m, cs in _MISTAKES.items()}
    turns, idle = (_unexplained(driven, start, (_TURN, _TURN), (k, k), (0, 0)) for k in (1, 0))
    if idle > _BETTER * turns:  # else fast motion goes on by itself, whatever the torques
        left["the unit of angles, velocities and gains (revolutions for radians?)"] = turns
    likely = min(left, key=lambda mistake: left[mistake])
    if left[likely] < _TOLD and given > _BETTER * left[likely]:
        raise RecordingError(
            f"{recording.name}: the motion would follow from the torques"
            f" {given / left[likely]:.3g} times better if {likely} were another; a leg that hangs"
            " straight is at zero, and a positive torque accelerates towards positive angles."
        )


def _unexplained(driven: Recording, start: LegHypothesis, *convention: Pair) -> float:
    """Return the share of the motion that its torques do not predict, infinite if unknown."""
    (angles, torques, turns, *held), changes = convention, []
    for joint in range(2):
        for name in ("position", "velocity", "position_estimate", "velocity_estimate"):
            shift = turns[joint] * np.pi / 2 if name.startswith("position") else 0.0
            hips = pl.col(PAIRS[name][0]) if joint and held else 0.0
            changes.append(pl.col(PAIRS[name][joint]) * angles[joint] + shift - hips)
        changes.append(pl.col(PAIRS["torque_command"][joint]) * torques[joint])
    spread = np.nanstd(driven.array("position") * np.abs(angles), axis=0)
    table = driven.trace.table
    table = table.with_columns(c for c in changes if {*table.columns} >= {*c.meta.root_names()})
    errors = np.array(validation.open_loop([driven.with_table(table)], start, _SOON))
    return float(np.nan_to_num(np.sum((errors / np.maximum(spread, 1e-6)) ** 2), nan=np.inf))


def _split(
    recordings: Sequence[Recording], judges: Sequence[Recording], plan: FitPlan, seed: int
) -> tuple[list[Recording], list[Recording], str]:
    """Return what is fitted, what judges the fit, and how they were parted."""
    if not judges:
        rng = np.random.default_rng(seed)
        return *hold_out(recordings, plan.window, rng), "held-out stretches"
    for judge in judges:
        if judge.digest and any(judge.digest == r.digest for r in recordings):
            raise UsageError(
                f"{judge.name} is to be fitted and to judge the fit; use each for one of the two."
            )
        if judge.duration < _SHORTEST:
            raise RecordingError(f"{judge.name} is too short to judge by: {judge.duration:.3g} s.")
    return list(recordings), list(judges), "validation recordings"


def hold_out(
    recordings: Sequence[Recording], window: float, rng: np.random.Generator
) -> tuple[list[Recording], list[Recording]]:
    """Split recordings into what is fitted and what judges the fit.

    Every fourth of equal stretches is held out, counted from a random one; a short recording gives
    its last quarter. No stretch to fit is shorter than a window, s.
    """
    fit: list[Recording] = []
    held: list[Recording] = []
    for recording in recordings:
        whole, spare = recording.duration, 2 * recording.metadata.period
        least = max(_SHARE * _SHORTEST, window * _SHARE / (_SHARE - 1) + spare)
        if whole < least:
            raise RecordingError(
                f"{recording.name} is too short: {whole:.3g} s, but {least:.3g} s are needed to"
                " fit to one part and to judge by another; or judge by others, with --validate."
            )
        count = max(_SHARE, int(whole / max(_STRETCH, 1.25 * window)))
        begin = int(rng.integers(_SHARE)) if count >= 2 * _SHARE else _SHARE - 1
        edges = np.linspace(0, len(recording), count + 1).round().astype(int)
        chosen = [i for i in range(count) if i % _SHARE == begin]
        held += [recording.part(edges[i], edges[i + 1]) for i in chosen]
        for first, last in zip([-1, *chosen], [*chosen, count], strict=True):
            if edges[last] - edges[first + 1] >= round(window * recording.metadata.rate_hz) + 2:
                fit.append(recording.part(edges[first + 1], edges[last]))
    return fit, held


def _conclude(objective: Objective, last: Pass) -> tuple[LegHypothesis, Identifiability]:
    """Return the best hypothesis and what is known of it, unless it breaks down in simulation."""
    objective = replace(objective, parameters=last.parameters)
    vector = last.found.vector
    (hypothesis,) = last.parameters.hypotheses(vector[None])
    simulated = objective.simulator.run([hypothesis]).position[0]
    lengths = [w.length for w in objective.windows]
    broken = sum(not np.isfinite(p[:n]).all() for p, n in zip(simulated, lengths, strict=True))
    try:
        check_physics(hypothesis.robot, "its result")
    except RobotError as error:
        raise PhysicsError(
            f"The fit failed: {str(error).removeprefix('its result: ')} Bound that parameter with"
            " --bounds, or leave it out."
        ) from error
    if broken or not np.isfinite(last.found.cost):
        raise PhysicsError(
            f"The fit failed: its best candidate breaks down in {broken} of {len(lengths)} windows;"
            " narrow the bounds, fit fewer parameters, or check the recording's gains and units."
        )
    residuals = objective.residuals(vector[None])[0]
    slopes = jacobian(objective.residuals, vector, last.parameters.bounds, objective.jumping)
    creeping = replace(last.parameters, base=last.parameters.base.replace({"drive.creep": _CREEP}))
    change = replace(objective, parameters=creeping).residuals(vector[None])[0] - residuals
    weights = objective.loss.weights(residuals)
    weighed = (weights * residuals, weights[:, None] * slopes, weights * change)
    return hypothesis, identifiability(last.parameters, vector, *weighed)
