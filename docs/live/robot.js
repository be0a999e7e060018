// Robots: the shipped ones, as the package read them.

import { DATA } from "live/data.js";
import { ofRow } from "live/stepper.js";

export const shippedRobot = (name) => DATA.robots[name];

export const legLength = ({ thigh, shank }) => thigh.length + shank.length;

// Time constant of a robot's ground, s.
export const groundOf = ({ contact, reality }) => (
  reality.ground?.time_constant ?? contact.time_constant
);

// Return the row that the stepper reads of a robot with a visitor's settings: payload, kg,
// ground's time constant, s, delay, s. They scale what `leg_table.py` computes of them.
export function changedRow(robot, { payload, ground, delay }) {
  const row = Float64Array.from(robot.row);
  const of = (name) => ofRow(row, name);
  const before = of("mass")[0];
  const mass = before + payload * robot.reality.mass.base;
  const light = (1 / mass - 1 / before) / 3;
  of("mass")[0] = mass;
  of("weight")[0] += of("gravity")[0] * (mass - before);
  of("base_softness")[0] += light;
  of("shank_softness")[0] += light;
  of("rail_friction_stiffness")[0] *= mass / before;
  const slower = groundOf(robot) / ground;
  of("contact_stiffness")[0] *= slower ** 2;
  of("contact_damping")[0] *= slower;
  of("command_latency")[0] += delay;
  return row;
}
