"""Energy shaping: a state machine that sets the hopping height by the gain of its push.

Paper, "Energy Shaping". Each push presses with k F_f; each hop corrects k by the energy reached.
"""

import dataclasses
from collections.abc import Callable
from typing import Protocol

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.control import height_estimate
from hopping_leg.control.cartesian import foot_force_torque
from hopping_leg.control.joint_observer import DatedObserver, LatestObserver
from hopping_leg.control.leg_view import LegView, view_leg
from hopping_leg.control.phases import DAMP_LIMIT, FLIGHT_LIMIT, PUSH_LIMIT, Phase, Phases
from hopping_leg.control.posture import joint_pd, smooth_step, smooth_step_rate
from hopping_leg.control.gain_files import load_gains
from hopping_leg.control.shaping_gains import (
    LITERAL,
    ROBUST,
    Gain,
    ShapingGains,
    ShapingOptions,
    scale_gains,
)
from hopping_leg.robot import kinematics, load_robot
from hopping_leg.robot.model import GRAVITY
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import CONTROL_RATE
from hopping_leg.sim.disturbance import Measurement

_SHORTEST_PUSH = 0.02
"""Least Delta x_l, m: the paper's quotient has no bound where the leg lands almost extended."""

_STEP = (0.7, 1.4)
"""Bounds of E_d / E_{j-1}: one missed touchdown must not spoil the gain."""

_RANGE = (0.3, 4.0)
"""Bounds of k over its first value."""


class Truth(Protocol):
    """What the simulator knows and the leg does not; live views of n legs."""

    height: Array
    height_rate: Array

    def foot_clearance(self) -> Array:
        """Return the gap under each foot, m, (n,)."""
        ...


