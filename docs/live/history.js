// What controllers remember of their measurements: ports of `sample_history.py` and
// `observation_history.py` in `src/hopping_leg/controllers`, for one leg. A sample is
// (q1, q2, qd1, qd2), rad and rad/s; histories are newest first.

import { DATA, PERIOD } from "live/data.js";
import { legLength } from "live/robot.js";

const WINDOW = 11; // ticks in which a late sample may still reach a `DatedObserver`

// Joint samples by tick; a measurement's ages tell their places.
class SampleHistory {
  constructor(length) {
    this.samples = Array.from({ length }, () => [0, 0, 0, 0]);
    this.known = Array(length).fill(false);
  }

  // Take a sample for the whole past.
  fill(sample) {
    this.samples = this.samples.map(() => sample.slice(0, 4));
    this.known.fill(true);
  }

  // Begin a tick, of which nothing is known yet.
  shift() {
    this.samples.unshift(this.samples[0].slice());
    this.samples.pop();
    this.known.unshift(false);
    this.known.pop();
  }

  // Put a tick's samples in their places.
  insert({ back, samples }) {
    back.forEach((ticks, k) => {
      if (ticks >= this.known.length) return;
      this.known[ticks] = true;
      this.samples[ticks] = samples[k].slice(0, 4);
    });
  }

  // Give unknown ticks among the newest ones the last sample known before them.
  hold(window) {
    for (let i = Math.min(window, this.known.length - 1) - 1; i >= 0; i--) {
      if (!this.known[i]) this.samples[i] = this.samples[i + 1].slice();
    }
  }
}

// The paper's observation: position, velocity and command at three ticks.
class ThreeSamples {
  update(measurement) { this.samples = measurement.samples; }

  inputs() {
    return {
      q: Float32Array.from(this.samples.flatMap((s) => s.slice(0, 2))),
      qd: Float32Array.from(this.samples.flatMap((s) => s.slice(2, 4))),
      command: Float32Array.from(this.samples, (s) => s[4]),
    };
  }
}

// Samples at fixed times before now, however late they came, and the policy's own torques.
class Dated {
  constructor({ lags, torque_lags: torqueLags }) {
    this.lags = lags;
    this.torqueLags = torqueLags;
  }

  update(measurement, lastTorque) {
    const [newest] = measurement.samples;
    if (this.track) {
      this.track.shift();
      this.torques.unshift([...lastTorque]);
      this.torques.pop();
    } else {
      const length = Math.max(...this.lags, DATA.delay_depth) + 1;
      this.track = new SampleHistory(length);
      this.track.fill(newest);
      this.torques = Array.from({ length: Math.max(...this.torqueLags) + 1 }, () => [0, 0]);
    }
    this.track.insert(measurement);
    this.track.hold(DATA.delay_depth);
    this.command = newest[4];
  }

  inputs() {
    const chosen = this.lags.map((lag) => this.track.samples[lag]);
    const age = Math.max(this.track.known.slice(0, DATA.delay_depth).indexOf(true), 0);
    return {
      q: Float32Array.from(chosen.flatMap((s) => s.slice(0, 2))),
      qd: Float32Array.from(chosen.flatMap((s) => s.slice(2, 4))),
      age: Float32Array.of(age * PERIOD),
      past_torque: Float32Array.from(this.torqueLags.flatMap((lag) => this.torques[lag])),
      command: Float32Array.of(this.command),
    };
  }
}

// The dated layout in the leg's own units, and what its robot file says of it.
class AnyLeg extends Dated {
  constructor(lags, robot) {
    super(lags);
    this.robot = robot;
    this.numbers = Float32Array.from(robot.numbers);
    this.fullTorque = Float32Array.from(robot.full_torque);
  }

