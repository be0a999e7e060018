"""Energy shaping: a state machine that sets the hopping height by the gain of its push.

Paper, "Energy Shaping". Each push presses with k F_f; each hop corrects k by the energy reached.
"""

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.controllers.energy_shaping import equations, virtual_leg
from hopping_leg.controllers.energy_shaping.gains import Gain, ShapingGains
from hopping_leg.controllers.energy_shaping.virtual_leg import LegView, Phase
from hopping_leg.controllers.sample_history import DatedObserver
from hopping_leg.robot import JOINTS, Robot, kinematics
from hopping_leg.sim import CONTROL_RATE, Measurement


class EnergyShaping:
    """The baseline controller, at a control rate in Hz; it measures nothing but its joints.

    Joint states are filtered from the dated history of samples, touchdown is the median of three
    leg rates, a push ends within a control period, the apex follows from the time in the air, and
    the gain is judged by the command in force at its push.
    """

    debounced = True
    """Whether touchdown is a median."""

    def __init__(
        self,
        robot: Robot,
        gains: ShapingGains | None = None,
        *,
        rate: float = CONTROL_RATE,
        name: str = "energy-shaping",
    ) -> None:
        self.robot, self.name, self.period = robot, name, 1 / rate
        self.gains = gains or ShapingGains()
        thigh, shank = robot.thigh.length, robot.shank.length
        bent = 2 * thigh * shank * np.cos(robot.knee.upper)
        self._longest = float(np.sqrt(thigh**2 + shank**2 + bent))

    def reset(self, count: int) -> None:
        """Forget everything; the legs stand and push next."""
        self._observer = DatedObserver(self.period, self.gains.position_pull)
        self._observer.reset(count)
        self._detector = virtual_leg.TouchdownDetector(self.robot, count, debounced=self.debounced)
        self._stiffness, self._damping = (
            np.stack([getattr(self.gains, f"{joint}_{kind}") for joint in JOINTS], axis=-1)
            for kind in ("stiffness", "damping")
        )
        self._phase, self._clock = np.full(count, Phase.LIFTOFF), np.zeros(count)
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
        leg = virtual_leg.view_leg(self.robot, *self._joints(measurement))
        self._length_0 = np.where(np.isnan(self._length_0), leg.length, self._length_0)
        self._pushed = np.where(np.isnan(self._pushed), command, self._pushed)
        self._clock = self._clock + self.period
        gains = self.gains
        liftoff = self._length(gains.liftoff_length, gains.liftoff_slope, command)
        landing = self._length(gains.landing_length, gains.landing_slope, command)
        self._end_touchdown(leg, command)
        self._end_push(leg, liftoff)
        target = kinematics.joint_angles(self.robot, np.stack([landing, 0 * landing], axis=-1))
        lasts = np.broadcast_to(gains.retract_time, self._clock.shape)[:, None]
        share, way = self._clock[:, None] / lasts, target - self._liftoff_q
        posture = self._liftoff_q + way * kinematics.smooth_step(share)
        posture_rate = way * kinematics.smooth_step_rate(share) / lasts
        flying = self._stiffness * (posture - leg.q) + self._damping * (posture_rate - leg.qd)
        self._end_flight(leg, posture_rate, flying, command)
        self._estimate_height(leg)
        push = self._force(leg, command, liftoff, landing)
        side = -gains.kp_y * leg.y - gains.kd_y * leg.y_rate
        force = np.stack([push, side], axis=-1)  # on the ground, and forwards, N
        pressing = np.einsum("nij,ni->nj", leg.jacobian, force)
        share = np.where(self._phase == Phase.FLIGHT, 0.0, 1.0)
        pushes = self._phase == Phase.LIFTOFF
        self._share = np.where(pushes, self._pushing_share(leg, liftoff), share)
        self._rate = leg.rate
        torque: Array = flying + self._share[:, None] * (pressing - flying)
        return torque

    def internals(self) -> dict[str, Array]:
        """Return height estimates, phase and gain of the last tick."""
        return {
            "estimated_height_m": self._height,
            "estimated_apex_m": self._apex[0],
            "ballistic_apex_m": self._apex[1],
            "flight_time_apex_m": self._apex[2],
            "phase": self._phase.astype(np.float64),
            "gain_k": self._gain(self._pushed),
        }

    def _length(self, length: Gain, slope: Gain, command: Array) -> Array:
        wanted = length + slope * (command - self.gains.reference)
        return np.minimum(wanted, self._longest)

    def _gain(self, command: Array) -> Array:
        gains = self.gains
        return (gains.k0 + gains.k0_slope * (command - gains.reference)) * self._k_ratio

    def _force(self, leg: LegView, command: Array, liftoff: Array, landing: Array) -> Array:
        gains = self.gains
        final = gains.push_rate + gains.push_rate_slope * (command - gains.reference)
        intended = equations.intended_rate(leg.length, self._length_0, liftoff, final)
        forward = equations.feedforward_force(self.robot, command, self._length_0, liftoff)
        thrust = self._gain(command) * forward + gains.push_damping * (intended - leg.rate)
        brake = gains.touchdown_stiffness * (landing - leg.length)
        brake = brake - gains.touchdown_damping * leg.rate
        return np.where(self._phase == Phase.LIFTOFF, thrust, brake)

    def _end_push(self, leg: LegView, liftoff: Array) -> None:
        done, rate, since = self._lifted_off(leg, liftoff)
        who = (self._phase == Phase.LIFTOFF) & (done | (self._clock > virtual_leg.PUSH_LIMIT))
        self._liftoff_height = np.where(who, leg.stand, self._liftoff_height)
        self._liftoff_rate = np.where(who, rate, self._liftoff_rate)
        self._liftoff_q = np.where(who[:, None], leg.q, self._liftoff_q)
        self._enter(who, Phase.FLIGHT, since)

    def _end_flight(self, leg: LegView, posture_rate: Array, flying: Array, command: Array) -> None:
        gains, clock = self.gains, self._clock
        shortest = gains.flight_min + gains.flight_min_slope * (command - gains.reference)
        touched = self._touched(leg, posture_rate, flying, shortest)
        who = (self._phase == Phase.FLIGHT) & (touched | (clock > virtual_leg.FLIGHT_LIMIT))
        if who.any():  # a touchdown that nobody noticed came before contact was believed
            too_short = np.minimum(clock, shortest)
            self._judge_hop(who, leg, command, np.where(touched, clock, too_short))
        self._enter(who, Phase.TOUCHDOWN)

    def _judge_hop(self, who: BoolArray, leg: LegView, command: Array, airborne: Array) -> None:
        gains = self.gains
        airborne = np.maximum(airborne, self.period)
        ballistic = equations.ballistic_apex(self._liftoff_height, self._liftoff_rate)
        timed = equations.flight_time_apex(self._liftoff_height, leg.stand, airborne)
        raw = self._reached(ballistic, timed)
        lean = raw - gains.reference
        apex = gains.reference + gains.height_offset + gains.height_scale * lean
        self._apex = np.where(who, np.stack([apex, ballistic, timed]), self._apex)
        gain = equations.updated_gain(self._k_ratio, self._desired(command), apex, gains.exponent)
        self._k_ratio = np.where(who, gain, self._k_ratio)

    def _end_touchdown(self, leg: LegView, command: Array) -> None:
        turned = (self._braked_rate(leg) >= 0) & (self._clock > 2 * self.period)
        who = (self._phase == Phase.TOUCHDOWN) & (turned | (self._clock > virtual_leg.BRAKE_LIMIT))
        self._length_0 = np.where(who, leg.length, self._length_0)
        self._pushed = np.where(who, command, self._pushed)
        self._enter(who, Phase.LIFTOFF)

    def _enter(self, who: BoolArray, phase: Phase, since: Array | float = 0.0) -> None:
        """Put legs into a phase that began ``since`` seconds ago, (n,)."""
        self._phase = np.where(who, phase, self._phase)
        self._clock = np.where(who, since, self._clock)

    def _estimate_height(self, leg: LegView) -> None:
        thrown = equations.ballistic_height(self._liftoff_height, self._liftoff_rate, self._clock)
        self._height = np.where(self._phase == Phase.FLIGHT, thrown, leg.stand)

    # What the paper's own law, or a study that asks the simulator, does otherwise.

    def _joints(self, measurement: Measurement) -> tuple[Array, Array]:
        return self._observer.update(measurement)

    def _pushing_share(self, leg: LegView, liftoff: Array) -> Array:
        """Return for how much of the coming control period a leg still pushes, 0 to 1, (n,)."""
        return equations.share_of_period(leg.length, leg.rate, liftoff, self.period)

    def _lifted_off(self, leg: LegView, liftoff: Array) -> tuple[BoolArray, Array, Array]:
        """Return who ends its push, the leg rate with which it did, m/s, and since when, s."""
        return self._share < 1, self._rate, (1 - self._share) * self.period

    def _touched(self, leg: LegView, planned: Array, torque: Array, shortest: Array) -> BoolArray:
        pushed = self._detector.update(leg, planned, torque, self.gains)
        return pushed & (self._clock > shortest)

    def _braked_rate(self, leg: LegView) -> Array:
        return leg.rate

    def _reached(self, ballistic: Array, timed: Array) -> Array:
        return timed

    def _desired(self, command: Array) -> Array:
        return self._pushed


class LiteralEnergyShaping(EnergyShaping):
    """The paper's description, as printed.

    The newest sample counts, touchdown is one leg rate, pushes last whole control periods, the apex
    is that of the speed at lift-off, and E_d that of the present command.
    """

    debounced = False

    def _joints(self, measurement: Measurement) -> tuple[Array, Array]:
        return measurement.q[:, 0], measurement.qd[:, 0]

    def _pushing_share(self, leg: LegView, liftoff: Array) -> Array:
        return np.ones_like(leg.length)

    def _lifted_off(self, leg: LegView, liftoff: Array) -> tuple[BoolArray, Array, Array]:
        return leg.length >= liftoff, leg.rate, np.zeros_like(leg.rate)

    def _reached(self, ballistic: Array, timed: Array) -> Array:
        return ballistic

    def _desired(self, command: Array) -> Array:
        return command
