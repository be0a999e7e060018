"""From recordings to identified parameters, judged on data that the fit has not seen."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hopping_leg.errors import PhysicsError, RecordingError, RobotError, UsageError, unknown_name
from hopping_leg.identify import optimizers, validation
from hopping_leg.identify.cost import Objective, Scoring
from hopping_leg.identify.identifiability import Identifiability, identifiability
from hopping_leg.identify.optimizers import Pass, Report, Searcher, SearchOptions
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.plan import FitPlan, check_recordings, make_plan
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.result import Identified
from hopping_leg.identify.torque_balance import check_balance
from hopping_leg.identify.windows import SHORTEST, cut, duration, hold_out
from hopping_leg.robot import NO_MISMATCH, Robot, check_physics

_CREEP = 0.02  # rad/s; intervals hold what friction that fades below it makes of the values


@dataclass(frozen=True)
class IdentifyOptions:
    """What to identify and how."""

    parameters: tuple[str, ...] | None = None
    """What to fit; None decides by what the recordings can tell."""
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Bounds that differ from the widest ones."""
    search: str | None = None
    """``least-squares``, ``cma`` or ``two-pass``; None lets the plan decide."""
    scoring: Scoring | None = None
    """What errors count; None lets the plan decide."""
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
    ``validate``; the robot's table [reality] is left out.

    Raises:
        UsageError: An option has no meaning.
        RecordingError: A recording is another leg's, too short, or lacks what is needed.
        PhysicsError: The fit failed.
    """
    options = options or IdentifyOptions()
    if seed < 0 or options.threads < 0:
        raise UsageError("The seed and the number of threads must not be negative.")
    robot = replace(robot, reality=NO_MISMATCH)
    check_recordings([*recordings, *validate], robot)
    bounds = {**_file_bounds(robot), **options.bounds}
    plan = make_plan(
        recordings,
        robot,
        parameters=options.parameters,
        bounds=bounds,
        search=options.search,
        scoring=options.scoring,
    )
    for name in options.bounds:
        if name not in plan.parameters.names:
            raise UsageError(
                f"There are bounds for '{name}', which is not fitted."
                f" {unknown_name('fitted parameter', name, plan.parameters.names)}"
            )
    fit, held, split = _split(recordings, validate, plan, seed)
    for recording in (*recordings, *validate):
        check_balance(recording, robot)
    windows = cut(fit, plan.window, unscored=plan.unscored)
    objective = Objective(
        tuple(fit), tuple(windows), plan.parameters, plan.scoring, plan.timestep, options.threads
    )
    searcher = Searcher(plan, objective, options.effort, seed, report, options.ray)
    passes = searcher.run()
    report("finding intervals", 1.0, passes[-1].found.cost)
    hypothesis, known = _conclude(objective, passes[-1], options)
    report("judging", 1.0, passes[-1].found.cost)
    effort = (plan.timestep, options.threads)
    before, after = (validation.validate(held, h, *effort) for h in (plan.start, hypothesis))
    rigs = dict.fromkeys(r.metadata.rig for r in held)
    groups = {rig: [r for r in held if r.metadata.rig == rig] for rig in rigs if len(rigs) > 1}
    by_rig = {k: validation.validate(group, hypothesis, *effort) for k, group in groups.items()}
    parts = (tuple(passes), known, tuple(fit), tuple(held), split, after, before, by_rig, seed)
    return Identified(hypothesis, plan.start, plan, *parts)


def _file_bounds(robot: Robot) -> dict[str, tuple[float, float]]:
    """Return bounds that robot files demand: centres of mass on links, peaks above limits."""
    bounds = {}
    for name, link in (("thigh", robot.thigh), ("shank", robot.shank)):
        whole = (1 - 1e-9) * link.reach
        if link.com < whole:
            bounds[f"{name}.com"] = (0.25 * link.com, min(4 * link.com, whole))
    for name, motor in (("hip", robot.hip.motor), ("knee", robot.knee.motor)):
        least = max(motor.torque_limit, motor.rated_torque)
        bounds[f"{name}.motor.peak_torque"] = (least, 4 * motor.peak_torque)
    return bounds


def _split(
    recordings: Sequence[Recording], validation: Sequence[Recording], plan: FitPlan, seed: int
) -> tuple[list[Recording], list[Recording], str]:
    if not validation:
        rng = np.random.default_rng(seed)
        return *hold_out(recordings, plan.window, rng), "held-out stretches"
    for recording in validation:
        if recording.digest and any(recording.digest == r.digest for r in recordings):
            raise UsageError(
                f"{recording.name} is to be fitted and to judge the fit; use each for one of the"
                " two, or leave --validate out to hold a quarter of all out."
            )
        if duration(recording) < SHORTEST:
            raise RecordingError(
                f"{recording.name} is too short to judge by: {duration(recording):.3g} s; record"
                f" at least {SHORTEST:g} s."
            )
    return list(recordings), list(validation), "validation recordings"


def _conclude(
    objective: Objective, last: Pass, options: IdentifyOptions
) -> tuple[LegHypothesis, Identifiability]:
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
    step, bounds = options.effort.least_squares.step, last.parameters.bounds
    residuals = objective.residuals(vector[None])[0]
    slopes = optimizers.jacobian(objective.residuals, vector, bounds, step, objective.jumping)
    creeping = replace(last.parameters, base=last.parameters.base.replace({"drive.creep": _CREEP}))
    change = replace(objective, parameters=creeping).residuals(vector[None])[0] - residuals
    if objective.loss is not None:
        weights = objective.loss.weights(residuals)
        residuals, slopes = weights * residuals, weights[:, None] * slopes
        change = weights * change
    return hypothesis, identifiability(last.parameters, vector, residuals, slopes, change)