class EnergyShaping:
    """The baseline controller.

    Args:
        robot: The leg, as far as the controller knows it.
        gains: Each one number, or one per leg.
        options: Readings of the paper.
        rate: Control rate, Hz.
        name: Shown in tables.
        truth: Source of the options that read ``"true"``; see ``roll_out(..., on_legs=...)``.
    """

    def __init__(
        self,
        robot: Robot,
        gains: ShapingGains = ShapingGains(),
        options: ShapingOptions = ShapingOptions(),
        *,
        rate: float = CONTROL_RATE,
        name: str = "energy-shaping",
    ) -> None:
        self.robot, self.gains, self.options, self.name = robot, gains, options, name
        self.period = 1 / rate
        self.truth: Truth | None = None
        dated = options.state == "dated"
        self._observer = DatedObserver(self.period, gains.position_pull) if dated else LatestObserver()
        self._longest = _longest_leg(robot)
        self._stiffness = _per_joint(gains.hip_stiffness, gains.knee_stiffness)
        self._damping = _per_joint(gains.hip_damping, gains.knee_damping)

    def reset(self, count: int) -> None:
        """Forget everything; the legs stand and push next."""
        nothing = np.zeros(count)
        self._observer.reset(count)
        self._phases = Phases(count)
        self._k_ratio = np.ones(count)
        self._rates = np.zeros((3, count))
        self._length_0 = np.full(count, np.nan)
        self._pushed = np.full(count, np.nan)
        self._liftoff_height, self._liftoff_rate = nothing, nothing
        self._liftoff_q = np.zeros((count, 2))
        self._highest = nothing
        self._apex = np.full(count, np.nan)
        self._height = nothing

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2)."""
        command = measurement.command[:, 0]
        leg = view_leg(self.robot, self._observer.update(measurement))
        first = np.isnan(self._length_0)
        self._length_0 = np.where(first, leg.length, self._length_0)
        self._phases.tick(self.period)
        lean = command - self.gains.reference
        liftoff = self._reach(self.gains.liftoff_length + self.gains.liftoff_slope * lean)
        landing = self._reach(self.gains.landing_length + self.gains.landing_slope * lean)
        self._end_touchdown(leg, command)
        self._end_push(leg, liftoff)
        posture, posture_rate = self._posture(landing)
        self._end_flight(leg, posture, posture_rate, command)
        self._estimate_height(leg)
        flight = joint_pd(posture - leg.q, posture_rate - leg.qd, self._stiffness, self._damping)
        press = self._press(leg, command, liftoff, landing)
        share = self._push_share(leg, liftoff)
        torque = share[:, None] * press + (1 - share)[:, None] * flight
        return torque

    def internals(self) -> dict[str, Array]:
        """Return height estimates, phase and gain of the last tick."""
        return {
            "estimated_height_m": self._height,
            "estimated_apex_m": self._apex,
            "phase": self._phases.phase.astype(np.float64),
            "gain_k": self._gain(self._pushed),
        }

    def _reach(self, length: Gain) -> Array:
        return np.minimum(length, self._longest)

    def _gain(self, command: Array) -> Array:
        gains = self.gains
        return (gains.k0 + gains.k0_slope * (command - gains.reference)) * self._k_ratio

    def _push_share(self, leg: LegView, liftoff: Array) -> Array:
        """Return how much of the coming period the foot presses, 0 to 1, (n,)."""
        pressing = ~self._phases.are(Phase.FLIGHT)
        share = pressing.astype(np.float64)
        if self.options.liftoff == "timed":
            ahead = np.maximum(leg.rate, 1e-3) * self.period
            left = np.clip((liftoff - leg.length) / ahead, 0.0, 1.0)
            share = np.where(self._phases.are(Phase.LIFTOFF), left, share)
        self._last_share = share
        return share

    def _press(self, leg: LegView, command: Array, liftoff: Array, landing: Array) -> Array:
        """Return the torques of lift-off and touchdown (paper, Eq. 8), N m, (n, 2)."""
        gains = self.gains
        side = -gains.kp_y * leg.y - gains.kd_y * leg.y_rate
        brake = gains.touchdown_stiffness * (landing - leg.length)
        brake = brake - gains.touchdown_damping * leg.rate
        pushing = self._phases.are(Phase.LIFTOFF)
        push = self._gain(command) * self._feedforward(command, liftoff)
        return foot_force_torque(self.robot, leg.q, np.where(pushing, push, brake), side)

    def _feedforward(self, command: Array, liftoff: Array) -> Array:
        """Return F_f = m g (x_d - x_0) / Delta x_l (paper, Eq. 3), N, (n,)."""
        distance = np.maximum(liftoff - self._length_0, _SHORTEST_PUSH)
        rise = command - self._length_0 - self.robot.foot.radius
        return self.robot.mass * GRAVITY * np.maximum(rise, 0.0) / distance

    def _posture(self, landing: Array) -> tuple[Array, Array]:
        """Return where the joints should be in flight and how fast, rad and rad/s, (n, 2)."""
        target = kinematics.joint_angles(self.robot, np.stack([landing, 0 * landing], axis=-1))
        share = (self._phases.clock / self.gains.retract_time)[:, None]
        travel = target - self._liftoff_q
        rate = travel * smooth_step_rate(share) / np.asarray(self.gains.retract_time)[..., None]
        return self._liftoff_q + travel * smooth_step(share), rate

    def _end_push(self, leg: LegView, liftoff: Array) -> None:
        clock = self._phases.clock
        if self.options.liftoff == "true":
            done = (self._true().foot_clearance() > 0) & (clock > 4 * self.period)
        else:
            done = leg.length >= liftoff
        late = np.zeros_like(clock)
        if self.options.liftoff == "timed":
            ended = self._last_share < 1 if hasattr(self, "_last_share") else done & False
            late = np.where(ended, (1 - self._last_share) * self.period, 0.0) if ended.any() else late
            done = ended
        pushing = self._phases.are(Phase.LIFTOFF)
        who = pushing & (done | (clock > PUSH_LIMIT))
        self._liftoff_height = np.where(who, leg.stand, self._liftoff_height)
        self._liftoff_rate = np.where(who, leg.rate, self._liftoff_rate)
        self._liftoff_q = np.where(who[:, None], leg.q, self._liftoff_q)
        self._highest = np.where(who, 0.0, self._highest)
        self._phases.enter(who, Phase.FLIGHT, 0.0)

    def _end_flight(self, leg: LegView, posture: Array, posture_rate: Array, command: Array) -> None:
        clock = self._phases.clock
        planned = np.einsum("ni,ni->n", kinematics.jacobian(self.robot, leg.q)[:, 0], posture_rate)
        self._rates = np.concatenate([(leg.rate - planned)[None], self._rates[:-1]])
        if self.options.contact == "true":
            touched = (self._true().foot_clearance() <= 0) & (clock > 4 * self.period)
        elif self.options.contact == "rate":
            touched = (self._rates[0] < self.gains.touchdown_rate) & (clock > self.gains.flight_min)
        else:
            touched = np.median(self._rates, axis=0) < self.gains.touchdown_rate
            touched &= clock > self.gains.flight_min
        who = self._phases.are(Phase.FLIGHT) & (touched | (clock > FLIGHT_LIMIT))
        if who.any():
            self._update_gain(who, leg, command)
        self._phases.enter(who, Phase.TOUCHDOWN)

    def _update_gain(self, who: BoolArray, leg: LegView, command: Array) -> None:
        """k_j = k_{j-1} (E_d / E_{j-1})^exponent with E = m g x (paper, Eqs. 1, 2 and 6)."""
        gains, clock = self.gains, np.maximum(self._phases.clock, self.period)
        match self.options.height:
            case "ballistic":
                apex = height_estimate.ballistic_apex(self._liftoff_height, self._liftoff_rate)
            case "flight_time":
                apex = height_estimate.flight_time_apex(self._liftoff_height, leg.stand, clock)
            case "true":
                apex = self._highest
        apex = gains.reference + gains.height_offset + gains.height_scale * (apex - gains.reference)
        self._apex = np.where(who, apex, self._apex)
        desired = self._pushed if self.options.desired == "pushed" else command
        step = np.clip(desired / np.maximum(apex, 1e-3), *_STEP) ** gains.exponent
        self._k_ratio = np.where(who, np.clip(self._k_ratio * step, *_RANGE), self._k_ratio)

    def _end_touchdown(self, leg: LegView, command: Array) -> None:
        clock = self._phases.clock
        rate = self._true().height_rate if self.options.contact == "true" else leg.rate
        turned = (rate >= 0) & (clock > 2 * self.period)
        who = self._phases.are(Phase.TOUCHDOWN) & (turned | (clock > DAMP_LIMIT))
        self._length_0 = np.where(who, leg.length, self._length_0)
        self._pushed = np.where(who | np.isnan(self._pushed), command, self._pushed)
        self._phases.enter(who, Phase.LIFTOFF)

    def _estimate_height(self, leg: LegView) -> None:
        flying = height_estimate.ballistic_height(
            self._liftoff_height, self._liftoff_rate, self._phases.clock
        )
        self._height = np.where(self._phases.are(Phase.FLIGHT), flying, leg.stand)
        if self.truth is not None:
            self._highest = np.maximum(self._highest, self.truth.height)

    def _true(self) -> Truth:
        if self.truth is None:
            raise RuntimeError("options that read 'true' need the simulator; set EnergyShaping.truth")
        return self.truth


def _per_joint(hip: Gain, knee: Gain) -> Array:
    return np.stack(np.broadcast_arrays(np.asarray(hip, float), np.asarray(knee, float)), axis=-1)


def _longest_leg(robot: Robot) -> float:
    """Return the leg length at the knee's soft limit, m."""
    thigh, shank, knee = robot.thigh.length, robot.shank.length, robot.knee.upper
    return float(np.sqrt(thigh**2 + shank**2 + 2 * thigh * shank * np.cos(knee)))


def tuned_energy_shaping(robot: Robot, *, rate: float = CONTROL_RATE) -> EnergyShaping:
    """Return the shipped baseline, its gains carried over to ``robot``."""
    found = load_gains()
    gains = scale_gains(found.gains, load_robot(found.robot), robot)
    return EnergyShaping(robot, gains, ROBUST, rate=rate)


def paper_energy_shaping(robot: Robot, *, rate: float = CONTROL_RATE) -> EnergyShaping:
    """Return the paper's law, gains and estimator, nothing added."""
    gains = scale_gains(ShapingGains(), load_robot(load_gains().robot), robot)
    return EnergyShaping(robot, gains, LITERAL, rate=rate, name="energy-shaping-literal")
