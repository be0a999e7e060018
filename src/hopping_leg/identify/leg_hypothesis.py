"""What a fit may change: the robot, and the drives that the recording's rig put around it."""

import dataclasses
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any

from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.io import replace_at
from hopping_leg.robot.parameters import Robot

_DRIVE = "drive"


@dataclass(frozen=True)
class ActuatorParameters:
    """One joint's drive at the joint's side; NaN takes what the recording says."""

    stiffness: float = field(default=float("nan"), metadata={"unit": "N m/rad"})
    damping: float = field(default=float("nan"), metadata={"unit": "N m s/rad"})
    integral: float = field(default=float("nan"), metadata={"unit": "N m/(rad s)"})
    torque_limit: float = field(default=float("nan"), metadata={"unit": "N m"})
    torque_offset: float = field(default=0.0, metadata={"unit": "N m"})
    """Measured torque without any true torque."""
    sensor_gain: float = field(default=1.0, metadata={"unit": "1"})
    """Measured torque per true torque."""


@dataclass(frozen=True)
class Actuators:
    """Both drives and what they share."""

    hip: ActuatorParameters = field(default_factory=ActuatorParameters)
    knee: ActuatorParameters = field(default_factory=ActuatorParameters)
    delay: float = field(default=0.0, metadata={"unit": "s"})
    """From a command's time stamp to its effect."""
    velocity_window: float = field(default=0.0, metadata={"unit": "s"})
    """Over which a drive that closes its own loop averages the velocity that it damps; its delay
    makes stiff loops ring."""
    ramp: float = field(default=0.0, metadata={"unit": "1"})
    """Share of the commanded velocity by which a drive moves its position target on until the
    next command: 0 holds the target, 1 ramps it as mjbots' moteus does."""


@dataclass(frozen=True)
class LegHypothesis:
    """A robot and its drives: all that a simulation of a recording needs.

    Parameters are named by their path: ``"hip.friction"`` as in the robot file,
    ``"drive.hip.stiffness"`` for what is not the robot's.
    """

    robot: Robot
    drive: Actuators = field(default_factory=Actuators)

    def get(self, name: str) -> float:
        """Return a parameter's value.

        Raises:
            UsageError: There is no such parameter.
        """
        _check(self, name)
        return float(attrgetter(_path(name))(self))

    def replace(self, values: dict[str, float]) -> "LegHypothesis":
        """Return the hypothesis with some parameters' values changed.

        Raises:
            UsageError: There is no such parameter.
        """
        hypothesis = self
        for name, value in values.items():
            _check(self, name)
            hypothesis = replace_at(hypothesis, _path(name), float(value))
        return hypothesis


def parameter_units(hypothesis: LegHypothesis) -> dict[str, str]:
    """Return every parameter's name and unit."""
    names = {f"{_DRIVE}.{name}": unit for name, unit in _leaves(hypothesis.drive)}
    return dict(_leaves(hypothesis.robot)) | names


def _path(name: str) -> str:
    return name if name.startswith(f"{_DRIVE}.") else f"robot.{name}"


def _leaves(owner: Any, prefix: str = "") -> list[tuple[str, str]]:  # noqa: ANN401
    found: list[tuple[str, str]] = []
    for spec in dataclasses.fields(owner):
        value = getattr(owner, spec.name)
        if dataclasses.is_dataclass(value):
            found += _leaves(value, f"{prefix}{spec.name}.")
        elif "unit" in spec.metadata:
            found.append((prefix + spec.name, spec.metadata["unit"]))
    return found


def _check(hypothesis: LegHypothesis, name: str) -> None:
    units = parameter_units(hypothesis)
    if name not in units:
        raise UsageError(unknown_name("parameter", name, units))
