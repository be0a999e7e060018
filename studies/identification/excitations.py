"""Does an optimal excitation tell in a quarter of the time what the usual ones tell?

In the air, of arms with equations of their own (``arm``) beside a multisine; in the air and on the
ground, of legs drawn with the noise of real sensors beside the paper's strokes. Each is identified
with the default plan; where a fit fails, the believed robot's numbers count as its result.
"""

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import HoppingLegError
from hopping_leg.identify.excitation import Excitation, Multisine, Template, make_excitation
from hopping_leg.identify.optimal_excitation import Design, optimal_excitation
from hopping_leg.identify.paper_excitation import adapt, fixed_base, moving_base
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.plan import make_plan
from hopping_leg.identify.play_excitation import play
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.recording_format import Rig
from hopping_leg.robot import TIMESTEP, Robot, load_robot
from hopping_leg.robot.model_mismatch import DriveMismatch, Latency, ModelMismatch, SensorMismatch
from studies.identification.arm import draw_truth, record_arm
from studies.identification.twin import BELIEVED
from studies.shared import host

LONG, SHORT = 60.0, 15.0
"""Duration of the usual excitations and of the optimal ones, of each rig, s."""
CASES = (("arm", "multisine"), ("leg", "strokes, air and ground"))
"""Kinds of legs and what they are recorded with."""
SEARCH_SEED = 6
"""Of the optimal excitations."""
_GROUND = {
    "rail.friction": (0.3, 1.2),
    "rail.damping": (0.5, 1.6),
    "contact.time_constant": (0.02, 0.06),
    "contact.damping_ratio": (0.65, 1.0),
}
_SENSORS = {
    "hip": SensorMismatch(6.4e-5, 0, 0, 1.4e-4, 0.09, 0.06),
    "knee": SensorMismatch(3.2e-5, 0, 0, 4e-5, 0.04, 0.03),
}
"""Steps and noise of leg V2's."""


def draw_leg(believed: Robot, seed: Sequence[int]) -> tuple[dict[str, float], Robot]:
    """Return the numbers of a leg by the names of parameters, and the leg with real sensors."""
    rng = np.random.default_rng(seed)
    truth = draw_truth(believed, rng) | {n: rng.uniform(*ends) for n, ends in _GROUND.items()}
    numbers = {name: value for name, value in truth.items() if not name.startswith("drive.")}
    reality = ModelMismatch(
        latency=Latency(command=truth["drive.delay"]),
        hip=DriveMismatch(sensor=_SENSORS["hip"]),
        knee=DriveMismatch(sensor=_SENSORS["knee"]),
    )
    return truth, replace(LegHypothesis(believed).replace(numbers).robot, reality=reality)


def usual() -> dict[str, list[Template]]:
    """Return today's excitations: the multisine as it is, the paper's strokes as the leg can."""
    robot = load_robot(BELIEVED)
    air = adapt(fixed_base(swings=(10.0,), duration=LONG), robot)
    ground = adapt(moving_base(duration=LONG), robot)
    return {"multisine": [Multisine(duration=LONG)], "strokes, air and ground": [air, ground]}


def optimal(threads: int, report: Callable[[float, float], None]) -> list[Template]:
    """Return what tells most in a quarter of their time, in the air and on the ground."""
    robot = load_robot(BELIEVED)
    found: list[Template] = []
    rigs: tuple[Rig, ...] = ("fixed-base", "rail")
    for rig in rigs:
        design = Design(robot, rig, SHORT, threads=threads)
        found.append(optimal_excitation(design, seed=SEARCH_SEED, report=report)[0])
    return found


def errors(
    recordings: Sequence[Recording], truth: dict[str, float], threads: int
) -> tuple[Array, bool]:
    """Return by how much parameters are off in changes that matter, (k,), and if the fit failed."""
    believed = load_robot(BELIEVED)
    parameters = make_plan(recordings, believed).parameters
    true = np.array([truth.get(n, parameters.base.get(n)) for n in parameters.names])
    found = parameters.values(np.zeros(len(true)))
    with contextlib.suppress(HoppingLegError):
        known = identify(recordings, believed, options=IdentifyOptions(threads=threads))
        return np.abs(known.identifiability.values - true) / parameters.scale, False
    return np.abs(found - true) / parameters.scale, True


def compare(
    legs: int, seed: int, threads: int, report: Callable[[str, float], None]
) -> dict[str, Any]:
    """Identify drawn legs from the usual excitations and from optimal ones of a quarter's length.

    Returns:
        ``rows``, a record per kind of leg and excitation: errors of all parameters in changes that
        matter, rms and geometric mean of the parameters' own rms; ``parameters``, these.
    """
    robot = load_robot(BELIEVED)
    best = optimal(threads, lambda share, _: report("searching", share))
    rows, each = [], []
    for kind, case in CASES:
        templates = usual()[case]
        for which, chosen in ((case, templates), ("optimal", best[: len(templates)])):
            played = [make_excitation(template, robot) for template in chosen]
            found, failed = [], 0
            for number in range(legs):
                recordings, truth = _record(kind, robot, played, [seed, number])
                error, fails = errors(recordings, truth, threads)
                found.append(error)
                failed += fails
                report(f"{kind}s, {case}, {which}", (number + 1) / legs)
            rms = np.sqrt(np.mean(np.square(found), axis=0))
            names = make_plan(recordings, robot).parameters.names
            seconds = sum(template.duration for template in chosen)
            rows.append(
                {
                    "legs": f"{legs} {kind}s",
                    "excitation": which,
                    "recorded_s": seconds,
                    "error": float(np.sqrt(np.mean(np.square(rms)))),
                    "geometric_mean": float(np.exp(np.mean(np.log(rms)))),
                    "failed": failed,
                }
            )
            each += [
                {"legs": kind, "case": case, "which": which, "parameter": n, "error": float(e)}
                for n, e in zip(names, rms, strict=True)
            ]
    return {"rows": rows, "parameters": each, "seed": seed, "host": host()}


def _record(
    kind: str, robot: Robot, played: Sequence[Excitation], seed: Sequence[int]
) -> tuple[list[Recording], dict[str, float]]:
    if kind == "arm":
        truth = draw_truth(robot, np.random.default_rng(seed))
        return [record_arm(robot, truth, e.position, seed) for e in played], truth
    truth, leg = draw_leg(robot, seed)
    step = TIMESTEP / 4
    return [play(e, leg, believed=BELIEVED, seed=sum(seed), timestep=step) for e in played], truth
