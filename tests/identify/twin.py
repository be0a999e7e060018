"""Recordings of a leg that is known exactly: simulated with a plain loop over mj_step."""

import dataclasses
from functools import cache

import mujoco
import numpy as np
import polars as pl

from hopping_leg.identify.excitation import Excitation
from hopping_leg.identify.play_excitation import play
from hopping_leg.identify.recording import make_recording
from hopping_leg.identify.recording_format import PAIRS, RecordingMetadata
from hopping_leg.robot import MotorLimit, get_spec, kinematics, load_robot

STEP = 1e-3  # Physics step of the fits
FINE = STEP / 4  # Physics step of the recordings, by Runge-Kutta's method
LEG = load_robot("legv2")
GAINS = {"stiffness": (8.0, 8.0), "damping": (0.3, 0.3)}


def swing(seconds, rig="fixed-base", rate=200.0, phase=0.0):
    """Return targets, rad, (ticks, 2): swings in the air, squats on the ground."""
    t = np.arange(round(seconds * rate)) / rate
    if rig != "fixed-base":
        bend = 0.8 + 0.25 * np.cos(2 * np.pi * 1.3 * t + phase)
        return np.stack([bend, -2 * bend], axis=1)
    hip = 0.9 * np.cos(2 * np.pi * 0.5 * t + phase) + 0.2 * np.sin(2 * np.pi * 2.1 * t)
    knee = -1.4 + 0.8 * np.cos(2 * np.pi * 1.1 * t + 2 * phase) + 0.2 * np.sin(14 * t)
    return np.stack([hip, knee], axis=1)


def rig_model(robot, rig, timestep=FINE):
    """Return MuJoCo's model of a robot on its rig, driven by torques at its joints."""
    spec = get_spec(robot, timestep, fixed_base=rig == "fixed-base")
    spec.option.tolerance = 1e-15
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    for actuator in spec.actuators:
        actuator.ctrllimited = False
        actuator.gear[0] = 1
    return spec.compile()


def record(robot, targets, rig="fixed-base", rate=200.0, onboard="zoh", name="twin"):
    """Track targets with a PD at the rows' rate on a robot in MuJoCo."""
    model = rig_model(robot, rig)
    data = mujoco.MjData(model)
    limit = MotorLimit(robot)
    kp, kd = (np.array(GAINS[k]) for k in ("stiffness", "damping"))
    data.qpos[-2:] = targets[0]
    if rig != "fixed-base":
        data.qpos[0] = kinematics.stance_height(robot, targets[0])
    rows, asked = [], kp * (targets[0] - data.qpos[-2:])
    for target in targets:
        q, qd = data.qpos[-2:].copy(), data.qvel[-2:].copy()
        height, measured = data.qpos[0], limit.clip(asked, qd)
        asked = kp * (target - q) - kd * qd
        rows.append((q, qd, measured, asked, target, height))
        for _ in range(round(1 / rate / FINE)):
            data.ctrl[:] = limit.clip(asked, data.qvel[-2:])
            mujoco.mj_step(model, data)
    q, qd, measured, torque, target, height = (np.array(c) for c in zip(*rows, strict=True))
    columns = {"time_s": np.arange(len(q)) / rate}
    quantities = {"position": q, "velocity": qd, "torque": measured, "torque_command": torque}
    if onboard != "torque":
        del quantities["torque_command"]
        quantities |= {"position_command": target, "velocity_command": 0 * target}
    for quantity, values in quantities.items():
        columns |= dict(zip(PAIRS[quantity], values.T, strict=True))
    if rig != "fixed-base":
        columns["height_m"] = height
    metadata = RecordingMetadata(rig, rate, "legv2", "simulated", onboard=onboard, **GAINS)
    return make_recording(pl.DataFrame(columns), metadata, name)


@cache
def tracked():
    """Return the leg swinging for some seconds under its PD."""
    return record(LEG, swing(8.0))


BELT = {"reality.knee.stiffness": 300.0, "reality.knee.stiffness_damping": 0.03}


def hops(robot, seconds, rig="rail"):
    """Play small hops, or their motion in the air, on a robot with its [reality]."""
    time = np.arange(round(200 * seconds)) / 200
    bend = 0.8 + 0.35 * np.cos(2 * np.pi * 2.2 * time)
    targets = np.stack([bend, -2 * bend], axis=1)
    excitation = Excitation(time, targets, 0 * targets, rig, 200.0, "legv2", "hops")
    return play(excitation, robot, believed="legv2")


def noisy(run, seed=0, **scales):
    """Return a recording as seen by poor sensors, with these deviations."""
    rng = np.random.default_rng(seed)
    table = run.trace.table.with_columns(
        run.trace.table[f"{joint}_{name}"] + rng.normal(scale=scale, size=len(run))
        for joint in ("hip", "knee")
        for name, scale in scales.items()
    )
    return make_recording(table, run.metadata, "noisy")


def changed(run, *expressions, **columns):
    """Return a recording with other columns, unchecked."""
    table = run.trace.table.with_columns(*expressions, **columns)
    return dataclasses.replace(run, trace=dataclasses.replace(run.trace, table=table))
