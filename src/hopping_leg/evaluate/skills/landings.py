"""Landings: how hard and bouncy they are, with spring and damper or a joint PD that holds on."""

from dataclasses import dataclass, replace

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers import Controller, RolloutConfig, joint_pd, rollout, stand_hop_land
from hopping_leg.evaluate.metrics import measure
from hopping_leg.robot import GRAVITY, JOINTS, Robot, kinematics
from hopping_leg.robot.dynamics import potential_energy
from hopping_leg.trace import Trace


def ground_force(robot: Robot, trace: Trace) -> Array:
    """Return the force on the leg from outside but for gravity, N, (ticks,).

    It is the mass times the acceleration of the centre of mass plus gravity, from three ticks of
    true heights each; on the ground it is the ground's force but for the rail's small friction.
    """
    q = np.stack([trace.column(f"{joint}_position_rad") for joint in JOINTS], axis=1)
    weight = robot.mass * GRAVITY
    height = potential_energy(robot, trace.column("height_m"), q) / weight
    period = np.diff(trace.column("time_s")).mean()
    force = np.full(len(height), np.nan)
    force[1:-1] = weight + robot.mass * np.diff(height, 2) / period**2
    return force


def peak_force(robot: Robot, trace: Trace, start: int) -> float:
    """Return the largest force from a tick on, in weights of the leg."""
    return float(np.nanmax(ground_force(robot, trace)[start:]) / (robot.mass * GRAVITY))


def rebound(trace: Trace, touchdown: int) -> tuple[float, float]:
    """Return how far a landing at a tick bounced, in a run that ends at rest.

    Returns:
        Highest rise of the base above where it comes to rest, after its lowest point, and highest
        clearance of the foot after touchdown, m; zero where there is none.
    """
    height = trace.column("height_m")
    lowest = touchdown + int(height[touchdown:].argmin())
    over = float(height[lowest:].max() - height[-1])
    return max(over, 0.0), max(float(trace.column("foot_clearance_m")[touchdown:].max()), 0.0)


def last_touchdown(trace: Trace) -> int:
    """Return the tick at which the foot last met the ground; 0 if it never left."""
    clear = trace.column("foot_clearance_m") > 0
    met = np.flatnonzero(clear[:-1] & ~clear[1:])
    return int(met[-1]) + 1 if len(met) else 0


DROP = 0.10
"""Clearance of the foot at the beginning, m, for a leg of the paper's size."""

_SECONDS = 3.0


@dataclass(frozen=True)
class Landed:
    """One way to land; medians over runs."""

    controller: str
    drop_m: float
    """Clearance of the foot at the beginning."""
    peak_force: float
    """Peak force of the ground, weights of the leg."""
    worst_force: float
    """Largest peak force of any run."""
    peak_hip_torque_nm: float
    """Magnitude that the motors gave from touchdown on."""
    peak_knee_torque_nm: float
    rebound_m: float
    """Rise of the base above where it comes to rest, after its lowest point."""
    foot_rebound_m: float
    """Clearance of the foot after touchdown."""
    lowest_base_m: float
    body_contacts: int
    runs: int


def land(setup: RolloutConfig, *, drop: float, repeats: int, seed: int) -> list[Landed]:
    """Drop legs in the landing posture, the foot ``drop`` m above the ground."""
    robot = setup.robot
    posture = stand_hop_land.landing_posture(robot)
    length = float(kinematics.foot_position(robot, posture)[0])
    height = float(kinematics.stance_height(robot, posture)) + drop
    landing = stand_hop_land.StandHopLand(None, robot, 0, rate=setup.rate, dropped=True)
    ways: list[Controller] = [landing, joint_pd.JointPD(posture[None])]
    rows = []
    for way in ways:
        run = rollout(
            way,
            replace(setup, start_length=length),
            np.full((round(_SECONDS * setup.rate), repeats), height),
            seed,
            on_legs=lambda legs: legs.place(slice(None), height, posture),
        )
        rows.append(_row(robot, drop, [run.trace(leg) for leg in range(repeats)]))
    return rows


def _row(robot: Robot, drop: float, traces: list[Trace]) -> Landed:
    first = [int((trace.column("foot_clearance_m") <= 0).argmax()) for trace in traces]
    pairs = list(zip(traces, first, strict=True))
    forces = [peak_force(robot, trace, start) for trace, start in pairs]
    bounces = [rebound(trace, start) for trace, start in pairs]
    windows = [window for trace in traces for window in measure(trace)]

    def torque(joint: str) -> float:
        torques = [trace.column(f"{joint}_torque_nm")[start:] for trace, start in pairs]
        return float(np.median([np.abs(torque).max() for torque in torques]))

    return Landed(
        controller=str(traces[0].header["controller"]),
        drop_m=drop,
        peak_force=float(np.median(forces)),
        worst_force=max(forces),
        peak_hip_torque_nm=torque("hip"),
        peak_knee_torque_nm=torque("knee"),
        rebound_m=float(np.median([over for over, _ in bounces])),
        foot_rebound_m=float(np.median([foot for _, foot in bounces])),
        lowest_base_m=float(min(w.min_height for w in windows)),
        body_contacts=sum(w.body_contacts for w in windows),
        runs=len(traces),
    )
