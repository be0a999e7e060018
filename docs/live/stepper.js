// The stepper: `src/hopping_leg/sim/stepper.py` itself, compiled to WebAssembly by `docs/wasm.py`.

import { DATA } from "live/data.js";

const { code, row: ROW, memory: MEMORY, command, rows } = DATA.stepper; // {field: [first, count]}
const bytes = Uint8Array.from(atob(code), (character) => character.charCodeAt(0));
const module = await WebAssembly.compile(bytes);
const PAGE = 65536; // bytes
const BYTES = 8; // of a number
const BEGIN = 2; // numbers before the leg's own: where the functions return to

const sizeOf = (fields) => Math.max(...Object.values(fields).map(([first, count]) => first + count));

export class Stepper {
  // The numbers of one leg, with a ring of `depth` rows of what its sensors saw.
  constructor(depth) {
    this.depth = depth;
    const sizes = {
      row: sizeOf(ROW), memory: sizeOf(MEMORY), state: 6, command, draws: 6, reading: 6,
      rows, past: 6 * depth,
    };
    const all = BEGIN + Object.values(sizes).reduce((sum, size) => sum + size);
    const memory = new WebAssembly.Memory({ initial: Math.ceil(BYTES * all / PAGE) });
    const imports = { env: { __linear_memory: memory } };
    this.compiled = new WebAssembly.Instance(module, imports).exports;
    let next = BEGIN;
    for (const [name, size] of Object.entries(sizes)) {
      this[name] = new Float64Array(memory.buffer, BYTES * next, size);
      next += size;
    }
    this.rotor = this.field("rotor");
    this.meanTorque = this.field("mean_torque");
  }

  // A field of what the leg remembers.
  field(name) {
    const [first, count] = MEMORY[name];
    return this.memory.subarray(first, first + count);
  }

  // Send torques that arrive so many seconds from now and let physics steps of `dt` seconds pass
  // under an upward force on the base, N.
  step(torque, arrival, push, steps, dt) {
    this.command[0] = torque[0];
    this.command[1] = torque[1];
    const at = (view) => view.byteOffset;
    check(this.compiled.step(0, BYTES, at(this.row), at(this.memory), at(this.state),
      at(this.past), this.depth, at(this.command), arrival, at(this.rows), push, steps, dt));
  }

  // Set `reading`: position, velocity and torque of hip and knee as the sensors report them;
  // `draws` are six standard normal numbers.
  read(draws, dt) {
    this.draws.set(draws);
    const at = (view) => view.byteOffset;
    check(this.compiled.read(0, BYTES, at(this.row), at(this.memory), at(this.past), this.depth,
      at(this.draws), at(this.reading), dt));
  }
}

function check(status) {
  if (status) throw new Error(`The stepper failed with status ${status}.`);
}

// A number or a joint's two of a leg's row.
export function ofRow(row, name) {
  const [first, count] = ROW[name];
  return row.subarray(first, first + count);
}
