"""Do intervals hold the truth? Asked of an arm with equations, integrator and friction of its own.

It shares no code with the package, so that what a fit says of it is judged from outside. Dry
friction is ``tanh`` of the speed, which creeps where Coulomb's holds; Runge-Kutta's method takes
steps of 50 microseconds, and the torques of a 200 Hz PD arrive late by any delay and end where the
motors' torque-speed lines do.
"""

import math
import time
from collections.abc import Sequence

import numba
import numpy as np
import polars as pl
from rich.progress import track

from hopping_leg.arrays import Array
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.recording import Recording, make_recording
from hopping_leg.identify.recording_format import RecordingMetadata
from hopping_leg.robot import MotorLimit, Robot
from studies.identification.study import Study
from studies.identification.twin import believed
from studies.shared import Row, host

RATE = 200.0
STIFFNESS, DAMPING = (20.0, 12.0), (0.3, 0.15)
_SUBSTEPS = 100
_CREEP = 0.01
"""Speed at which friction is mostly there, rad/s."""
_DRAWS = 2000
_TONES = np.array([0.2, 0.35, 0.55, 0.8, 1.1, 1.5, 2.0, 2.7])


_POSITION_NOISE, _TORQUE_NOISE = 3e-4, 0.02
"""Standard deviations of what is recorded, rad and N m."""


def draw_truth(robot: Robot, rng: np.random.Generator) -> dict[str, float]:
    """Return the numbers of an arm, by the names of parameters."""
    return {
        "hip.friction": rng.uniform(0.04, 0.15),
        "hip.damping": rng.uniform(0.01, 0.06),
        "knee.friction": rng.uniform(0.03, 0.10),
        "knee.damping": rng.uniform(0.02, 0.09),
        "knee.armature": robot.knee.armature * rng.uniform(0.8, 1.4),
        "thigh.com": robot.thigh.com * rng.uniform(0.8, 1.5),
        "shank.com": robot.shank.com * rng.uniform(0.8, 1.4),
        "thigh.inertia": robot.thigh.inertia * rng.uniform(0.8, 1.5),
        "shank.inertia": robot.shank.inertia * rng.uniform(0.8, 1.5),
        "drive.delay": rng.uniform(0.0, 0.0045),
    }


def record_arm(
    robot: Robot, truth: dict[str, float], seconds: float, seed: int | Sequence[int]
) -> Recording:
    """Record an arm that tracks multisines under a PD.

    Args:
        robot: Has what ``truth`` leaves out.
        truth: See ``draw_truth``.
        seconds: How long.
        seed: Of the multisines' phases and of the sensors' noise.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    target, rows = _multisine(time, rng), len(time)
    p = np.array(
        [
            robot.thigh.length, robot.thigh.mass, truth["thigh.com"], truth["thigh.inertia"],
            robot.shank.mass, truth["shank.com"], truth["shank.inertia"],
            robot.hip.armature, truth["knee.armature"],
            truth["hip.friction"], truth["knee.friction"],
            truth["hip.damping"], truth["knee.damping"], truth["drive.delay"],
        ]
    )  # fmt: skip
    limit = MotorLimit(robot)
    line = np.stack([limit.limit, limit.peak, limit.peak / robot.of_joints("no_load_speed")])
    seen = _track(p, line, target, np.array(STIFFNESS), np.array(DAMPING))
    position = seen[:, :2] + rng.normal(scale=_POSITION_NOISE, size=(rows, 2))
    torque = seen[:, 4:] + rng.normal(scale=_TORQUE_NOISE, size=(rows, 2))
    columns = {"time_s": time}
    for suffix, values in (
        ("position_rad", position), ("torque_nm", torque), ("position_command_rad", target),
    ):  # fmt: skip
        columns |= {f"hip_{suffix}": values[:, 0], f"knee_{suffix}": values[:, 1]}
    metadata = RecordingMetadata(
        "fixed-base", RATE, robot.name, "an independent arm", onboard="zoh",
        stiffness=STIFFNESS, damping=DAMPING,
    )  # fmt: skip
    return make_recording(pl.DataFrame(columns), metadata, f"arm {seed}")


def _multisine(time: Array, rng: np.random.Generator) -> Array:
    phases = rng.uniform(0, 2 * np.pi, (2, len(_TONES)))
    weight = _TONES**-0.5 / math.sqrt(np.sum(1 / _TONES))
    angle = 2 * np.pi * _TONES * time[:, None]
    waves = np.stack([np.sin(angle + phase) @ weight for phase in phases], axis=1)
    ramp = np.minimum(time, 1.0)[:, None]
    return np.asarray(np.array([0.5, -1.2]) + np.array([0.35, 0.5]) * waves * ramp)


@numba.njit
def _accelerations(p, s, u):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    """Return the state's rate under torques."""
    length, m1, c1, i1, m2, c2, i2, a1, a2, f1, f2, d1, d2, _ = p
    q1, q2, w1, w2 = s
    h = m2 * length * c2
    m11 = i1 + m1 * c1**2 + i2 + m2 * (length**2 + c2**2) + 2 * h * math.cos(q2) + a1
    m12 = i2 + m2 * c2**2 + h * math.cos(q2)
    m22 = i2 + m2 * c2**2 + a2
    sine = h * math.sin(q2)
    weight2 = 9.81 * m2 * c2 * math.sin(q1 + q2)
    weight1 = 9.81 * (m1 * c1 + m2 * length) * math.sin(q1) + weight2
    r1 = u[0] + sine * (2 * w1 + w2) * w2 - weight1 - f1 * math.tanh(w1 / _CREEP) - d1 * w1
    r2 = u[1] - sine * w1 * w1 - weight2 - f2 * math.tanh(w2 / _CREEP) - d2 * w2
    det = m11 * m22 - m12 * m12
    return np.array([w1, w2, (m22 * r1 - m12 * r2) / det, (m11 * r2 - m12 * r1) / det])


