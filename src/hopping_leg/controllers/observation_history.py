"""What a policy file asks for at every tick: named arrays made from the joint measurements.

A policy's metadata names its layout; the arrays are raw, in SI units. Normalisation is part of the
policy's graph, so that a policy file needs nothing but encoders and a command.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from hopping_leg.arrays import Array, Array32, IntArray, Stateful
from hopping_leg.controllers import robot_numbers
from hopping_leg.controllers.sample_history import SampleHistory
from hopping_leg.errors import PolicyError, UsageError, unknown_name
from hopping_leg.robot import Robot
from hopping_leg.sim.channel import DELAY_DEPTH, SAMPLES, Measurement

FULL_TORQUE = "full_torque"
"""Graph input with which the network's actions are multiplied, N m, (n, 2)."""

Inputs = dict[str, Array32]  # Graph input to its array, (n, ...)


class ObservationHistory(Stateful, ABC):
    """Turns measurements into a policy's inputs; may remember past ticks of a period, s.

    One of your own needs a class and an entry in ``OBSERVATION_HISTORIES``.
    """

    name: ClassVar[str]
    """As stored in policy files."""
    shapes: ClassVar[dict[str, tuple[int, ...]]]
    """Graph inputs, in the order in which the network sees them, without the leading n."""
    units: ClassVar[dict[str, str]] = {
        "q": "rad", "qd": "rad/s", "age": "s", "past_torque": "N m", "command": "m",
        FULL_TORQUE: "N m",
    }  # fmt: skip
    """Of graph inputs; those not named have none."""
    limit: ClassVar[str] = "It is not told how old its samples are."
    """What is known to be asked of who runs such a policy, or to be missing."""

    def __init__(self, period: float) -> None:
        self.period = period

    @property
    def network_inputs(self) -> tuple[str, ...]:
        """Graph inputs that the network sees; the full torque scales what it gives."""
        return tuple(name for name in self.shapes if name != FULL_TORQUE)

    @classmethod
    def describe(cls) -> dict[str, Any]:
        """Return shape and unit of every graph input, as JSON values."""
        return {
            name: {"shape": ["n", *shape], "unit": cls.units.get(name, "1")}
            for name, shape in cls.shapes.items()
        }

    def set_robots(self, robots: Sequence[Robot]) -> None:
        """Say what is believed of the legs: a robot each, or one of all."""

    def reset(self, count: int) -> None:
        """Forget the past of all legs; the next measurement has ``count`` rows."""

    @abstractmethod
    def restart(self, rows: IntArray | slice, measurement: Measurement) -> None:
        """Forget the past of some legs within a tick: they begin with this measurement."""

    @abstractmethod
    def update(self, measurement: Measurement, last_torque: Array) -> None:
        """Update with a tick; the policy's last torque is in N m, (n, 2), zero after a reset."""

    @abstractmethod
    def inputs(self) -> Inputs:
        """Return the graph's inputs at this tick."""


class ThreeSamples(ObservationHistory):
    """The paper's observation: position, velocity and command at three ticks, newest first.

    q and qd are (n, 3, 2) in rad and rad/s, command is (n, 3) in m.
    """

    name: ClassVar[str] = "three-samples"
    shapes: ClassVar[dict[str, tuple[int, ...]]] = {
        "q": (SAMPLES, 2),
        "qd": (SAMPLES, 2),
        "command": (SAMPLES,),
    }

    def restart(self, rows: IntArray | slice, measurement: Measurement) -> None:
        """Take this tick's measurement."""
        self._measurement = measurement

    def update(self, measurement: Measurement, last_torque: Array) -> None:
        """Take this tick's measurement."""
        self._measurement = measurement

    def inputs(self) -> Inputs:
        """Return the samples as they are."""
        return {name: getattr(self._measurement, name).astype(np.float32) for name in self.shapes}


def _dated_shapes(
    lags: tuple[int, ...], torque_lags: tuple[int, ...]
) -> dict[str, tuple[int, ...]]:
    return {
        "q": (len(lags), 2),
        "qd": (len(lags), 2),
        "age": (1,),
        "past_torque": (len(torque_lags), 2),
        "command": (1,),
    }


