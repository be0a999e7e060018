// MPC: simulate the rest of the hop, choose the push-off that reaches the apex. A port of
// `src/hopping_leg/controllers/mpc`; it sees the true state of the simulated leg.

import { DATA, PERIOD, clamp } from "live/data.js";
import { commandLimits } from "live/robot.js";
import { makeMemory, send, stepLeg } from "live/stepper.js";
import { legTable } from "live/table.js";

export const FLIGHT = 0;
export const LANDING = 1;
export const PUSH = 2;

const TIMESTEP = 1e-3; // of the simulated hops, s
const STEPS = Math.round(PERIOD / TIMESTEP);
const TICKS = 200; // after which a simulated hop is given up
const FIRST_PUSH = 2.5; // force over the weight with which planning begins
const TRIES = 5;
const TOLERANCE = 1e-4; // of the apex, m
const LIFTED = 0.01; // gap between foot and ground of a leg in the air, m
const STRETCHED = 0.97; // share of the stretched length at which a push ends in any case
const FALL = 0.3; // force over the weight with which a leg sinks until it has to brake
const REST_SPEED = 0.1; // speed of the hip on landing that counts as rest, m/s
const LEAST_STROKE = 0.08; // of a landing, over the stretched length
const SINK = 2; // that the foot sinks in, over that at rest
const MOST_SINK = 0.25; // and over the length, at most
const LOWERS = 0.35; // by how much of it the knee comes nearer to the ground
const LEAST_PUSH = 0.2; // push-off force over the weight
const MOST_PUSH = 14;
const REST = 0.02; // speed of the hip below which a landing ends, m/s
const LATE = 0.6; // share of the push's way below which a landing may end

// Set the numbers of a hop to a height, m; the push-off force stays.
function shapeHop(p, shape, command, hop) {
  const length = p.thigh_length + p.shank_length;
  const above = command - p.foot_radius;
  const sink = Math.min(SINK * p.gravity / p.contact_stiffness, MOST_SINK * length);
  const knee = p.knee_radius - p.foot_radius + shape.knee_gap * length + LOWERS * sink;
  const bent = knee ** 2 + p.thigh_length ** 2 - p.shank_length ** 2;
  const folded = knee + Math.sqrt(Math.max(bent, 0));
  hop.flight = Math.min(shape.flight_length * length, above - shape.clearance * length);
  hop.flight = Math.max(hop.flight, folded + LEAST_STROKE * length);
  const drop = Math.max(above - hop.flight, 0);
  hop.liftoff = Math.min(
    hop.flight + shape.least_push * length + shape.liftoff_per_drop * drop, shape.liftoff * length,
  );
  const squat = shape.squat * length - shape.squat_per_drop * drop;
  hop.squat = Math.min(squat, Math.min(hop.flight, hop.liftoff) - LEAST_STROKE * length);
  hop.squat = Math.max(hop.squat, folded);
  hop.stop = shape.braking * p.gravity * drop / Math.max(hop.flight - hop.squat, 0.02 * length);
}

// Return the phase of the hop in a state.
function nextPhase(p, state, hop, phase) {
  const down = p.thigh_length * Math.cos(state[1]) + p.shank_length * Math.cos(state[1] + state[2]);
  const height = state[0] - p.foot_radius;
  if (phase === FLIGHT) return height <= down && state[3] < 0 ? LANDING : FLIGHT;
  const stretched = down >= STRETCHED * (p.thigh_length + p.shank_length);
  if (height - down > LIFTED || (phase === PUSH && (height >= hop.liftoff || stretched))) {
    return FLIGHT;
  }
  const low = height < hop.liftoff - LATE * (hop.liftoff - hop.squat);
  return phase === LANDING && low && (state[3] > -REST || height <= hop.squat) ? PUSH : phase;
}

