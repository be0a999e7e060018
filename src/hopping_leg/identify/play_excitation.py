"""Recordings of an excitation: played on a simulated leg, or cut from a trace of motors."""

from collections.abc import Callable

import numpy as np
import polars as pl

from hopping_leg.controllers.joint_pd import JointGains, JointPD
from hopping_leg.errors import RecordingError
from hopping_leg.identify.excitation import TARGETS, Excitation
from hopping_leg.identify.recording import Recording, make_recording
from hopping_leg.identify.recording_format import MEASURED, RecordingMetadata
from hopping_leg.robot import TIMESTEP, Robot
from hopping_leg.sim import NO_NOISE, LegSimulator, Plant
from hopping_leg.trace import Trace, interpolated


def play(
    excitation: Excitation,
    robot: Robot,
    *,
    believed: str,
    seed: int = 0,
    gains: JointGains | None = None,
    timestep: float = TIMESTEP,
    on_tick: Callable[[int, int], None] | None = None,
) -> Recording:
    """Record a leg that tracks an excitation by the paper's joint PD.

    Each row holds what the sensors reported when the command of the row was computed; the PD acts
    from that report, once per row. Height and contact, where there is a rail, are the truth. The
    robot plays the real leg with its ``reality``; ``believed`` is the robot file that the recording
    is filed under; the seed is of jitter and noise; ``on_tick`` gets ticks done and in all.
    PhysicsError says that the simulation became unstable, RecordingError that none can believe it.
    """
    gains, fixed = gains or JointGains(), excitation.rig == "fixed-base"
    legs = LegSimulator(
        robot, 1, rate=excitation.rate, timestep=timestep, threads=1, fixed_base=fixed
    )
    plant = Plant(legs, NO_NOISE, None, np.random.default_rng(seed))
    controller = JointPD(excitation.position, excitation.velocity, gains)
    start = excitation.position[0]
    if fixed:
        legs.place(slice(None), robot.straight_height, start)
    else:
        legs.stand(slice(None), start)
    no_command = np.zeros(1)
    plant.channel.restart(slice(None), legs.measured_q, legs.measured_qd, no_command)
    rows = np.empty((len(excitation), 8))
    for tick, row in enumerate(rows):
        told = (legs.measured_q, legs.measured_qd, legs.measured_torque, legs.height)
        row[:] = np.concatenate([*told, legs.foot_clearance()], axis=None)
        plant.drive(controller.act(plant.sense(no_command)))
        if on_tick is not None:
            on_tick(tick + 1, len(excitation))
    legs.require_stable(rows[:, 2:4])
    source = f"simulated: {robot.name} ({robot.digest}), seed {seed}"
    table = excitation.table.hstack(pl.DataFrame(rows[:, :6], MEASURED))
    if not fixed:
        table = table.with_columns(height_m=rows[:, 6], contact=rows[:, 7] <= 0)
    header = {"robot": robot.name, "robot_digest": robot.digest, "seed": seed}
    header |= {"timestep_s": timestep, "excitation": excitation.description}
    metadata = _metadata(excitation, believed, source, gains)
    return make_recording(table, metadata, robot.name, header=header)


def _metadata(
    excitation: Excitation, believed: str, source: str, gains: JointGains
) -> RecordingMetadata:
    facts = excitation.rig, excitation.rate, believed, source
    return RecordingMetadata(*facts, onboard="zoh", **vars(gains))


def recording_of(
    trace: Trace, excitation: Excitation, *, believed: str, gains: JointGains, name: str
) -> Recording:
    """Return the part of a run's trace in which the excitation was played.

    Each row holds what the drives reported when the command of the row was computed; ticks without
    a reply have no measurement. A moving base's height is there if it was measured without long
    gaps. The joint PD runs on the host, once per row; ``believed`` is the robot file that the
    recording is filed under. RecordingError says that it was not played.
    """
    columns = (*MEASURED, *TARGETS, "height_m")
    if lacking := [column for column in columns if column not in trace.table.columns]:
        raise RecordingError(f"{name} has no column '{lacking[0]}'; no excitation was played.")
    played = pl.col(TARGETS[0]).is_finite()
    table = trace.table.with_columns(interpolated("height_m")).filter(played)
    if not table.height:
        raise RecordingError(f"{name} ended before the excitation began; see its events.")
    time = np.round(table["time_s"].to_numpy() - float(table["time_s"][0]), 9)
    source = f"motors on {trace.header.get('transport')}, {trace.header.get('started')}"
    run = {k: v for k, v in trace.header.items() if k != "events"}
    table = table.select(pl.Series("time_s", time), *columns)
    if excitation.rig == "fixed-base" or table["height_m"].null_count():
        table = table.drop("height_m")
    metadata = _metadata(excitation, believed, source, gains)
    header = {"run": run, "excitation": excitation.description}
    return make_recording(table, metadata, name, header=header)
