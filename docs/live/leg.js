// A leg that hops under a controller which believes it to be as its file has it: a port of
// `LiveLeg` in `src/hopping_leg/viewer/live_leg.py`, with its hops.

import { DATA, PERIOD } from "live/data.js";
import { Plant, RANDOM } from "live/plant.js";

const FLIGHT_CLEARANCE = DATA.flight_clearance; // foot clearance that counts as flight, m
const IMPOSSIBLE = 1e4; // joint speed that no leg reaches, rad/s
const KEPT = Math.round(10 / PERIOD); // rows of the past

export class Leg {
  constructor(controller, robot, settings, command, draws = RANDOM) {
    this.robot = robot;
    this.plant = new Plant(robot, settings, draws);
    this.stand(command, controller);
  }

  // Begin anew, standing.
  stand(command, controller = this.controller) {
    this.plant.leg.stand(this.robot.start);
    this.past = []; // rows of (command, height, hip torque, knee torque, apex or NaN)
    this.command = command;
    this.deepest = 0; // that the foot sank in, m
    this.setController(controller);
  }

  // Go on with another controller, or the same one anew, in the present state.
  setController(controller) {
    this.controller = controller;
    controller.reset();
    this.plant.restart(this.command);
    this.apexes = []; // highest of each flight, m
    this.rose = this.flying = false;
  }

  // Change the settings in the present state; the controller is not told.
  setSettings(settings) {
    this.plant.set(settings);
    this.plant.restart(this.command);
  }

  // Let one control period pass under a commanded height, m, and an upward push, N; return the
  // torques that the controller asked for.
  tick(command, push) {
    const { leg } = this.plant;
    const before = leg.height;
    this.command = command;
    leg.push = push;
    const torque = this.controller.act(this.plant.sense(command));
    const given = this.plant.drive(torque);
    this.past.push([command, before, given[0], given[1], NaN]);
    if (this.past.length > KEPT) this.past.shift();
    if (!(Math.max(Math.abs(leg.state[4]), Math.abs(leg.state[5])) < IMPOSSIBLE)) {
      this.stand(command);
    }
    this.watchHop(before);
    return torque;
  }

  // An apex is a maximum of the height in flight; of several in one flight, the highest counts.
  watchHop(before) {
    const { leg } = this.plant;
    const inFlight = leg.clearance >= FLIGHT_CLEARANCE;
    const rises = leg.rate > 0;
    if (!inFlight) this.flying = false;
    this.deepest = Math.max(this.deepest, -leg.clearance);
    if (inFlight && this.rose && !rises) {
      const apex = Math.max(before, leg.height);
      if (!this.flying) this.apexes.push(apex);
      else this.apexes.push(Math.max(this.apexes.pop(), apex));
      if (this.past.length) this.past.at(-1)[4] = apex;
      this.flying = true;
    }
    this.rose = rises;
  }
}
