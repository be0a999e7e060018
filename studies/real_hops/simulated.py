"""Recorded hops made again in the project's stepper, many at once.

A simulation begins in the state in which a push was recorded to begin, its foot still, and meets
lift-off and touchdown when it does. The push gives the torques that were measured, or those of the
logged law in closed loop; the flight is the logged PD in closed loop.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.io import replace_at
from hopping_leg.robot import GRAVITY, JOINTS, Robot, kinematics
from hopping_leg.sim import LegSimulator
from studies.real_hops.recorded import RIGS, Hop, controllers_robot, force_of

TIMESTEP = 2.5e-4
"""Physics step, s."""
_TICK = 1e-3  # s, after which torques are asked anew
_LONGEST = 1.2  # s
_AFTER = 0.03  # s after lift-off from which on the flight's law holds: drives reverse slowly
_STRONG = {"torque_limit": 100.0, "peak_torque": 100.0, "no_load_speed": 1e4}


@dataclass(frozen=True)
class Simulated:
    """What came out of a hop."""

    time: Array
    """Since the push began, s, (ticks,)."""
    q: Array
    """What the encoders show, rad, (ticks, 2)."""
    torque: Array
    """N m, (ticks, 2)"""
    rise: Array
    """Of the base, m, (ticks,)."""
    lift_off_s: float
    """When the flight's law begins; NaN if it never does."""
    touchdown_s: float
    """When the foot comes down to where it was recorded to; NaN if it does not."""


def mounted(robot: Robot, hop: Hop, *, strong: bool) -> Robot:
    """Return a robot on what carried it, with motors that give all that is asked if ``strong``."""
    robot = replace(robot, boom=hop.boom + robot.boom)
    for joint in JOINTS if strong else ():
        for name, value in _STRONG.items():
            robot = replace_at(robot, f"{joint}.motor.{name}", value)
        robot = replace_at(robot, f"{joint}.torque_gain", 1.0)
    return robot


def simulate(
    hops: Sequence[Hop], robots: Sequence[Robot], *, by_law: bool = False
) -> list[Simulated]:
    """Make hops again, each with its robot, pushed by measured torques or by the logged law."""
    legs_of = [mounted(r, h, strong=not by_law) for r, h in zip(robots, hops, strict=True)]
    legs = LegSimulator(legs_of[0], len(hops), rate=1 / _TICK, timestep=TIMESTEP, robots=legs_of)
    q0 = np.array([hop.q[0] for hop in hops])
    standing = np.array([np.median(hop.torque[:2], axis=0) for hop in hops])
    _place(legs, hops, q0, standing)
    pushes = [(_Law if by_law and hop.boom.radius else _Measured)(hop) for hop in hops]
    start, landing = legs.height.copy(), _landings(hops)
    ticks = round(_LONGEST / _TICK)
    q, torque = np.zeros((2, ticks, len(hops), 2), np.float64)
    rise, speed = np.zeros((2, ticks, len(hops)), np.float64)
    clear, lowered = np.zeros((ticks, len(hops))), np.zeros(len(hops))
    for tick in range(ticks):
        q[tick], qd = legs.measured_q, legs.measured_qd
        aloft = legs.foot_clearance() > np.maximum(landing, 0.0)
        falls = [push.flying_s < tick * _TICK - _AFTER for push in pushes]
        descends = aloft & falls & (legs.height_rate < 0) & (lowered == 0)
        legs.raise_ground(np.where(descends, landing, 0.0))
        lowered = np.where(descends, landing, lowered)
        rise[tick], speed[tick] = legs.height + lowered - start, legs.height_rate
        clear[tick] = legs.foot_clearance() - (landing - lowered)
        seen = zip(pushes, q[tick], qd, strict=True)
        torque[tick] = legs.step(np.array([p.torque(tick * _TICK, *one) for p, *one in seen]))
    time = np.linspace(0.0, (ticks - 1) * _TICK, ticks)
    found = []
    for k, push in enumerate(pushes):
        falling = (time > push.flying_s + _AFTER) & (speed[:, k] < 0) & (clear[:, k] <= 0)
        end = int(np.argmax(falling)) if falling.any() else ticks - 1
        rows = slice(0, end + 1)
        touchdown = float(time[end]) if falling.any() else np.nan
        course = (time[rows], q[rows, k], torque[rows, k], rise[rows, k])
        found.append(Simulated(*course, push.flying_s, touchdown))
    return found