  inputs() {
    const { q, qd, age, past_torque: torques, command: [height] } = super.inputs();
    const { late, middle, command_gain: gain } = DATA.any_leg;
    const { full_torque: full, fall_time: time } = this.robot;
    const feet = this.track ? this.lags.map((lag) => this.footMotion(this.track.samples[lag])) : [];
    const above = (height - this.robot.foot.radius) / legLength(this.robot);
    return {
      foot: Float32Array.from(feet.flatMap((foot) => foot.slice(0, 2))),
      foot_velocity: Float32Array.from(feet.flatMap((foot) => foot.slice(2))),
      q,
      qd: qd.map((speed) => speed * time),
      age: age.map((seconds) => seconds / late),
      past_torque: torques.map((torque, i) => torque / full[i % 2]),
      command: Float32Array.of((above - middle) * gain),
      robot: this.numbers,
      full_torque: this.fullTorque,
    };
  }

  // Where the foot is below and in front of the hip, and its velocity.
  footMotion([q1, q2, qd1, qd2]) {
    const { foot_middle: middle, foot_gain: gain, velocity_gain: ofVelocity } = DATA.any_leg;
    const share = this.robot.thigh.length / legLength(this.robot);
    const [s1, c1] = [share * Math.sin(q1), share * Math.cos(q1)];
    const [s2, c2] = [(1 - share) * Math.sin(q1 + q2), (1 - share) * Math.cos(q1 + q2)];
    const scale = ofVelocity * this.robot.fall_time;
    return [
      gain * (c1 + c2 - middle[0]),
      gain * (s1 + s2 - middle[1]),
      -scale * (qd1 * s1 + (qd1 + qd2) * s2),
      scale * (qd1 * c1 + (qd1 + qd2) * c2),
    ];
  }
}

// Return what makes the inputs of a policy's layout on a robot, undefined if it is unknown.
export function makeHistory(layout, robot) {
  if (layout === "three-samples") return new ThreeSamples();
  if (!Object.hasOwn(DATA.layouts, layout)) return undefined;
  const lags = DATA.layouts[layout];
  return layout === DATA.any_leg.layout ? new AnyLeg(lags, robot) : new Dated(lags);
}

// Fills a dated history with the samples as they arrive and filters it afresh each tick: positions
// are integrated from velocities and pulled towards the measured ones by a constant gain.
export class DatedObserver {
  constructor(gain) { this.gain = gain; }

  // Return [q, qd] now, rad and rad/s.
  update(measurement) {
    let anchor = measurement.samples[0].slice(0, 2);
    if (this.track) {
      anchor = this.past.at(-2);
      this.track.shift();
    } else this.track = new SampleHistory(WINDOW);
    this.track.insert(measurement);
    const velocity = this.fill();
    this.track.samples.forEach((sample, i) => sample.splice(2, 2, ...velocity[i]));
    this.past = this.integrate(velocity, anchor);
    return [this.past[0], velocity[0]];
  }

  // Velocities of the window with the gaps filled: between known ones linearly, else held.
  fill() {
    const { known, samples } = this.track;
    const filled = samples.map((sample) => sample.slice(2, 4));
    const ahead = [];
    let newer = filled[0];
    let gap = Infinity;
    for (let i = 0; i < WINDOW; i++) {
      if (known[i]) newer = filled[i];
      gap = known[i] ? 0 : gap + 1;
      ahead.push({ value: newer, gap });
    }
    for (let i = WINDOW - 2; i >= 0; i--) {
      if (known[i]) continue;
      const share = 1 / (1 + ahead[i].gap);
      filled[i] = filled[i + 1].map((v, joint) => v + share * (ahead[i].value[joint] - v));
    }
    return filled;
  }

  // Filtered positions of the window.
  integrate(velocity, anchor) {
    const past = [anchor];
    for (let i = WINDOW - 2; i >= 0; i--) {
      const weight = this.track.known[i] ? this.gain : 0;
      past.unshift(past[0].map((angle, joint) => {
        const moved = angle + 0.5 * PERIOD * (velocity[i + 1][joint] + velocity[i][joint]);
        return moved + weight * (this.track.samples[i][joint] - moved);
      }));
    }
    return past;
  }
}
