"""Recorded hops made again in MuJoCo, in closed loop, by the law that commanded them.

A simulation begins in the state in which a push was recorded to begin, and meets lift-off and
touchdown when it does. On the boom the base may move forward, too; what the boom adds to its
inertia weighs nothing, and the leg's weight is what is left by the counterweight.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.robot import GRAVITY, MotorLimit, Robot, compile_spec, get_spec, kinematics
from studies.real_hops.recorded import (
    FLIGHT_GAINS,
    Hop,
    controllers_robot,
    force_of,
)

TIMESTEP = 1e-3
"""Longest physics step, s; motors are asked every second one."""
_EFFECTIVE_GRAVITY = 4.5
"""Of the boom in free flight, m/s2."""
_BOOM_PERIOD, _RAIL_PERIOD = 1 / 130, 1 / 630
_BOOM_STIFFNESS, _BOOM_DAMPING = 2.0, 0.2
_LONGEST = 1.5  # s


@dataclass(frozen=True)
class Simulated:
    """What came out, from the beginning of the push to the touchdown."""

    time: Array
    """s, (ticks,)"""
    q: Array
    """rad, (ticks, 2)"""
    torque: Array
    """N m, (ticks, 2)"""
    rise: Array
    """Of the base, m, (ticks,)."""
    lift_off_s: float
    """When the flight's law begins."""
    touchdown_s: float
    """NaN if there is none."""


class Leg:
    """A robot on a rig with motors that give torques at the joints."""

    def __init__(self, robot: Robot, rig: str, added_mass: float, timestep: float) -> None:
        spec = get_spec(robot, timestep)
        base = spec.body("base")
        base.mass += added_mass
        if rig == "boom":
            base.add_joint(name="forward", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0])
        for actuator in spec.actuators:
            actuator.ctrllimited, actuator.gear[0] = False, 1
        self.robot, self.model = robot, compile_spec(spec, robot.name)
        self.data = mujoco.MjData(self.model)
        names = ("rail", "hip", "knee")
        self.rail, *joints = (int(self.model.joint(name).dofadr[0]) for name in names)
        self._joints, self._limit = np.array(joints), MotorLimit(robot)
        if rig == "boom":
            lift = (robot.mass + added_mass) * (GRAVITY - _EFFECTIVE_GRAVITY)
            self.data.qfrc_applied[self.rail] = lift
        self._floor = self.model.geom("floor").id

    @property
    def q(self) -> Array:
        """Joint angles, rad, (2,)."""
        return np.array(self.data.qpos[self._joints])

    @property
    def qd(self) -> Array:
        """Joint velocities, rad/s, (2,)."""
        return np.array(self.data.qvel[self._joints])

    @property
    def height(self) -> float:
        """Of the base, m."""
        return float(self.data.qpos[self.rail])

    @property
    def touches(self) -> bool:
        """Whether anything touches the ground."""
        return bool(self.data.ncon)

    def place(self, q: Array, qd: Array) -> None:
        """Stand on the ground in a posture, its foot still."""
        self.data.qpos[self._joints], self.data.qvel[self._joints] = q, qd
        self.data.qpos[self.rail] = kinematics.stance_height(self.robot, q)
        down, forward = kinematics.foot_velocity(self.robot, q, qd)
        self.data.qvel[self.rail] = down
        if self.model.nv > 3:
            self.data.qvel[self.model.joint("forward").dofadr[0]] = -forward

    def raise_ground(self, rise: float) -> None:
        """Let the leg land so much higher than it took off, m."""
        self.model.geom_pos[self._floor, 2] = rise

    def step(self, torque: Array, steps: int) -> Array:
        """Ask the motors for torques for physics steps; return what they gave, N m, (2,)."""
        self.data.ctrl[:] = self._limit.give(torque, self.qd)
        mujoco.mj_step(self.model, self.data, steps)
        return np.array(self.data.ctrl)


