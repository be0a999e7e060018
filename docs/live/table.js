// The row of parameters that the stepper reads: a port of `src/hopping_leg/sim/leg_table.py`.

import { DATA, JOINTS } from "live/data.js";

const LEAST_FRICTION = 1e-5; // MuJoCo's mjMINMU

// Stiffness and damping of MuJoCo's `solref`, which no step may outrun.
function spring(time, ratio, timestep, impedance = DATA.stop.impedance) {
  time = Math.max(time, 2 * timestep);
  return [1 / (impedance * time * ratio) ** 2, 2 / (impedance * time)];
}

const either = (value, otherwise) => value ?? otherwise;

// Return the row of a robot for a physics step, s; a `rigid` one has no elastic transmissions.
export function legTable(robot, timestep, rigid = false) {
  const { reality, rail, thigh, shank } = robot;
  const ofJoints = (name) => JOINTS.map((joint) => robot[joint][name]);
  const ofDrives = (name) => JOINTS.map((joint) => reality[joint][name]);
  const ofSensors = (kind) => ["position", "velocity", "torque"].flatMap(
    (sensor) => JOINTS.map((joint) => reality[joint].sensor[`${sensor}_${kind}`]),
  );
  const row = {
    gravity: DATA.gravity,
    elastic: ofDrives("stiffness").map((k) => (rigid || k === undefined ? 0 : 1)),
    rail_damping: rail.damping,
    rail_friction: rail.friction,
    stiction_speed: ofDrives("stiction_speed"),
    belt_damping: ofDrives("stiffness_damping"),
    command_latency: reality.latency.command,
    command_jitter: reality.latency.jitter,
    measurement_latency: reality.latency.measurement,
    sensor_noise: ofSensors("noise"),
    sensor_step: ofSensors("step"),
  };
  for (const name of [
    "damping", "friction", "load_friction", "armature", "stop_lower", "stop_upper",
  ]) row[name] = ofJoints(name);
  row.stiction = row.friction.map((f, i) => f * (ofDrives("stiction")[i] - 1));
  setBodies(row, robot, thigh, shank);
  setGround(row, robot, timestep);
  setDrives(row, robot, timestep);
  setSoftness(row, robot, timestep);
  return row;
}

function setBodies(row, robot, thigh, shank) {
  const scale = robot.reality.mass;
  const thighMass = thigh.mass * scale.thigh;
  const shankMass = shank.mass * scale.shank;
  const rotor = row.armature.map((inertia, i) => (row.elastic[i] ? 0 : inertia));
  row.mass = robot.base.mass * scale.base + thighMass + shankMass;
  row.thigh_moment = thighMass * thigh.com + shankMass * thigh.length;
  row.shank_moment = shankMass * shank.com;
  row.coupling = row.shank_moment * thigh.length;
  row.shank_inertia = shank.inertia * scale.shank + shankMass * shank.com ** 2;
  row.hip_inertia = thigh.inertia * scale.thigh + thighMass * thigh.com ** 2
    + shankMass * thigh.length ** 2 + row.shank_inertia + rotor[0];
  row.knee_inertia = row.shank_inertia + rotor[1];
  row.thigh_length = thigh.length;
  row.shank_length = shank.length;
  row.base_radius = robot.base.radius;
  row.knee_radius = robot.knee_cap.radius;
  row.foot_radius = robot.foot.radius;
}

function setGround(row, robot, timestep) {
  const believed = robot.contact;
  const truth = robot.reality.ground ?? {};
  const time = either(truth.time_constant, believed.time_constant);
  const ratio = either(truth.damping_ratio, believed.damping_ratio);
  row.ground_friction = Math.max(either(truth.friction, believed.friction), LEAST_FRICTION);
  [row.contact_stiffness, row.contact_damping] = spring(time, ratio, timestep);
  [row.stop_stiffness, row.stop_damping] = spring(DATA.stop.time_constant, 1, timestep);
}

// Set limits and losses of both drives, at the joints; a lower voltage moves the whole line.
function setDrives(row, robot, timestep) {
  const { reality } = robot;
  const of = (value) => JOINTS.map((name) => value(robot[name], reality[name]));
  const stall = of((joint) => joint.motor.peak_torque * joint.belt_ratio);
  row.torque_limit = of((joint) => joint.motor.torque_limit * joint.belt_ratio);
  row.stall_torque = stall.map((torque) => torque * reality.voltage);
  row.speed_slope = of((joint) => joint.motor.no_load_speed / joint.belt_ratio)
    .map((speed, i) => stall[i] / speed);
  row.saturation = of((_, drive) => drive.torque_limit).map((limit, i) => either(limit, stall[i]));
  row.gain = of((joint, drive) => joint.torque_gain * drive.torque_gain);
  row.follow = of((_, { torque_lag: lag }) => (lag ? -Math.expm1(-timestep / lag) : 1));
  row.ripple = of((_, drive) => drive.ripple);
  row.ripple_periods = of((_, drive) => drive.ripple_periods);
  row.log_efficiency = of((_, drive) => Math.log(drive.efficiency));
  row.belt_stiffness = of((_, drive) => drive.stiffness ?? 0);
  row.half_backlash = of((_, drive) => drive.backlash / 2);
}

// Set MuJoCo's `invweight0`: inverse inertias of the hanging leg, which scale constraints.
function setSoftness(row, robot, timestep) {
  const hip = row.hip_inertia + 2 * row.coupling;
  const both = row.shank_inertia + row.coupling;
  const knee = row.knee_inertia;
  const determinant = hip * knee - both * both;
  const ofBase = 1 / row.mass;
  const inverse = [knee / determinant, -both / determinant, hip / determinant];
  // Upwards the hanging shank's centre of mass moves with the base, forward with both joints.
  const forward = [robot.thigh.length + robot.shank.com, robot.shank.com];
  const ofShank = forward[0] ** 2 * inverse[0] + 2 * forward[0] * forward[1] * inverse[1]
    + forward[1] ** 2 * inverse[2];
  row.base_softness = ofBase / 3;
  row.shank_softness = (ofBase + ofShank) / 3;
  row.joint_softness = [inverse[0], inverse[2]];
  const { impedance, time_constant: time } = DATA.dry_friction;
  const hold = impedance / (1 - impedance);
  row.friction_stiffness = row.joint_softness.map(
    (soft, i) => hold / (row.elastic[i] ? 1 / Math.max(row.armature[i], 1e-12) : soft),
  );
  row.rail_friction_stiffness = hold / ofBase;
  [, row.friction_damping] = spring(time, 1, timestep, impedance);
}
