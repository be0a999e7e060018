"""A leg that is known exactly, of the fit's own model class, and its recordings."""

from functools import cache
from typing import Literal

from hopping_leg.identify.excitation import make_excitation
from hopping_leg.identify.paper_excitation import (
    DURATION,
    Stroke,
    Strokes,
    adapt,
    fixed_base,
    moving_base,
)
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.play_excitation import play
from hopping_leg.identify.recording import Recording
from hopping_leg.robot import TIMESTEP, Robot, load_robot

BELIEVED = "legv2"
"""Where fits begin: the CAD program's values."""

AIR = {
    "hip.friction": 0.11,
    "hip.damping": 0.03,
    "hip.armature": 0.0031,
    "knee.friction": 0.08,
    "knee.damping": 0.05,
    "knee.armature": 0.011,
    "thigh.com": 0.0175,
    "shank.com": 0.052,
}
"""What differs in the leg that is only recorded in the air; hip armature and thigh inertia move
the hip alike, so only one of them can be told."""

GROUND = {name: value for name, value in AIR.items() if name != "hip.armature"} | {
    "thigh.inertia": 1.6e-3,
    "shank.inertia": 1.6e-4,
    "rail.friction": 1.2,
    "rail.damping": 1.5,
    "contact.time_constant": 0.03,
    "contact.damping_ratio": 0.8,
}
"""What differs in the leg that is recorded on the ground, too."""

Motion = Literal["swings", "other swings", "squats", "other squats", "hops", "other hops"]

_STROKES: dict[Motion, tuple[tuple[float, float, float | None], ...]] = {
    "swings": ((0.1, 0.8, 4.0), (0.05, 0.4, 8.0)),
    "other swings": ((0.08, 0.6, 6.0), (0.06, 0.5, 10.0)),
    "squats": ((0.06, 0.8, None), (0.03, 0.5, None)),
    "other squats": ((0.05, 0.9, None), (0.035, 0.6, None)),
    "hops": ((0.1, 0.5, None), (0.05, 0.3, None)),
    "other hops": ((0.08, 0.45, None), (0.06, 0.35, None)),
}
"""A, m, T1, s, and T2, s, of the halves of each motion."""


def believed() -> Robot:
    """Return the leg as the fits believe it to be at first."""
    return load_robot(BELIEVED)


def twin(truth: dict[str, float]) -> Robot:
    """Return the leg as it is."""
    return LegHypothesis(believed()).replace(truth).robot


def record(truth: dict[str, float], motion: Motion, seconds: float) -> Recording:
    """Record a motion of the twin.

    Args:
        truth: What differs from the leg that fits begin with.
        motion: Swings in the air, squats that keep contact, hops.
        seconds: How long.
    """
    fixed = motion.endswith("swings")
    parts = tuple(
        Stroke(a, t1, t2, seconds / 2, rig="fixed-base" if fixed else "rail")
        for a, t1, t2 in _STROKES[motion]
    )
    return _play(tuple(truth.items()), Strokes(parts))


def record_paper(seconds: float) -> tuple[Recording, Recording]:
    """Record the paper's two excitations, fixed base and moving base, on the twin.

    Args:
        seconds: Of each; if fewer than the paper's 240, its strokes are shorter and each swings
            once.
    """
    truth = tuple(GROUND.items())
    swings = (10.0, 20.0) if seconds >= DURATION else (min(10.0, seconds / 3),)
    fixed = fixed_base(swings=swings, duration=seconds)
    return _play(truth, fixed), _play(truth, moving_base(duration=seconds))


@cache
def _play(truth: tuple[tuple[str, float], ...], strokes: Strokes) -> Recording:
    robot = believed()
    excitation = make_excitation(adapt(strokes, robot), robot)
    return play(excitation, twin(dict(truth)), believed=BELIEVED, timestep=TIMESTEP / 16)
