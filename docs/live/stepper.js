// The stepper: a port of `src/hopping_leg/sim/stepper.py` for one leg whose drives are commanded
// torques alone. At every physics step, in this order: the commands that arrive, software limit,
// gain, current loop, torque-speed line and saturation, cogging and gear loss; friction, contact,
// stops and transmission; the new velocity and position.

import {
  addContacts, addStops, constrainAcceleration, makeFriction, makeRows, massMatrix,
  rotorAcceleration, solve, symmetric, times, vector,
} from "live/physics.js";

const LOSS_SPEED = 0.1; // joint speed below which a gear's loss fades
const COMMANDS = 8; // under way at most

// What a leg remembers besides its state (x, q1, q2 and their rates).
export const makeMemory = () => ({
  rotor: new Float64Array(4), // angles and speeds behind elastic transmissions
  acceleration: vector(),
  motor_torque: new Float64Array(2),
  mean_torque: new Float64Array(2),
  command: new Float64Array(2), // in force
  pending: [], // {arrival, torque} by time of arrival
  newest: 0, // slot of the past
});

// Put a command under way that arrives so many seconds from now; none overtakes another.
export function send(memory, torque, arrival) {
  const { pending } = memory;
  while (pending.length && pending.at(-1).arrival >= arrival) pending.pop();
  if (pending.length >= COMMANDS) pending.length = COMMANDS - 1;
  pending.push({ arrival, torque: [torque[0], torque[1]] });
}

const asked = new Float64Array(2);

// Take the commands that arrive in a step: set the torques asked for, mean over the step; return
// the share of it in which the last command was in force.
function receive(memory, now, dt) {
  const { command, pending } = memory;
  let rest = 1;
  let arrived = 0;
  asked.fill(0);
  while (arrived < pending.length && pending[arrived].arrival < now + dt) {
    const { arrival, torque } = pending[arrived];
    const share = Math.min(Math.max((arrival - now) / dt, 0) - (1 - rest), rest);
    if (share > 0) {
      for (let i = 0; i < 2; i++) asked[i] += share * command[i];
      rest -= share;
    }
    command.set(torque);
    arrived += 1;
  }
  if (arrived) pending.splice(0, arrived);
  for (let i = 0; i < 2; i++) asked[i] += rest * command[i];
  return rest;
}

// What the motor gives, at the joint, if asked for a torque and giving `before`.
function motorTorque(p, joint, torque, before, speed) {
  const limit = p.torque_limit[joint];
  const within = Math.min(Math.max(torque, -limit), limit);
  const free = before + p.follow[joint] * (p.gain[joint] * within - before);
  const drop = p.speed_slope[joint] * speed;
  const saturation = p.saturation[joint];
  const upper = Math.min(Math.max(p.stall_torque[joint] - drop, 0), saturation);
  const lower = Math.max(Math.min(-p.stall_torque[joint] - drop, 0), -saturation);
  return Math.min(Math.max(free, lower), upper);
}

// What arrives at the joint: with cogging, less what the gear loses.
function afterGear(p, joint, torque, angle, speed) {
  if (p.ripple[joint] !== 0) {
    torque += p.ripple[joint] * Math.sin(p.ripple_periods[joint] * angle);
  }
  if (p.log_efficiency[joint] < 0) {
    const share = speed / Math.sqrt(speed * speed + LOSS_SPEED * LOSS_SPEED);
    torque *= Math.exp(p.log_efficiency[joint] * (torque > 0 ? share : -share));
  }
  return torque;
}

// A joint's dry friction under a motor's torque (Coulomb, load, Stribeck).
function dryFriction(p, joint, torque, speed) {
  let friction = p.friction[joint] + p.load_friction[joint] * Math.abs(torque);
  if (p.stiction[joint] > 0 && Math.abs(speed) < 6 * p.stiction_speed[joint]) {
    friction += p.stiction[joint] * Math.exp(-((speed / p.stiction_speed[joint]) ** 2));
  }
  return friction;
}

