// Energy shaping as it is tuned and shipped: a port of `src/hopping_leg/controllers/energy_shaping`.
// The comments name the paper's equations.

import { DATA, JOINTS, PERIOD, clamp } from "live/data.js";
import { DatedObserver } from "live/history.js";
import { footPosition, jacobian, jointAngles } from "live/kinematics.js";

const SHORTEST_PUSH = 0.02; // least length of a push, m
const STEP = [0.7, 1.4]; // bounds of E_d / E_{j-1}
const RANGE = [0.3, 4]; // bounds of k over its first value
const PUSH_LIMIT = 0.4; // longest phases, s
const FLIGHT_LIMIT = 0.5;
const BRAKE_LIMIT = 0.25;
const MEMORY = 3; // ticks that a touchdown is judged by
const LIFTOFF = 0;
const FLIGHT = 1;
const TOUCHDOWN = 2;

const massOf = ({ base, thigh, shank }) => base.mass + thigh.mass + shank.mass;
const median = (values) => values.toSorted((a, b) => a - b)[(values.length - 1) / 2];

// The path of least jerk from 0 to 1, and its derivative.
function smoothStep(share) {
  const s = clamp(share, 0, 1);
  return [s ** 3 * (10 - 15 * s + 6 * s ** 2), 30 * s ** 2 * (1 - s) ** 2];
}

// Torques that press the foot with a force down and to the side, N m (paper, Eq. 7).
function footTorque([[a, b], [c, d]], push, side) {
  return [a * push + c * side, b * push + d * side];
}

export class EnergyShaping {
  constructor(name, robot) {
    this.name = name;
    this.robot = robot;
    this.gains = robot.gains;
    const { thigh: { length: thigh }, shank: { length: shank }, knee } = robot;
    this.longest = Math.sqrt(thigh ** 2 + shank ** 2 + 2 * thigh * shank * Math.cos(knee.upper));
    this.range = robot.heights;
    this.reset();
  }

  stranger() { return ""; }

  // Forget everything; the leg stands and pushes next.
  reset() {
    this.observer = new DatedObserver(this.gains.position_pull);
    this.phase = LIFTOFF;
    this.clock = 0; // time in the phase, s
    this.ratio = 1; // k over its first value
    this.length0 = undefined; // at the turning point, m
    this.pushed = undefined; // command of the push, m
    this.share = 1; // of the coming period in which the leg pushes
    this.rate = 0;
    this.excess = Array(MEMORY).fill(0);
    this.resisting = Array(MEMORY).fill(0);
    this.liftoff = { height: 0, rate: 0, q: [0, 0] };
  }

  enter(phase, since = 0) {
    this.phase = phase;
    this.clock = since;
  }

  // Return joint torques, N m.
  act(measurement) {
    const { robot, gains } = this;
    const command = measurement.samples[0][4];
    const leg = this.view(measurement);
    this.length0 ??= leg.length;
    this.pushed ??= command;
    this.clock += PERIOD;
    const liftoff = this.legLength(gains.liftoff_length, gains.liftoff_slope, command);
    const landing = this.legLength(gains.landing_length, gains.landing_slope, command);
    this.endTouchdown(leg, command);
    this.endPush(leg);
    const { posture, rate } = this.retraction(jointAngles(robot, landing));
    const flying = JOINTS.map((joint, i) => (
      gains[`${joint}_stiffness`] * (posture[i] - leg.q[i])
      + gains[`${joint}_damping`] * (rate[i] - leg.qd[i])
    ));
    this.endFlight(leg, rate, flying, command);
    const side = -gains.kp_y * leg.y - gains.kd_y * leg.yRate;
    const pressing = footTorque(leg.jacobian, this.force(leg, command, liftoff, landing), side);
    this.share = this.phase === FLIGHT ? 0 : 1;
    if (this.phase === LIFTOFF) {
      const ahead = Math.max(leg.rate, 1e-3) * PERIOD;
      this.share = clamp((liftoff - leg.length) / ahead, 0, 1);
    }
    this.rate = leg.rate;
    return flying.map((torque, i) => torque + this.share * (pressing[i] - torque));
  }

  // The virtual leg from hip to foot, all estimated.
  view(measurement) {
    const [q, qd] = this.observer.update(measurement);
    const [length, y] = footPosition(this.robot, q);
    const matrix = jacobian(this.robot, q);
    const [rate, yRate] = matrix.map(([hip, knee]) => hip * qd[0] + knee * qd[1]);
    return { q, qd, length, y, rate, yRate, jacobian: matrix, stand: length + this.robot.foot.radius };
  }