def _place(legs: LegSimulator, hops: Sequence[Hop], q0: Array, standing: Array) -> None:
    """Let legs stand with their feet still, belts stretched by what motors gave."""
    stiffness = np.array([robot.reality.of_drives("stiffness") for robot in legs.robots])
    link = q0 - np.nan_to_num(standing / stiffness)
    legs.place(slice(None), 0.0, link)
    legs.height[:] = kinematics.stance_height(legs.geometry, link) - 1e-9
    legs.qd[:] = [hop.qd[0] for hop in hops]
    down, forward = kinematics.foot_velocity(legs.geometry, link, legs.qd).T
    legs.height_rate[:] = down
    legs.forget(slice(None))
    legs.records["rotor"][:, :2], legs.records["forward"] = q0, -forward
    legs.read_sensors()


def _landings(hops: Sequence[Hop]) -> Array:
    """Return how much higher the ground is where hops ended than where they began, m."""
    rises = [
        (h.rise[-2], kinematics.stance_height(controllers_robot(h.rig), h.q[[0, -2]])) for h in hops
    ]
    return np.array([0.0 if np.isnan(up) else up - (s[1] - s[0]) for up, s in rises])


class _Measured:
    """The push gives what was measured, a row late, as it answers; then comes the flight's PD."""

    def __init__(self, hop: Hop) -> None:
        self._hop, self._rig = hop, RIGS[hop.rig]
        self.flying_s = float(hop.time[hop.lift_off])
        self._row = 0
        still = np.zeros(2)
        self._newest, self._old = (hop.q[0], still), (hop.q[0], still)

    def torque(self, now: float, q: Array, qd: Array) -> Array:
        """Return what motors are asked for, N m, (2,)."""
        hop = self._hop
        row = int(np.searchsorted(hop.time, now + 1e-9, side="right")) - 1
        if row > self._row or now > hop.time[-1]:
            self._row, self._old, self._newest = row, self._newest, (q, qd)
        return self._asked(now, min(row, len(hop.time) - 2))

    def _asked(self, now: float, row: int) -> Array:
        if now <= self.flying_s + _AFTER:
            return np.asarray(self._hop.torque[row + 1])
        return self._flight()

    def _flight(self) -> Array:
        """Return the PD's torque, of the row before."""
        q, qd = self._old
        stiffness, damping = np.array(self._rig.stiffness), np.array(self._rig.damping)
        return np.asarray(stiffness * (self._hop.target - q) - damping * qd)


class _Law(_Measured):
    """A constant force until the leg is long enough, then a PD; each from the row before."""

    def __init__(self, hop: Hop) -> None:
        super().__init__(hop)
        self._robot, self._belt = controllers_robot(hop.rig), np.array([1.0, 2.0])
        self._force = force_of(self._robot, hop.q[0], hop.command[1] / self._belt)
        self.flying_s = np.nan
        self._sent, self._seen = np.median(hop.torque[:2], axis=0), 0

    def _asked(self, now: float, row: int) -> Array:
        if self._row == self._seen:  # commands hold from row to row
            return np.asarray(self._sent)
        self._seen = self._row
        length = float(np.hypot(*kinematics.foot_position(self._robot, self._newest[0])))
        if np.isnan(self.flying_s) and length >= self._hop.length:
            self.flying_s = now
        if np.isfinite(self.flying_s):
            self._sent = self._flight()
        else:
            push = self._belt * (kinematics.jacobian(self._robot, self._old[0]).T @ self._force)
            self._sent = push * min(1.0, self._rig.limit / max(np.abs(push).max(), 1e-9))
        return np.asarray(self._sent)


def fall_apex(flight: float) -> float:
    """Return how high a flight of so many seconds rises on the rail, m."""
    return GRAVITY / 8 * flight**2