class Dated(ObservationHistory):
    """Samples at fixed times before now, however late they came, and the policy's own torques.

    A late sample is put where it belongs; a tick whose sample has not arrived shows the one before.
    q and qd are (n, lags, 2) in rad and rad/s, age is that of the newest sample, (n, 1) in s,
    past_torque is what the policy asked for at past ticks, (n, lags, 2) in N m, command is (n, 1)
    in m.
    """

    name: ClassVar[str] = "dated"
    LAGS: ClassVar[tuple[int, ...]] = (0, 1, 2, 3, 5, 7, 10)
    """Ticks before now of the samples."""
    TORQUE_LAGS: ClassVar[tuple[int, ...]] = (0, 1, 2, 4, 6)
    """Ticks before the last action of the torques."""
    shapes: ClassVar[dict[str, tuple[int, ...]]] = _dated_shapes(LAGS, TORQUE_LAGS)
    limit: ClassVar[str] = "It needs the age of every sample, which the paper's 15 inputs lack."
    STATE = ("_track", "_torques", "_command", "_fresh")

    @classmethod
    def describe(cls) -> dict[str, Any]:
        """Return the same, and how many ticks before now each row of an input is."""
        told = super().describe()
        for name in told.keys() & {"q", "qd", "foot", "foot_velocity"}:
            told[name]["ticks_ago"] = list(cls.LAGS)
        told["past_torque"]["ticks_ago"] = [lag + 1 for lag in cls.TORQUE_LAGS]
        return told

    def __init__(self, period: float) -> None:
        super().__init__(period)
        self._track = SampleHistory(max(*self.LAGS, DELAY_DEPTH) + 1, period)
        self._lags, self._torque_lags = np.array(self.LAGS), np.array(self.TORQUE_LAGS)
        self.reset(0)

    def reset(self, count: int) -> None:
        """Forget everything."""
        self._track.reset(count)
        self._torques = np.zeros((max(self.TORQUE_LAGS) + 1, count, 2))
        self._command = np.zeros(count)
        self._fresh = True

    def restart(self, rows: IntArray | slice, measurement: Measurement) -> None:
        """Let the newest sample stand for the past of some legs."""
        self._track.fill(rows, measurement)
        self._torques[:, rows] = 0.0
        self._fresh = False
        self._take(measurement)

    def update(self, measurement: Measurement, last_torque: Array) -> None:
        """Put this tick's samples and the last torque in their places."""
        if self._fresh:
            self.restart(slice(None), measurement)
            return
        self._track.shift()
        self._torques[1:] = self._torques[:-1]
        self._torques[0] = last_torque
        self._take(measurement)

    def _take(self, measurement: Measurement) -> None:
        self._track.insert(measurement)
        self._track.hold(DELAY_DEPTH)
        self._command = measurement.command[:, 0]

    def inputs(self) -> Inputs:
        """Return the chosen lags of the tracks."""
        track = self._track
        age = np.argmax(track.known[:DELAY_DEPTH], axis=0) * track.period
        return {
            "q": track.q[self._lags].swapaxes(0, 1).astype(np.float32),
            "qd": track.qd[self._lags].swapaxes(0, 1).astype(np.float32),
            "age": age[:, None].astype(np.float32),
            "past_torque": self._torques[self._torque_lags].swapaxes(0, 1).astype(np.float32),
            "command": self._command[:, None].astype(np.float32),
        }


class DatedLong(Dated):
    """The dated layout with a memory of 0.7 s, longer than a hop; the lags grow with age.

    How long the last flight took, and what the last stance put into it, is in there.
    """

    name: ClassVar[str] = "dated-long"
    LAGS: ClassVar[tuple[int, ...]] = (
        0, 1, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20, 25, 31, 38, 46, 55, 65, 77, 90, 105, 122, 140,
    )  # fmt: skip
    TORQUE_LAGS: ClassVar[tuple[int, ...]] = (0, 1, 2, 3, 4, 6, 8, 11, 15, 20, 27, 36, 48, 64)
    shapes: ClassVar[dict[str, tuple[int, ...]]] = _dated_shapes(LAGS, TORQUE_LAGS)