// Change `torque`, what the motors give, to what a phase of the hop asks for.
function law(p, shape, state, hop, phase, torque) {
  const l1 = p.thigh_length;
  const l2 = p.shank_length;
  const length = l1 + l2;
  const weight = p.mass * p.gravity;
  const time = Math.sqrt(length / p.gravity);
  let hipTorque;
  let kneeTorque;
  if (phase === FLIGHT) {
    // Inverse kinematics of the foot below the hip, knee behind.
    const cosine = (hop.flight * hop.flight - l1 * l1 - l2 * l2) / (2 * l1 * l2);
    const knee = -Math.acos(clamp(cosine, -1, 1));
    const hip = -Math.atan2(l2 * Math.sin(knee), l1 + l2 * Math.cos(knee));
    hipTorque = shape.hip_stiffness * (hip - state[1]) - shape.hip_damping * time * state[4];
    kneeTorque = shape.knee_stiffness * (knee - state[2]) - shape.knee_damping * time * state[5];
    hipTorque *= weight * length;
    kneeTorque *= weight * length;
  } else {
    const s12 = Math.sin(state[1] + state[2]);
    const c12 = Math.cos(state[1] + state[2]);
    const forward = l1 * Math.sin(state[1]) + l2 * s12;
    const down = l1 * Math.cos(state[1]) + l2 * c12;
    const forwardRate = l1 * Math.cos(state[1]) * state[4] + l2 * c12 * (state[4] + state[5]);
    let force;
    let leaning = 0;
    if (phase === PUSH) {
      const rest = (hop.liftoff + p.foot_radius - state[0]) / (shape.taper * length);
      force = hop.push * clamp(rest, 0, 1);
      const large = Math.max(hop.push / weight - shape.lean_from, 0);
      leaning = force * Math.min(shape.lean * large, shape.most_lean);
    } else {
      // Constant deceleration to rest at the squat; a leg that is slower than it sinks.
      const way = Math.max(state[0] - p.foot_radius - hop.squat, 0.01 * length);
      const slowing = Math.min(state[3], 0) ** 2 / (2 * way);
      force = (state[3] > -REST_SPEED ? shape.fold : FALL) * weight;
      if (slowing >= hop.stop) {
        force = weight * Math.min(1 + slowing / p.gravity, shape.most_landing);
      }
    }
    let sideways = -shape.sideways_stiffness * forward / length;
    sideways -= shape.sideways_damping * forwardRate * time / length;
    sideways = sideways * weight - leaning;
    hipTorque = -force * forward + sideways * down;
    kneeTorque = -force * l2 * s12 + sideways * l2 * c12;
  }
  const slew = shape.slew * weight * length;
  [hipTorque, kneeTorque].forEach((asked, joint) => {
    const wanted = clamp(asked, -p.torque_limit[joint], p.torque_limit[joint]);
    torque[joint] = clamp(wanted, torque[joint] - slew, torque[joint] + slew);
  });
}

// Return the height of the next apex after a lift-off, NaN if none comes; all but p changes.
function apexOf(p, shape, state, memory, hop, torque) {
  let phase = PUSH;
  const late = p.command_latency - Math.floor(p.command_latency / PERIOD + 1e-9) * PERIOD;
  for (let tick = 0; tick < TICKS; tick++) {
    phase = nextPhase(p, state, hop, phase);
    law(p, shape, state, hop, phase, torque);
    send(memory, torque, late);
    const height = state[0];
    const rate = state[3];
    stepLeg(p, state, memory, [], 0, STEPS, TIMESTEP);
    if (phase === FLIGHT && rate > 0 && state[3] <= 0) {
      // Between two ticks the base moves on a parabola.
      return height + rate * rate * PERIOD / (2 * Math.max(rate - state[3], 1e-9));
    }
  }
  return NaN;
}

export class TrueStateMpc {
  constructor(robot) {
    this.name = "mpc-true-state";
    this.range = commandLimits(robot);
    this.robot = robot;
    this.reset();
  }

  stranger() { return ""; }

  // Take the simulated leg, live.
  watch(leg) { this.leg = leg; }

  reset() {
    const { base, thigh, shank } = this.robot;
    this.phase = LANDING;
    this.hop = { push: FIRST_PUSH * (base.mass + thigh.mass + shank.mass) * DATA.gravity };
  }

  // Return joint torques, N m.
  act(measurement) {
    const command = measurement.samples[0][4];
    const { leg: { robot, state, memory }, hop } = this;
    if (robot !== this.known) {
      this.known = robot;
      this.table = legTable(robot, TIMESTEP, true);
    }
    const torque = [...memory.motor_torque];
    shapeHop(this.table, DATA.shape, command, hop);
    this.phase = nextPhase(this.table, state, hop, this.phase);
    if (this.phase === PUSH) this.plan(command, state, memory);
    law(this.table, DATA.shape, state, hop, this.phase, torque);
    return torque;
  }

  // Set the push-off force to the one whose simulated apex is the command, by regula falsi.
  plan(command, state, memory) {
    const { table: p, hop } = this;
    const weight = p.mass * p.gravity;
    const least = LEAST_PUSH * weight;
    const most = MOST_PUSH * weight;
    let low = { force: least, error: NaN };
    let high = { force: most, error: NaN };
    let best = { force: hop.push, error: Infinity };
    const way = hop.liftoff + p.foot_radius - state[0];
    let step = weight / Math.max(way, 0.03 * (p.thigh_length + p.shank_length)) / 2;
    for (let attempt = 0; attempt < TRIES; attempt++) {
      const force = hop.push;
      const scratch = makeMemory();
      scratch.motor_torque.set(memory.motor_torque);
      scratch.command.set(memory.motor_torque);
      scratch.acceleration.set(memory.acceleration);
      const apex = apexOf(p, DATA.shape, state.slice(), scratch, hop, [...memory.motor_torque]);
      const error = Number.isNaN(apex) ? -1 : apex - command;
      if (Math.abs(error) < best.error) best = { force, error: Math.abs(error) };
      if (best.error < TOLERANCE) break;
      if (error > 0) high = { force, error };
      else low = { force, error };
      if (!Number.isNaN(high.error) && !Number.isNaN(low.error)) {
        const share = low.error / (low.error - high.error);
        hop.push = low.force + clamp(share, 0.1, 0.9) * (high.force - low.force);
      } else {
        // The work of the push over the rest of the leg's way lifts the weight.
        step *= 2;
        hop.push = clamp(force - step * error, least, most);
      }
      if (hop.push === best.force && !(least < best.force && best.force < most)) break;
    }
    hop.push = best.force;
  }
}
