// A trained policy: a port of `src/hopping_leg/controllers/policy.py`.

import { DATA, PageError } from "live/data.js";
import { makeHistory } from "live/history.js";
import { readOnnx, runOnnx } from "live/onnx.js";
import { legLength } from "live/robot.js";

export class Policy {
  // Read an ONNX file's bytes; messages name it. It is told the robot's numbers if it asks for them.
  constructor(bytes, name, robot) {
    this.name = name;
    this.robot = robot;
    try {
      this.graph = readOnnx(bytes);
    } catch (error) {
      const why = error instanceof PageError ? error.message
        : "It is truncated, damaged or of another kind.";
      throw new PageError(`${name} cannot be read as a policy. ${why}`);
    }
    const text = this.graph.metadata.hopping_leg;
    if (!text) {
      throw new PageError(`${name} is an ONNX file but not a policy; make one with hop train.`);
    }
    try {
      this.card = JSON.parse(text);
    } catch {
      throw new PageError(`${name} has a damaged policy card; export the policy again.`);
    }
    const { layout, rate } = this.card;
    if (!makeHistory(layout, robot)) {
      throw new PageError(`${name} has the observation layout '${layout}'; this page knows: ${
        ["three-samples", ...Object.keys(DATA.layouts)].join(", ")}.`);
    }
    if (rate !== DATA.rate) {
      throw new PageError(`${name} was trained at ${rate} Hz; this page runs at ${DATA.rate} Hz.`);
    }
    this.forAnyLeg = layout === DATA.any_leg.layout;
    this.memorySize = this.graph.sizes.memory ?? 0;
    this.reset();
    this.act({ back: [0, 1, 2], samples: Array(3).fill([0, 0, 0, 0, this.range[0]]) });
  }

  // Heights that it can be asked for, m.
  get range() {
    const { card: { command_low: low, command_high: high }, robot } = this;
    const size = this.forAnyLeg
      ? (legLength(robot) + robot.foot.radius) / DATA.any_leg.straight_height : 1;
    return [size * low, size * high];
  }

  // A sentence if a robot is not that of its training, or "".
  stranger(robot) {
    const { card, name } = this;
    return this.forAnyLeg || card.robot === robot.name ? ""
      : `${name} was trained on ${card.robot}, not on ${robot.name}.`;
  }

  reset() {
    this.history = makeHistory(this.card.layout, this.robot);
    this.torque = [0, 0];
    this.memory = new Float32Array(this.memorySize);
  }

  // Return joint torques, N m.
  act(measurement) {
    this.history.update(measurement, this.torque);
    const inputs = this.history.inputs();
    if (this.memorySize) inputs.memory = this.memory;
    const outputs = runOnnx(this.graph, inputs);
    if (outputs.next_memory) this.memory = outputs.next_memory;
    this.torque = [...outputs.torque];
    return this.torque;
  }
}