// The torque of an elastic transmission with a dead band.
function transmitted(p, joint, twist, rate) {
  const half = p.half_backlash[joint];
  const beyond = twist - Math.min(Math.max(twist, -half), half);
  return p.belt_stiffness[joint] * beyond + p.belt_damping[joint] * rate;
}

const rows = makeRows();
const friction = makeFriction();
const force = vector();
const speed = vector();
const accelerated = vector();
const change = vector();
const mass = symmetric();
const damped = symmetric();
const rotorA = new Float64Array(2); // accelerations of the rotors
const tie = new Float64Array(2); // what implicit damping of a transmission adds, see stepper.py
const ease = new Float64Array(2);
const mean = new Float64Array(2);

// Torque on a joint's link and the dry friction that holds it; of an elastic joint, the rotor's
// acceleration as well.
function drive(p, joint, motor, q, v, t, w) {
  const torque = afterGear(p, joint, motor, t, w);
  const loss = dryFriction(p, joint, motor, w);
  if (p.elastic[joint] === 0) {
    force[1 + joint] = torque - p.damping[joint] * v;
    friction.loss[1 + joint] = loss;
    rotorA[joint] = 0;
    return;
  }
  const link = transmitted(p, joint, t - q, w - v);
  const pull = torque - p.damping[joint] * w - link;
  const rest = -p.friction_damping * w;
  const stiff = p.friction_stiffness[joint];
  force[1 + joint] = link;
  friction.loss[1 + joint] = 0;
  rotorA[joint] = rotorAcceleration(p.armature[joint], pull, rest, loss, stiff);
}

// What damping that is implicit in the new velocity adds to a link's inertia.
function implicitDamping(p, joint, dt) {
  const drag = dt * p.damping[joint];
  if (p.elastic[joint] === 0) {
    tie[joint] = ease[joint] = 0;
    return drag;
  }
  tie[joint] = dt * p.belt_damping[joint];
  ease[joint] = 1 / (p.armature[joint] + drag + tie[joint]);
  return tie[joint] - tie[joint] * tie[joint] * ease[joint];
}

