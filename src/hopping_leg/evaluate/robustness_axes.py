"""The axes of the robustness benchmark: what is changed, and how far.

Ranges were chosen so that the least levels harm no controller that hops well and the greatest bring
down at least one, where the foot's clearance and the trained heights allow it; they were not
measured on a leg.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter

from hopping_leg import errors, io
from hopping_leg.robot.parameters import JOINTS, Robot


@dataclass(frozen=True)
class Case:
    """One trial; its controller knows the robot alone, as it was before an axis changed it."""

    robot: Robot
    """What is simulated."""
    level: float = 0.0
    """Level of the axis."""
    command: float = 0.0
    """Desired apex height, m."""
    repeat: int = 0
    """Number of the realisation, from 0."""
    point: int = 0
    """Number of the hypercube's point, 0 elsewhere."""
    torque_noise: float = 0.0
    """Standard deviation of the white noise added to each joint's torque, N m."""
    push: float = 0.0
    """Impulse of each push on the base, N s."""
    ground: float = 0.0
    """Height of the ground's steps, m."""
    command_step: float = 0.0
    """Height of the command's steps, m."""


Alter = Callable[[Case, float], Case]  # Puts a level of an axis into a case


@dataclass(frozen=True)
class Axis:
    """One thing that may be other than the controller believes."""

    name: str
    meaning: str
    """What a level's number says."""
    unit: str
    neutral: float
    """Level that changes nothing."""
    levels: tuple[float, ...]
    moderate: tuple[float, float]
    """Range in which the axis ``joint`` draws it."""
    alter: Alter | None
    """None for ``JOINT``, whose levels lie on the way to points that are drawn."""
    leaderboard: str = ""
    """Name on RealAIGym's robustness leaderboard, if it is there."""


def _with(case: Case, numbers: Mapping[str, float]) -> Case:
    """Return a case whose robot has other numbers, each at a dotted path, ``"rail.friction"``."""
    robot = case.robot
    for path, value in numbers.items():
        robot = io.replace_at(robot, path, value)
    return replace(case, robot=robot)


def _payload(case: Case, share: float) -> Case:
    return _with(case, {"base.mass": case.robot.base.mass + share * case.robot.mass})


def _damped_ground(case: Case, factor: float) -> Case:
    """MuJoCo's k is 1 / (time constant x ratio)^2 and b is 2 / time constant: k stays."""
    time, ratio = case.robot.contact.time_constant, case.robot.contact.damping_ratio
    numbers = {"contact.time_constant": time / factor, "contact.damping_ratio": factor * ratio}
    return _with(case, numbers)


def _rubbing_joints(case: Case, torque: float) -> Case:
    return _with(case, {f"{j}.friction": getattr(case.robot, j).friction + torque for j in JOINTS})


_STIFFNESS, _STIFFNESS_DAMPING = 300.0, 0.03
"""Of a transmission that has play and no stiffness of its own, N m/rad and N m s/rad."""


def _backlash(case: Case, angle: float) -> Case:
    if not angle:
        return case
    numbers: dict[str, float] = {}
    for joint in JOINTS:
        drive, at = getattr(case.robot.reality, joint), f"reality.{joint}"
        numbers[f"{at}.backlash"] = angle
        if drive.stiffness is None:
            numbers[f"{at}.stiffness"] = _STIFFNESS
            numbers[f"{at}.stiffness_damping"] = _STIFFNESS_DAMPING
    return _with(case, numbers)


def _times(*paths: str) -> Alter:
    return lambda case, factor: _with(
        case, {path: factor * attrgetter(path)(case.robot) for path in paths}
    )


def _numbers(*paths: str) -> Alter:
    return lambda case, value: _with(case, dict.fromkeys(paths, value))


def _joints(path: str) -> Alter:
    """Set a number of both joints' drives."""
    return _numbers(*(f"reality.{joint}.{path}" for joint in JOINTS))


