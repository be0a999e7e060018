// A robot in numbers without units: a port of `src/hopping_leg/controllers/robot_numbers.py`.

import { DATA, JOINTS, clamp } from "live/data.js";

export const legLength = ({ thigh, shank }) => thigh.length + shank.length;
const massOf = ({ base, thigh, shank }) => base.mass + thigh.mass + shank.mass;

// Unit of time sqrt(L / g), s.
export const fallTime = (robot) => Math.sqrt(legLength(robot) / DATA.gravity);

// Joint torques of a full action, N m.
export function fullTorque(robot) {
  const moment = massOf(robot) * DATA.gravity * legLength(robot);
  return DATA.any_leg.full_torque.map((share) => share * moment);
}

// What a policy for any leg is told of a robot.
export function robotNumbers(robot) {
  const { base, thigh, shank, foot, rail, contact } = robot;
  const { least, most, scales, usual } = DATA.any_leg;
  const length = legLength(robot);
  const mass = massOf(robot);
  const time = fallTime(robot);
  const weight = mass * DATA.gravity;
  const moment = weight * length;
  const inertia = (value) => Math.log(Math.max(value / (mass * length ** 2), least));
  const ofJoint = ({ friction, damping, armature, motor, belt_ratio: ratio, torque_gain: gain }) => [
    Math.sqrt(friction / moment),
    Math.sqrt(damping / (moment * time)),
    inertia(armature),
    Math.log(motor.torque_limit * ratio / moment),
    Math.log(motor.peak_torque * ratio / moment),
    Math.log(motor.no_load_speed / ratio * time),
    Math.log(gain),
  ];
  const values = [
    Math.log(length / usual.length),
    Math.log(thigh.length / shank.length),
    Math.log(mass / usual.mass),
    ...[base, thigh, shank].map((part) => Math.log(part.mass / mass)),
    thigh.com / thigh.length,
    shank.com / shank.length,
    inertia(thigh.inertia),
    inertia(shank.inertia),
    foot.radius / length,
    rail.friction / weight,
    rail.damping * time / mass,
    Math.log(contact.time_constant / usual.time_constant),
    contact.damping_ratio,
    ...JOINTS.flatMap((joint) => ofJoint(robot[joint])),
  ];
  return values.map((value, i) => clamp((value - scales[i][0]) / scales[i][1], -most, most));
}