  legLength(length, slope, command) {
    return Math.min(length + slope * (command - this.gains.reference), this.longest);
  }

  // Where the joints should be in flight, and how fast.
  retraction(target) {
    const duration = this.gains.retract_time;
    const [path, speed] = smoothStep(this.clock / duration);
    const way = target.map((angle, i) => angle - this.liftoff.q[i]);
    return {
      posture: way.map((angle, i) => this.liftoff.q[i] + angle * path),
      rate: way.map((angle) => angle * speed / duration),
    };
  }

  // Force along the leg: of the push (paper, Eq. 3, times k), or of the brake.
  force(leg, command, liftoff, landing) {
    const { gains, robot } = this;
    if (this.phase !== LIFTOFF) {
      return gains.touchdown_stiffness * (landing - leg.length) - gains.touchdown_damping * leg.rate;
    }
    const distance = Math.max(liftoff - this.length0, SHORTEST_PUSH);
    const rise = Math.max(command - this.length0 - robot.foot.radius, 0);
    const forward = massOf(robot) * DATA.gravity * rise / distance;
    const gain = (gains.k0 + gains.k0_slope * (command - gains.reference)) * this.ratio;
    const final = gains.push_rate + gains.push_rate_slope * (command - gains.reference);
    const share = clamp((leg.length - this.length0) / distance, 0, 1);
    const intended = final * Math.sqrt(share * (2 - share));
    return gain * forward + gains.push_damping * (intended - leg.rate);
  }

  // The push ends within a period, at the leg length of lift-off.
  endPush(leg) {
    const done = this.share < 1;
    if (this.phase !== LIFTOFF || !(done || this.clock > PUSH_LIMIT)) return;
    this.liftoff = { height: leg.stand, rate: this.rate, q: leg.q };
    this.enter(FLIGHT, (1 - this.share) * PERIOD);
  }

  // The flight ends where the ground pushes the leg together, or the flight PD resists it.
  endFlight(leg, planned, torque, command) {
    const { gains } = this;
    const pushed = this.touches(leg, planned, torque);
    const shortest = gains.flight_min + gains.flight_min_slope * (command - gains.reference);
    const touched = pushed && this.clock > shortest;
    if (this.phase !== FLIGHT || !(touched || this.clock > FLIGHT_LIMIT)) return;
    this.judgeHop(leg, touched ? this.clock : Math.min(this.clock, shortest));
    this.enter(TOUCHDOWN);
  }

  touches(leg, planned, torque) {
    const { gains, robot } = this;
    const [[a, b], [c, d]] = leg.jacobian;
    const determinant = a * d - b * c;
    const least = 0.1 * robot.thigh.length * robot.shank.length; // the straight leg is singular
    const bounded = (determinant < 0 ? -1 : 1) * Math.max(Math.abs(determinant), least);
    this.excess = [leg.rate - (a * planned[0] + b * planned[1]), ...this.excess.slice(0, -1)];
    this.resisting = [(d * torque[0] - c * torque[1]) / bounded, ...this.resisting.slice(0, -1)];
    return median(this.excess) < gains.touchdown_rate
      || median(this.resisting) > gains.touchdown_force;
  }

  // Correct k by the energy that the time in the air tells (paper, Eqs. 1, 2 and 6).
  judgeHop(leg, airborne) {
    const { gains } = this;
    const time = Math.max(airborne, PERIOD);
    const rate = (leg.stand - this.liftoff.height) / time + 0.5 * DATA.gravity * time;
    const raw = this.liftoff.height + Math.max(rate, 0) ** 2 / (2 * DATA.gravity);
    const lean = gains.height_scale * (raw - gains.reference);
    const apex = gains.reference + gains.height_offset + lean;
    const step = clamp(this.pushed / Math.max(apex, 1e-3), ...STEP);
    this.ratio = clamp(this.ratio * step ** gains.exponent, ...RANGE);
  }

  endTouchdown(leg, command) {
    const turned = leg.rate >= 0 && this.clock > 2 * PERIOD;
    if (this.phase !== TOUCHDOWN || !(turned || this.clock > BRAKE_LIMIT)) return;
    this.length0 = leg.length;
    this.pushed = command;
    this.enter(LIFTOFF);
  }
}