class AnyLeg(Dated):
    """The dated layout in the leg's own units, and what its robot file says of the leg.

    The foot's position below and in front of the hip, (n, lags, 2), is over the leg's length L,
    about its middle; it follows from the joint samples. Velocities are over sqrt(g / L), ages over
    25 ms, past torques over ``full_torque``, N m, (n, 2), with which the network's actions are
    multiplied, too; the command is over L. ``robot`` are the file's numbers, (n, k), see
    ``robot_numbers``.
    """

    name: ClassVar[str] = "any-leg"
    COMMAND_GAIN: ClassVar[float] = 4.0
    """Of commands over the leg's length, so that they lie about between -1 and 1."""
    MIDDLE: ClassVar[float] = 1.05
    """Of commands over the leg's length."""
    FOOT_MIDDLE: ClassVar[Array] = np.array([0.7, 0.0])
    FOOT_GAIN: ClassVar[float] = 4.0
    VELOCITY_GAIN: ClassVar[float] = 1.5
    """Of the foot's position and velocity, so that they lie about between -1 and 1."""
    LATE: ClassVar[float] = 0.025
    """Age of a sample that is shown as 1, s."""
    shapes: ClassVar[dict[str, tuple[int, ...]]] = {
        "foot": (len(Dated.LAGS), 2),
        "foot_velocity": (len(Dated.LAGS), 2),
        **Dated.shapes,
        "robot": (robot_numbers.COUNT,),
        FULL_TORQUE: (2,),
    }
    units: ClassVar[dict[str, str]] = {"q": "rad", FULL_TORQUE: "N m"}

    _numbers: Array | None = None

    def set_robots(self, robots: Sequence[Robot]) -> None:
        """Say what is believed of the legs."""
        self._numbers = np.array([robot_numbers.robot_numbers(robot) for robot in robots])
        self.full_torque = np.array([robot_numbers.full_torque(robot) for robot in robots])
        """Torques of full actions, N m, (n or 1, 2)."""
        self._length = np.array([[robot_numbers.leg_length(robot)] for robot in robots])
        self._share = np.array([[[r.thigh.length / robot_numbers.leg_length(r)]] for r in robots])
        self._foot = np.array([[robot.foot.radius] for robot in robots])
        self._time = np.array([[[robot_numbers.fall_time(robot)]] for robot in robots])

    def inputs(self) -> Inputs:
        """Return all in the leg's units; UsageError where it does not know which leg it is on."""
        if self._numbers is None:
            raise UsageError(
                "A policy for any leg does not know which it is on; tell it with `set_robot`."
            )
        seen, count = super().inputs(), len(self._command)
        foot, velocity = self._foot_motion(seen["q"], seen["qd"])
        height = (self._command[:, None] - self._foot) / self._length
        return {
            "foot": foot.astype(np.float32),
            "foot_velocity": (velocity * self._time).astype(np.float32),
            "q": seen["q"],
            "qd": (seen["qd"] * self._time).astype(np.float32),
            "age": seen["age"] * np.float32(1 / self.LATE),
            "past_torque": (seen["past_torque"] / self.full_torque[:, None]).astype(np.float32),
            "command": ((height - self.MIDDLE) * self.COMMAND_GAIN).astype(np.float32),
            "robot": _repeat(self._numbers, count),
            FULL_TORQUE: _repeat(self.full_torque, count),
        }

    def _foot_motion(self, q: Array32, qd: Array32) -> tuple[Array, Array]:
        """Return where the foot is below and in front of the hip, and its velocity times L/s."""
        thigh = np.stack([np.cos(q[..., 0]), np.sin(q[..., 0])], axis=-1)
        both = q.sum(axis=-1)
        shank = np.stack([np.cos(both), np.sin(both)], axis=-1)
        thigh, shank = self._share * thigh, (1 - self._share) * shank
        rate = qd.sum(axis=-1)[..., None]
        turned = qd[..., :1] * thigh[..., ::-1] + rate * shank[..., ::-1]
        foot = self.FOOT_GAIN * (thigh + shank - self.FOOT_MIDDLE)
        return foot, self.VELOCITY_GAIN * _TURN * turned


_TURN = np.array([-1.0, 1.0])  # Signs of the derivatives of cosine and sine


def _repeat(values: Array, count: int) -> Array32:
    return np.broadcast_to(values.astype(np.float32), (count, values.shape[1]))


OBSERVATION_HISTORIES: dict[str, type[ObservationHistory]] = {
    history.name: history for history in (ThreeSamples, Dated, DatedLong, AnyLeg)
}
"""Classes by the names that policy files, tasks and ``hop train --observation`` know them by."""


def make_observation_history(name: str, period: float) -> ObservationHistory:
    """Return a fresh history for a control period, s; PolicyError where no layout has that name."""
    if name not in OBSERVATION_HISTORIES:
        raise PolicyError(unknown_name("observation layout", name, OBSERVATION_HISTORIES))
    return OBSERVATION_HISTORIES[name](period)