def simulate(hop: Hop, robot: Robot, gain: float = 1.0, added_mass: float = 0.0) -> Simulated:
    """Make a hop again with a robot.

    Args:
        hop: What was recorded.
        robot: Leg and ground.
        gain: Torque that the motors give over what is commanded on the boom, measured on the rail.
        added_mass: What the boom adds to the inertia of the base, kg.
    """
    law = (_Boom if hop.rig == "boom" else _Rail)(hop)
    steps = 2 * int(np.ceil(law.period / TIMESTEP / 2))
    leg = Leg(robot, hop.rig, added_mass, law.period / steps)
    leg.place(hop.q[0], hop.qd[0])
    start = leg.height
    ticks, lift_off, touchdown = [], np.nan, np.nan
    landing = _landing(hop, robot)
    for tick in range(round(_LONGEST / law.period)):
        now = tick * law.period
        law.sense(leg.q, leg.qd, now)
        if law.flying and np.isnan(lift_off):
            lift_off = now
        ticks.append((now, *leg.q, *np.zeros(2), leg.height - start))
        for _ in range(0, steps, 2):
            given = leg.step(gain * law.torque(leg.q, leg.qd), 2)
        ticks[-1] = (*ticks[-1][:3], *given, ticks[-1][-1])
        falling = leg.data.qvel[leg.rail] < 0
        if law.flying and falling and not leg.touches:
            leg.raise_ground(landing)
        if law.flying and falling and leg.touches and now - lift_off > 2 * law.period:
            touchdown = now + law.period
            break
    rows = np.array(ticks)
    return Simulated(rows[:, 0], rows[:, 1:3], rows[:, 3:5], rows[:, 5], lift_off, touchdown)


def _landing(hop: Hop, robot: Robot) -> float:
    """Return how much higher than the start the ground is where a hop ended, m."""
    if not np.isfinite(hop.rise[-1]):
        return 0.0
    first, last = kinematics.stance_height(robot, hop.q[[0, -2]])
    return float(hop.rise[-2] - (last - first))


class _Boom:
    """Commands are from the sample before, and held."""

    period = _BOOM_PERIOD

    def __init__(self, hop: Hop) -> None:
        self._robot, self._hop = controllers_robot("boom"), hop
        self._force = force_of(self._robot, hop.q[0], hop.command[1])
        self._old = (hop.q[0], hop.qd[0], False)
        self._asked = np.zeros(2)
        self.flying = False

    def sense(self, q: Array, qd: Array, now: float) -> None:
        """Take a sample, and command by the one before."""
        del now
        old_q, old_qd, flying = self._old
        if flying:
            self._asked = _BOOM_STIFFNESS * (self._hop.target - old_q) - _BOOM_DAMPING * old_qd
        else:
            self._asked = kinematics.jacobian(self._robot, old_q).T @ self._force
        foot = kinematics.foot_position(self._robot, q)
        self.flying |= bool(np.hypot(*foot) >= self._hop.length)
        self._old = (q, qd, self.flying)

    def torque(self, q: Array, qd: Array) -> Array:
        """Return what motors are asked for, N m, (2,)."""
        del q, qd
        return self._asked


class _Rail:
    """The push gives what the motors gave at the same length of the leg; the flight is a PD."""

    period = _RAIL_PERIOD

    def __init__(self, hop: Hop) -> None:
        self._robot, self._hop = controllers_robot("rail"), hop
        pushed = slice(0, hop.lift_off)
        foot = kinematics.foot_position(self._robot, hop.q[pushed])
        self._lengths = np.maximum.accumulate(np.hypot(*foot.T))
        self._pushed = hop.torque[pushed]
        self._given: Array = self._pushed[0]
        self.flying = False

    def sense(self, q: Array, qd: Array, now: float) -> None:
        """Take a sample."""
        del qd, now
        length = float(np.hypot(*kinematics.foot_position(self._robot, q)))
        self.flying |= length >= self._hop.length
        self._given = np.array(
            [np.interp(length, self._lengths, column) for column in self._pushed.T]
        )

    def torque(self, q: Array, qd: Array) -> Array:
        """Return what motors are asked for, N m, (2,)."""
        if not self.flying:
            return self._given
        stiffness, damping = FLIGHT_GAINS
        return np.asarray(stiffness * (self._hop.target - q) - damping * qd)
