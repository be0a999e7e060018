"""Energy shaping: a state machine that sets the hopping height by the gain of its push.

Paper, "Energy Shaping". Each push presses with k F_f; each hop corrects k by the energy reached.
"""

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.controllers.energy_shaping import equations, virtual_leg
from hopping_leg.controllers.energy_shaping.gains import Gain, ShapingGains, ShapingOptions
from hopping_leg.controllers.sample_history import DatedObserver
from hopping_leg.robot import Robot, kinematics
from hopping_leg.sim import CONTROL_RATE, Measurement


class EnergyShaping:
    """The baseline controller, at a control rate in Hz; it measures nothing but its joints."""

    def __init__(
        self,
        robot: Robot,
        gains: ShapingGains | None = None,
        options: ShapingOptions | None = None,
        *,
        rate: float = CONTROL_RATE,
        name: str = "energy-shaping",
    ) -> None:
        self.robot, self.name, self.period = robot, name, 1 / rate
        self.gains = gains or ShapingGains()
        self.options = options or ShapingOptions()
        thigh, shank = robot.thigh.length, robot.shank.length
        bent = 2 * thigh * shank * np.cos(robot.knee.upper)
        self._longest = float(np.sqrt(thigh**2 + shank**2 + bent))

    def reset(self, count: int) -> None:
        """Forget everything; the legs stand and push next."""
        self._observer = DatedObserver(self.period, self.gains.position_pull)
        self._observer.reset(count)
        debounced = self.options.contact == "debounced"
        self._detector = virtual_leg.TouchdownDetector(self.robot, count, debounced=debounced)
        self._phases = virtual_leg.Phases(count)
        self._k_ratio = np.ones(count)
        self._length_0 = np.full(count, np.nan)
        self._pushed = np.full(count, np.nan)
        self._share = np.ones(count)
        self._rate = np.zeros(count)
        self._liftoff_height, self._liftoff_rate = np.zeros(count), np.zeros(count)
        self._liftoff_q = np.zeros((count, 2))
        self._height = np.zeros(count)
        self._apex = np.full((3, count), np.nan)

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2)."""
        command = measurement.command[:, 0]
        joints = measurement.q[:, 0], measurement.qd[:, 0]
        if self.options.state == "dated":
            joints = self._observer.update(measurement)
        leg = virtual_leg.view_leg(self.robot, *joints)
        self._length_0 = np.where(np.isnan(self._length_0), leg.length, self._length_0)
        self._pushed = np.where(np.isnan(self._pushed), command, self._pushed)
        self._phases.tick(self.period)
        gains = self.gains
        liftoff = self._length(gains.liftoff_length, gains.liftoff_slope, command)
        landing = self._length(gains.landing_length, gains.landing_slope, command)
        self._end_touchdown(leg, command)
        self._end_push(leg, liftoff)
        target = kinematics.joint_angles(self.robot, np.stack([landing, 0 * landing], axis=-1))
        posture, posture_rate = virtual_leg.retraction(
            self._liftoff_q, target, self._phases.clock, gains.retract_time
        )
        flying = virtual_leg.flight_torque(gains, leg, posture, posture_rate)
        self._end_flight(leg, posture_rate, flying, command)
        self._estimate_height(leg)
        push = self._force(leg, command, liftoff, landing)
        side = -gains.kp_y * leg.y - gains.kd_y * leg.y_rate
        pressing = virtual_leg.foot_force_torque(self.robot, leg.q, push, side)
        self._share, self._rate = self._pressing_share(leg, liftoff), leg.rate
        return flying + self._share[:, None] * (pressing - flying)

    def internals(self) -> dict[str, Array]:
        """Return height estimates, phase and gain of the last tick."""
        return {
            "estimated_height_m": self._height,
            "estimated_apex_m": self._apex[0],
            "ballistic_apex_m": self._apex[1],
            "flight_time_apex_m": self._apex[2],
            "phase": self._phases.phase.astype(np.float64),
            "gain_k": self._gain(self._pushed),
        }

    def _length(self, length: Gain, slope: Gain, command: Array) -> Array:
        wanted = length + slope * (command - self.gains.reference)
        return np.minimum(wanted, self._longest)

    def _gain(self, command: Array) -> Array:
        gains = self.gains
        return (gains.k0 + gains.k0_slope * (command - gains.reference)) * self._k_ratio

    def _force(
        self, leg: virtual_leg.LegView, command: Array, liftoff: Array, landing: Array
    ) -> Array:
        gains = self.gains
        final = gains.push_rate + gains.push_rate_slope * (command - gains.reference)
        intended = equations.intended_rate(leg.length, self._length_0, liftoff, final)
        forward = equations.feedforward_force(self.robot, command, self._length_0, liftoff)
        thrust = self._gain(command) * forward + gains.push_damping * (intended - leg.rate)
        brake = gains.touchdown_stiffness * (landing - leg.length)
        brake = brake - gains.touchdown_damping * leg.rate
        return np.where(self._phases.are(virtual_leg.Phase.LIFTOFF), thrust, brake)

    def _pressing_share(self, leg: virtual_leg.LegView, liftoff: Array) -> Array:
        share = np.where(self._phases.are(virtual_leg.Phase.FLIGHT), 0.0, 1.0)
        if self.options.liftoff == "timed":
            until = equations.share_of_period(leg.length, leg.rate, liftoff, self.period)
            share = np.where(self._phases.are(virtual_leg.Phase.LIFTOFF), until, share)
        return share

    def _end_push(self, leg: virtual_leg.LegView, liftoff: Array) -> None:
        clock, rate, since = self._phases.clock, leg.rate, np.zeros_like(leg.rate)
        if self.options.liftoff == "timed":
            done, rate, since = self._share < 1, self._rate, (1 - self._share) * self.period
        else:
            done = self._stretched(leg, liftoff)
        who = self._phases.are(virtual_leg.Phase.LIFTOFF) & (
            done | (clock > virtual_leg.PUSH_LIMIT)
        )
        self._liftoff_height = np.where(who, leg.stand, self._liftoff_height)
        self._liftoff_rate = np.where(who, rate, self._liftoff_rate)
        self._liftoff_q = np.where(who[:, None], leg.q, self._liftoff_q)
        self._phases.enter(who, virtual_leg.Phase.FLIGHT, since)

    def _end_flight(
        self, leg: virtual_leg.LegView, posture_rate: Array, flying: Array, command: Array
    ) -> None:
        gains, clock = self.gains, self._phases.clock
        shortest = gains.flight_min + gains.flight_min_slope * (command - gains.reference)
        touched = self._touched(leg, posture_rate, flying, shortest)
        who = self._phases.are(virtual_leg.Phase.FLIGHT) & (
            touched | (clock > virtual_leg.FLIGHT_LIMIT)
        )
        if who.any():  # a touchdown that nobody noticed came before contact was believed
            too_short = np.minimum(clock, shortest)
            self._judge_hop(who, leg, command, np.where(touched, clock, too_short))
        self._phases.enter(who, virtual_leg.Phase.TOUCHDOWN)

    def _judge_hop(
        self, who: BoolArray, leg: virtual_leg.LegView, command: Array, airborne: Array
    ) -> None:
        gains, options = self.gains, self.options
        airborne = np.maximum(airborne, self.period)
        ballistic = equations.ballistic_apex(self._liftoff_height, self._liftoff_rate)
        timed = equations.flight_time_apex(self._liftoff_height, leg.stand, airborne)
        raw = self._reached(ballistic, timed)
        lean = raw - gains.reference
        apex = gains.reference + gains.height_offset + gains.height_scale * lean
        self._apex = np.where(who, np.stack([apex, ballistic, timed]), self._apex)
        desired = self._pushed if options.desired == "pushed" else command
        gain = equations.updated_gain(self._k_ratio, desired, apex, gains.exponent)
        self._k_ratio = np.where(who, gain, self._k_ratio)

    def _end_touchdown(self, leg: virtual_leg.LegView, command: Array) -> None:
        clock = self._phases.clock
        turned = (self._braked_rate(leg) >= 0) & (clock > 2 * self.period)
        who = self._phases.are(virtual_leg.Phase.TOUCHDOWN) & (
            turned | (clock > virtual_leg.BRAKE_LIMIT)
        )
        self._length_0 = np.where(who, leg.length, self._length_0)
        self._pushed = np.where(who, command, self._pushed)
        self._phases.enter(who, virtual_leg.Phase.LIFTOFF)

    def _estimate_height(self, leg: virtual_leg.LegView) -> None:
        flying = equations.ballistic_height(
            self._liftoff_height, self._liftoff_rate, self._phases.clock
        )
        self._height = np.where(self._phases.are(virtual_leg.Phase.FLIGHT), flying, leg.stand)

    # What a study asks the simulator instead.

    def _stretched(self, leg: virtual_leg.LegView, liftoff: Array) -> BoolArray:
        stretched: BoolArray = leg.length >= liftoff
        return stretched

    def _touched(
        self, leg: virtual_leg.LegView, planned: Array, torque: Array, shortest: Array
    ) -> BoolArray:
        pushed = self._detector.update(leg, planned, torque, self.gains)
        return pushed & (self._phases.clock > shortest)

    def _braked_rate(self, leg: virtual_leg.LegView) -> Array:
        return leg.rate

    def _reached(self, ballistic: Array, timed: Array) -> Array:
        return timed if self.options.height == "flight_time" else ballistic