@numba.njit
def _track(p, line, target, kp, kd):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    """Return state and torque before each row's command, (rows, 6), after a second at rest."""
    step = 1 / RATE / _SUBSTEPS
    late = p[-1] / step
    seen = np.zeros((len(target), 6))
    s = np.zeros(4)
    s[:2] = target[0]
    old, given = np.zeros(2), np.zeros(2)
    settling = int(RATE)
    for n in range(settling + len(target)):
        row = max(n - settling, 0)
        if n >= settling:
            seen[row, :4], seen[row, 4:] = s, given
        new = kp * (target[row] - s[:2]) - kd * s[2:]
        for k in range(_SUBSTEPS):
            share = min(max(late - k, 0.0), 1.0)
            for j in range(2):
                drop = line[2, j] * s[2 + j]
                most = min(max(line[1, j] - drop, 0.0), line[0, j])
                least = max(min(-line[1, j] - drop, 0.0), -line[0, j])
                given[j] = min(max(share * old[j] + (1 - share) * new[j], least), most)
            k1 = _accelerations(p, s, given)
            k2 = _accelerations(p, s + step / 2 * k1, given)
            k3 = _accelerations(p, s + step / 2 * k2, given)
            k4 = _accelerations(p, s + step * k3, given)
            s = s + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        old = new
    return seen


def _distances(draws: Array, true: Array) -> Array:
    """Return how far out draws, (n, k), and last the truth, (k,), are by the draws' covariance."""
    deviation = draws.std(axis=0)
    off = (np.vstack([draws, true]) - draws.mean(axis=0)) / deviation
    inverse = np.linalg.pinv(np.cov(off[:-1], rowvar=False), hermitian=True)
    return np.asarray(np.einsum("ni,ij,nj->n", off, inverse, off))


def coverage(study: Study, seconds: float) -> Row:
    """Identify arms that differ, each from a recording of its own, with the default plan.

    Args:
        study: Number of arms, seed of the first and threads of each fit.
        seconds: Of each recording.

    Returns:
        Shares of 95 % intervals that hold the truth, in all and by parameter, likewise of those of
        draws from the posterior, of truths that are, all numbers together, no farther out than
        95 % of the draws, and what fits take.
    """
    robot = believed()
    names: list[str] = []
    errors, taken, drawn_inside, beside = [], [], [], []
    options = IdentifyOptions(threads=study.threads)
    for arm in track(range(study.arms), "arms", transient=True):
        truth = draw_truth(robot, np.random.default_rng([study.seed, arm]))
        recording = record_arm(robot, truth, seconds, study.seed + arm)
        begin = time.perf_counter()
        known = identify([recording], robot, options=options)
        taken.append(time.perf_counter() - begin)
        found = known.identifiability
        draws = known.posterior(_DRAWS, study.seed + arm)
        names = found.names
        true = np.array([truth.get(name, 1.0) for name in names])  # gains of the motors
        low, high = np.quantile(draws, (0.025, 0.975), axis=0)
        drawn_inside += ((low <= true) & (true <= high)).tolist()
        far = _distances(draws, true)
        beside.append(bool(far[-1] <= np.quantile(far[:-1], 0.95)))
        errors.append((found.values - true) / found.half_width)
    inside = np.abs(errors) <= 1
    return {
        "rows": [
            {
                "parameter": name,
                "share_inside": float(np.mean(hits)),
                "rms_error_over_half_width": float(np.sqrt(np.mean(np.square(missed)))),
            }
            for name, hits, missed in zip(names, inside.T, np.transpose(errors), strict=True)
        ],
        "share_inside": float(np.mean(inside)),
        "share_inside_draws": float(np.mean(drawn_inside)),
        "share_among_draws": float(np.mean(beside)),
        "intervals": inside.size,
        "arms": study.arms,
        "recorded_s": seconds,
        "fit_median_s": float(np.median(taken)),
        "fit_longest_s": max(taken),
        "threads": study.threads,
        "host": host(),
    }
