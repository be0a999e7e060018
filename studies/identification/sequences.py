"""Recordings as mujoco.sysid wants them: control and joint angles over time, and a model each."""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import mujoco
import numpy as np
from mujoco import sysid

from hopping_leg.arrays import Array
from hopping_leg.identify.initial_states import base_rate, start_states
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.windows import Window, cut
from hopping_leg.robot import COARSE_TIMESTEP, MotorLimit
from studies.identification.throughput import build_rig_model
from studies.identification.twin import believed

Way = Literal["whole", "windows"]
"""Whole recordings with the PD in the model, or windows driven by the motors' torques."""

WINDOW = 0.4
"""Length of the windows, s; what ``hop identify`` takes for torque-driven rigs."""

_KEPT_MODELS = 128


@dataclass(frozen=True)
class Sequences:
    """The trajectories of one recording and how a model for them is built.

    Attributes:
        trajectories: As mujoco.sysid wants them.
        build: From the names and values of parameters to a model.
    """

    trajectories: list[Any]
    build: Callable[[tuple[str, ...], tuple[float, ...]], mujoco.MjModel]


def sequences(recording: Recording, way: Way) -> Sequences:
    """Cut a recording, or leave it whole.

    Args:
        recording: Under a 200 Hz PD.
        way: ``whole`` lets the model's actuators close the PD at every physics step, as a model
            for mujoco.sysid usually does; the recording's own held its torque for a period.
            ``windows`` plays the very torques of the motors to the leg without any PD.
    """
    build = functools.lru_cache(_KEPT_MODELS)(functools.partial(_build, recording, way))
    windows = cut([recording], None if way == "whole" else WINDOW)
    model = build((), ())
    states = _states(recording)
    control = _control(recording, way)
    parts = [_trajectory(recording, model, states, control, window) for window in windows]
    return Sequences(parts, build)


def _build(
    recording: Recording, way: Way, names: Sequence[str], values: Sequence[float]
) -> mujoco.MjModel:
    robot = LegHypothesis(believed()).replace(dict(zip(names, values, strict=True))).robot
    model = build_rig_model(robot, recording.metadata.rig, COARSE_TIMESTEP)
    if way == "whole":
        model.actuator_biasprm[:, 1] = -np.array(recording.metadata.stiffness)
        model.actuator_biasprm[:, 2] = -np.array(recording.metadata.damping)
    return model


def _states(recording: Recording) -> tuple[Array, Array]:
    """Return the model's positions and velocities at every row."""
    q, qd = start_states(recording)
    if recording.metadata.rig == "fixed-base":
        return q, qd
    height = recording.trace.column("height_m")
    return np.column_stack([height, q]), np.column_stack([base_rate(recording, believed()), qd])


def _control(recording: Recording, way: Way) -> Array:
    """Return what the actuators get at every row, N m, (rows, 2)."""
    spring = np.array(recording.metadata.stiffness) * recording.array("position_command")
    if way == "whole":
        return spring
    q, qd = recording.array("position"), recording.array("velocity")
    torque = spring - np.array(recording.metadata.stiffness) * q
    torque -= np.array(recording.metadata.damping) * qd
    return MotorLimit(believed()).clip(torque, qd)


def _trajectory(
    recording: Recording,
    model: mujoco.MjModel,
    states: tuple[Array, Array],
    control: Array,
    window: Window,
) -> Any:  # noqa: ANN401
    rows = slice(window.start, window.start + window.length)
    substeps = round(recording.metadata.period / COARSE_TIMESTEP)
    held = np.repeat(control[rows], substeps, axis=0)
    seconds = np.arange(window.length) * recording.metadata.period
    kind = sysid.SignalType.MjStateQPos
    mapping = {"hip_qpos": (kind, np.array([0])), "knee_qpos": (kind, np.array([1]))}
    angles = recording.array("position")[rows]
    q, qd = (values[window.start] for values in states)
    return sysid.SystemTrajectory(
        model=model,
        control=sysid.TimeSeries(np.arange(len(held)) * COARSE_TIMESTEP, held),
        sensordata=sysid.TimeSeries(seconds, angles, mapping),
        initial_state=sysid.create_initial_state(model, q, qd),
        state=None,
    )