AXES = (
    Axis("payload", "mass added to the base, as a share of the whole leg's",
         "1", 0.0, (-0.4, -0.2, 0.2, 0.5, 1.0, 1.5), (-0.15, 0.2), _payload, "model error"),
    Axis("links", "masses and inertias of thigh and shank, times",
         "1", 1.0, (0.3, 0.6, 1.5, 2.5, 4.0, 6.0), (0.8, 1.25),
         _times("thigh.mass", "thigh.inertia", "shank.mass", "shank.inertia"), "model error"),
    Axis("rail-friction", "Coulomb friction and damping of the rail, times",
         "1", 1.0, (0.0, 2.0, 3.0, 5.0, 8.0, 12.0), (0.5, 2.5),
         _times("rail.friction", "rail.damping"), "model error"),
    Axis("joint-friction", "Coulomb friction added to each joint",
         "N m", 0.0, (0.2, 0.5, 1.0, 1.5, 2.0, 3.0), (0.0, 0.2), _rubbing_joints, "model error"),
    Axis("ground-stiffness",
         "time constant of the ground at the same damping ratio, times; below 1 is stiffer",
         "1", 1.0, (0.22, 0.4, 0.7, 1.5, 2.0, 3.0), (0.6, 1.5), _times("contact.time_constant")),
    Axis("ground-damping", "damping of the ground at the same stiffness, times",
         "1", 1.0, (0.1, 0.25, 0.5, 2.0, 4.0, 8.0), (0.75, 1.5), _damped_ground),
    Axis("ground-steps", "height by which the ground steps up, back, down and back, every second",
         "m", 0.0, (0.01, 0.02, 0.04, 0.06, 0.08, 0.1), (0.0, 0.02),
         lambda case, value: replace(case, ground=value)),
    Axis("delay", "latency of every torque command, on top of the paper's delay",
         "s", 0.0, (0.0025, 0.005, 0.0075, 0.01, 0.015, 0.02), (0.0, 0.005),
         _numbers("reality.latency.command"), "delay"),
    Axis("position-noise",
         "standard deviation of white noise on the joint positions, on top of the paper's noise",
         "rad", 0.0, (0.01, 0.03, 0.1, 0.2, 0.3, 0.5), (0.0, 0.01),
         _joints("sensor.position_noise")),
    Axis("velocity-noise",
         "standard deviation of white noise on the joint velocities, on top of the paper's noise",
         "rad/s", 0.0, (0.1, 0.3, 0.5, 1.0, 2.0, 4.0), (0.0, 0.5),
         _joints("sensor.velocity_noise"), "velocity noise"),
    Axis("torque-noise",
         "standard deviation of white noise on the joint torques, on top of the paper's noise",
         "N m", 0.0, (0.1, 0.3, 0.6, 1.0, 1.5, 2.5), (0.0, 0.5),
         lambda case, value: replace(case, torque_noise=value), "torque noise"),
    Axis("torque-gain", "torque that the motors give over the torque asked for",
         "1", 1.0, (0.3, 0.45, 0.6, 0.8, 1.25, 1.5), (0.9, 1.1), _joints("torque_gain")),
    Axis("torque-lag", "time constant with which the motors' torque follows",
         "s", 0.0, (0.001, 0.0025, 0.005, 0.0075, 0.01, 0.02), (0.0, 0.0025),
         _joints("torque_lag"), "torque response"),
    Axis("voltage", "battery over its nominal voltage, which moves the motors' torque-speed line",
         "1", 1.0, (0.9, 0.8, 0.7, 0.6, 0.5, 0.4), (0.8, 1.0), _numbers("reality.voltage")),
    Axis("backlash", "dead band between motor and link of both joints",
         "rad", 0.0, (0.005, 0.01, 0.02, 0.05, 0.1, 0.2), (0.0, 0.02), _backlash),
    Axis("pushes", "impulse on the base, up or down, at a random moment of every second",
         "N s", 0.0, (0.2, 0.5, 1.0, 1.5, 2.0, 3.0), (0.0, 0.2),
         lambda case, value: replace(case, push=value), "perturbation"),
    Axis("command-steps", "height of the steps by which the command rises and falls, every 2.5 s",
         "m", 0.0, (0.02, 0.04, 0.06, 0.08, 0.1), (0.0, 0.05),
         lambda case, value: replace(case, command_step=value)),
)  # fmt: skip
"""Every axis that is changed on its own."""

NOMINAL = Axis("nominal", "nothing is changed", "1", 0.0, (0.0,), (0.0, 0.0), lambda case, _: case)
"""Stated beside the axes, part of no score."""

JOINT = Axis("joint", "all axes at once, this share of the way to points of their moderate ranges",
             "1", 0.0, (0.25, 0.5, 0.75, 1.0), (0.0, 1.0), None)  # fmt: skip


def axes_named(names: Sequence[str]) -> tuple[Axis, ...]:
    """Return axes of these names, or all, in their own order; UsageError where there is none."""
    every = {axis.name: axis for axis in (*AXES, JOINT)}
    for name in names:
        if name not in every:
            raise errors.UsageError(errors.unknown_name("axis", name, every))
    return tuple(axis for name, axis in every.items() if name in names or not names)
