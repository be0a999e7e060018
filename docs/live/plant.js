// A leg as a controller meets it: the simulated leg behind sensors, noise, delay and soft limits.
// Ports of `leg_simulator.py`, `channel.py` and `plant.py` in `src/hopping_leg/sim`, for one leg.
// All randomness comes from `draws`: `channel()` returns eight uniform numbers for a tick,
// `jitter()` one, `sensors()` six standard normal ones.

import { DATA, JOINTS, PERIOD, clamp } from "live/data.js";
import { stanceHeight } from "live/kinematics.js";
import { changedRow } from "live/robot.js";
import { Stepper, ofRow } from "live/stepper.js";

const STEPS = Math.round(PERIOD / DATA.timestep);

// Random numbers of the browser.
export const RANDOM = {
  channel: () => Array.from({ length: 8 }, Math.random),
  jitter: Math.random,
  sensors: () => Array.from({ length: 6 }, () => (
    Math.sqrt(-2 * Math.log(1 - Math.random())) * Math.cos(2 * Math.PI * Math.random())
  )),
};

class SimulatedLeg {
  constructor(robot, settings, draws) {
    this.robot = robot;
    this.draws = draws;
    this.push = 0; // upward on the base, N
    this.set(settings);
  }

  // Go on with other settings in the present state; commands stay under way.
  set(settings) {
    this.row = changedRow(this.robot, settings);
    this.stepper?.row.set(this.row);
  }

  // A number, or the two of the joints, of the leg's row.
  of(name) { return ofRow(this.row, name); }

  // Stand at rest at joint angles, rad; the foot touches the ground by a nanometre.
  stand(q) {
    const [late] = this.of("measurement_latency");
    this.noisy = this.of("sensor_noise").some(Boolean);
    this.disturbed = late > 0 || this.noisy || this.of("sensor_step").some(Boolean)
      || this.of("elastic").some(Boolean);
    this.stepper = new Stepper(late > 0 ? 2 + Math.ceil(late / DATA.timestep) : 0);
    const { row, state, rotor, reading, past, depth } = this.stepper;
    row.set(this.row);
    state.set([stanceHeight(this.robot, q) - 1e-9, q[0], q[1], 0, 0, 0]);
    rotor.set([q[0], q[1], 0, 0]);
    for (const seen of [...Array(depth).keys()]) past.set(rotor, 6 * seen);
    reading.set(rotor);
    this.of("sensor_step").forEach((step, i) => {
      if (step > 0) reading[i] = Math.round(reading[i] / step) * step;
    });
  }

  get state() { return this.stepper.state; } // (x, q1, q2) and their rates, m, rad, s

  get height() { return this.state[0]; }

  get rate() { return this.state[3]; }

  // Gap between foot and ground, m; negative when it sinks in.
  get clearance() { return this.height - stanceHeight(this.robot, this.state.subarray(1, 3)); }

  // What the encoders report: (q1, q2, their rates), rad, rad/s.
  get measured() {
    const [, q1, q2, , w1, w2] = this.state;
    return this.disturbed ? this.stepper.reading.subarray(0, 4) : [q1, q2, w1, w2];
  }

  // Command joint torques for a control period; return what the motors gave, N m.
  step(torque) {
    const { stepper } = this;
    const [jitter] = this.of("command_jitter");
    const late = jitter ? this.draws.jitter() * jitter : 0;
    stepper.step(torque, this.of("command_latency")[0] + late, this.push, STEPS, DATA.timestep);
    if (this.disturbed) stepper.read(this.noisy ? this.draws.sensors() : [], DATA.timestep);
    return stepper.meanTorque;
  }
}

// The paper's orders of late samples: three of the last ten ticks, newest first.
const ORDERS = [];
for (let i = 0; i < DATA.noise.delay_buffer; i++) {
  for (let j = i + 1; j < DATA.noise.delay_buffer; j++) {
    for (let k = j + 1; k < DATA.noise.delay_buffer; k++) ORDERS.push([i, j, k]);
  }
}
const IN_TIME = [0, 1, 2];

// Noise on both ways, delay on the way in, as the paper describes them; `quiet` has none.
class Channel {
  constructor(quiet, draws) {
    this.quiet = quiet;
    this.draws = draws;
    this.tick = 0;
  }

  // Forget the past: the buffer fills with the present, noiseless state.
  restart(present, command) {
    this.buffer = Array.from({ length: DATA.noise.delay_buffer }, () => [...present, command]);
  }

  // Return three samples of (q1, q2, qd1, qd2, command), newest first, and how many ticks back.
  sense(measured, command) {
    const depth = this.buffer.length;
    const { joint_noise: noise, delay_probability: chance } = DATA.noise;
    let back = IN_TIME;
    this.buffer[this.tick % depth] = [...measured, command];
    if (!this.quiet) {
      this.drawn = this.draws.channel();
      const newest = this.buffer[this.tick % depth];
      for (let i = 0; i < 4; i++) newest[i] *= 1 + noise * (2 * this.drawn[i] - 1);
      if (this.drawn[4] < chance) back = ORDERS[Math.floor(this.drawn[5] * ORDERS.length)];
    }
    return { back, samples: back.map((k) => this.buffer[(this.tick - k + depth) % depth]) };
  }

  // Return the torques that reach the motors, N m; ends the tick.
  actuate(torque) {
    this.tick += 1;
    if (this.quiet) return torque;
    return torque.map((t, i) => t * (1 + DATA.noise.torque_noise * (2 * this.drawn[6 + i] - 1)));
  }
}

// A leg behind a channel, with the soft joint limits on the newest sample that controllers see.
export class Plant {
  constructor(robot, settings, draws = RANDOM) {
    this.leg = new SimulatedLeg(robot, settings, draws);
    this.draws = draws;
    this.set(settings);
  }

  set(settings) {
    this.leg.set(settings);
    this.channel = new Channel(!settings.noise, this.draws);
  }

  restart(command) {
    const [, q1, q2, , w1, w2] = this.leg.state;
    this.channel.restart([q1, q2, w1, w2], command);
  }

  sense(command) {
    this.seen = this.channel.sense(this.leg.measured, command);
    return this.seen;
  }

  // Apply joint torques for one control period; return what the motors gave, N m.
  drive(torque) {
    const { stiffness, damping } = DATA.soft_limits;
    const asked = JOINTS.map((name, i) => {
      const angle = this.seen.samples[0][i];
      const back = clamp(angle, this.leg.robot[name].lower, this.leg.robot[name].upper) - angle;
      if (back === 0) return torque[i];
      return torque[i] + stiffness * back - damping * this.seen.samples[0][2 + i];
    });
    return this.leg.step(this.channel.actuate(asked));
  }
}