// Advance a leg by physics steps.
//   p, state, memory: its parameters, (x, q1, q2 and their rates), and what `makeMemory` says
//   past: ring of what the sensors saw, arrays of 6; empty if nothing needs it
//   push: upward force on the base, N
//   steps, dt: how many, and of how many seconds
export function stepLeg(p, state, memory, past, push, steps, dt) {
  let [x, q1, q2, v0, v1, v2] = state;
  let [t1, t2, w1, w2] = memory.rotor;
  let [hip, knee] = memory.motor_torque;
  const a = memory.acceleration;
  const elastic1 = p.elastic[0] > 0;
  const elastic2 = p.elastic[1] > 0;
  friction.loss[0] = p.rail_friction;
  set(friction.stiff, p.rail_friction_stiffness, p.friction_stiffness);
  mean.fill(0);
  if (!elastic1) [t1, w1] = [q1, v1];
  if (!elastic2) [t2, w2] = [q2, v2];
  for (let step = 0; step < steps; step++) {
    // The drives: torques of motors and gears, dry friction.
    const inForce = receive(memory, step * dt, dt);
    hip = motorTorque(p, 0, asked[0], hip, w1);
    knee = motorTorque(p, 1, asked[1], knee, w2);
    drive(p, 0, hip, q1, v1, t1, w1);
    drive(p, 1, knee, q2, v2, t2, w2);

    // Mass matrix M and forces f - b.
    const s1 = Math.sin(q1);
    const c1 = Math.cos(q1);
    const s12 = Math.sin(q1 + q2);
    const c12 = Math.cos(q1 + q2);
    massMatrix(p, s1, s12, c1 * c12 + s1 * s12, mass);
    const bend = p.coupling * (s12 * c1 - c12 * s1);
    const v12 = v1 + v2;
    const swing = p.thigh_moment * c1 * v1 * v1 + p.shank_moment * c12 * v12 * v12;
    force[0] = push - p.gravity * mass[0] - swing - p.rail_damping * v0;
    force[1] += bend * v2 * (v1 + v12) - p.gravity * mass[1];
    force[2] -= bend * v1 * v1 + p.gravity * mass[2];

    // Constraints, and the acceleration under them.
    speed[0] = v0;
    speed[1] = v1;
    speed[2] = v2;
    const touching = addContacts(p, rows, x, speed, s1, c1, s12, c12);
    const count = addStops(p, rows, touching, q1, q2, speed);
    for (let i = 0; i < 3; i++) {
      friction.rest[i] = -p.friction_damping * speed[i];
      friction.bound[i] = friction.loss[i] * (1 / friction.stiff[i]);
    }
    constrainAcceleration(mass, force, friction, rows, count, a);

    // The new velocity, in which damping is implicit, and the position that follows it.
    times(mass, a, accelerated);
    damped.set(mass);
    damped[0] += dt * p.rail_damping;
    damped[3] += implicitDamping(p, 0, dt);
    damped[5] += implicitDamping(p, 1, dt);
    for (let i = 0; i < 2; i++) {
      accelerated[1 + i] += tie[i] * ease[i] * p.armature[i] * rotorA[i];
    }
    solve(damped, accelerated, change);
    v0 += dt * change[0];
    v1 += dt * change[1];
    v2 += dt * change[2];
    x += dt * v0;
    q1 += dt * v1;
    q2 += dt * v2;
    if (elastic1) {
      w1 += dt * ease[0] * (p.armature[0] * rotorA[0] + tie[0] * change[1]);
      t1 += dt * w1;
    } else [t1, w1] = [q1, v1];
    if (elastic2) {
      w2 += dt * ease[1] * (p.armature[1] * rotorA[1] + tie[1] * change[2]);
      t2 += dt * w2;
    } else [t2, w2] = [q2, v2];

    // What the motors gave, and what their sensors see.
    mean[0] += hip;
    mean[1] += knee;
    if (inForce < 1) {
      // At the end of a step in which a command arrived, the torque is the new command's, no mean
      // of both; a current loop that lags knows the mean alone.
      if (p.follow[0] === 1) hip = motorTorque(p, 0, memory.command[0], hip, w1);
      if (p.follow[1] === 1) knee = motorTorque(p, 1, memory.command[1], knee, w2);
    }
    if (past.length) {
      memory.newest = (memory.newest + 1) % past.length;
      past[memory.newest].set([t1, t2, w1, w2, hip, knee]);
    }
  }
  for (const command of memory.pending) command.arrival -= steps * dt;
  state.set([x, q1, q2, v0, v1, v2]);
  memory.rotor.set([t1, t2, w1, w2]);
  memory.motor_torque.set([hip, knee]);
  memory.mean_torque.set([mean[0] / steps, mean[1] / steps]);
}

function set(out, first, others) {
  out[0] = first;
  out[1] = others[0];
  out[2] = others[1];
}

// Set what a leg's sensors report at the end of a control period: position, velocity and torque of
// hip and knee. `draws` are six standard normal numbers. Late positions and velocities are
// interpolated between physics steps.
export function readSensors(p, memory, past, draws, reading, dt) {
  const depth = past.length;
  const back = p.measurement_latency / dt;
  const whole = Math.floor(back);
  for (let i = 0; i < 6; i++) {
    let value = i < 4 ? memory.rotor[i] : memory.motor_torque[i - 4];
    if (back > 0) {
      value = past[(memory.newest - whole + depth) % depth][i];
      const far = past[(memory.newest - whole - 1 + depth) % depth][i];
      if (i < 4) value += (back - whole) * (far - value);
    }
    if (p.sensor_noise[i] > 0) value += p.sensor_noise[i] * draws[i];
    const step = p.sensor_step[i];
    reading[i] = step > 0 ? Math.round(value / step) * step : value;
  }
}
