// A reader of ONNX files and their evaluation for one leg: the operators that policies are made of
// (`src/hopping_leg/rl/onnx_export.py`). Tensors are flat, as the only batch has one row.

import { PageError, clamp } from "live/data.js";

const decoder = new TextDecoder();
const FLOAT = 1;
const INT64 = 7;

// Yield [number, value] of a protocol buffer's fields: numbers, or bytes.
function* fields(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  let at = 0;
  const varint = () => {
    let value = 0;
    let scale = 1;
    for (;;) {
      const byte = view.getUint8(at++);
      value += (byte & 127) * scale;
      if (byte < 128) return value;
      scale *= 128;
    }
  };
  while (at < bytes.length) {
    const key = varint();
    const kind = key & 7;
    if (kind === 0) yield [key >> 3, varint()];
    else if (kind === 2) {
      const length = varint();
      if (at + length > bytes.length) throw new RangeError("truncated");
      yield [key >> 3, bytes.subarray(at, at + length)];
      at += length;
    } else if (kind === 5 || kind === 1) at += kind === 5 ? 4 : 8;
    else throw new RangeError("no protocol buffer");
  }
}

// Return the values of a message's fields by number.
function message(bytes) {
  const found = {};
  for (const [number, value] of fields(bytes)) (found[number] ??= []).push(value);
  return found;
}

const texts = (values = []) => values.map((bytes) => decoder.decode(bytes));

// TensorProto: name, and values of its raw data.
function readTensor(bytes) {
  const found = message(bytes);
  const [name] = texts(found[8]);
  const [type] = found[2];
  if (!found[9] || (type !== FLOAT && type !== INT64)) {
    throw new PageError(`Its tensor '${name}' is not stored as plain single-precision numbers.`);
  }
  const raw = found[9][0].slice().buffer;
  return [name, type === FLOAT ? new Float32Array(raw) : Array.from(new BigInt64Array(raw), Number)];
}

function readNode(bytes) {
  const found = message(bytes);
  const [operator] = texts(found[4]);
  if (!Object.hasOwn(OPERATORS, operator)) {
    throw new PageError(`Its operator ${operator} is none of those that this page evaluates: ${
      Object.keys(OPERATORS).join(", ")}.`);
  }
  const attributes = Object.fromEntries((found[5] ?? []).map(readAttribute));
  return { operator, attributes, inputs: texts(found[1]), outputs: texts(found[2]) };
}

// AttributeProto: name, and a tensor or a whole number.
function readAttribute(bytes) {
  const { 1: name, 3: number, 5: tensor } = message(bytes);
  return [texts(name)[0], tensor ? readTensor(tensor[0])[1] : number?.[0]];
}

// ValueInfoProto: name, and how many values a row has.
function readSize(bytes) {
  const [name, type] = [1, 2].map((field) => message(bytes)[field][0]);
  const shape = message(message(message(type)[1][0])[2][0]);
  const sizes = (shape[1] ?? []).map((dimension) => message(dimension)[1]?.[0] ?? 1);
  return [decoder.decode(name), sizes.reduce((all, size) => all * size, 1)];
}

// Return the graph in an ONNX file's bytes; throws a RangeError if they are none.
export function readOnnx(bytes) {
  const model = message(bytes);
  if (!model[7]) throw new RangeError("no graph");
  const graph = message(model[7][0]);
  const names = (values = []) => values.map((value) => texts(message(value)[1])[0]);
  const metadata = (model[14] ?? []).map((entry) => {
    const found = message(entry);
    return [...texts(found[1]), ...texts(found[2])];
  });
  return {
    nodes: (graph[1] ?? []).map(readNode),
    weights: new Map((graph[5] ?? []).map(readTensor)),
    sizes: Object.fromEntries((graph[11] ?? []).map(readSize)),
    outputs: names(graph[12]),
    metadata: Object.fromEntries(metadata),
  };
}

// Return the outputs of a graph for inputs, both by name.
export function runOnnx({ nodes, weights, outputs }, inputs) {
  const values = new Map(weights);
  for (const [name, value] of Object.entries(inputs)) values.set(name, value);
  for (const node of nodes) {
    const given = node.inputs.map((name) => values.get(name));
    const results = OPERATORS[node.operator].apply(node.attributes, given);
    node.outputs.forEach((name, i) => values.set(name, results[i]));
  }
  return Object.fromEntries(outputs.map((name) => [name, values.get(name)]));
}

// An operator on every pair of values; one side may be a single one, or the first a column.
const paired = (apply) => (a, b) => {
  if (!a.column && a.length !== b.length && a.length !== 1 && b.length !== 1) {
    throw new PageError("It has tensors of more axes than this page evaluates.");
  }
  const result = new Float32Array(a.column ? a.length * b.length : Math.max(a.length, b.length));
  const row = (i) => (a.column ? Math.floor(i / b.length) : i % a.length);
  return [result.map((_, i) => apply(a[row(i)], b[i % b.length]))];
};

// Parts of the last axis; sizes are integers.
function split(a, sizes) {
  let at = 0;
  return [...sizes].map((size) => a.slice(at, at += size));
}

const each = (apply) => (a) => [a.map(apply)];
const same = (a) => [a];
const sigmoid = (x) => 1 / (1 + Math.exp(-x));

// x W + b for W (in, out), or (out, in) if transposed, in doubles; of rows, where W is a column.
function gemm(x, weight, bias, transposed) {
  const rows = x.length / weight.length;
  const parts = () => split(x, Array(rows).fill(weight.length));
  if (rows > 1) return [Float32Array.from(parts(), (part) => gemm(part, weight)[0][0])];
  const count = weight.length / x.length;
  const [row, column] = transposed ? [1, x.length] : [count, 1];
  const sums = bias ? Float64Array.from(bias) : new Float64Array(count);
  for (let j = 0; j < x.length; j++) {
    for (let i = 0; i < count; i++) sums[i] += x[j] * weight[j * row + i * column];
  }
  return [Float32Array.from(sums)];
}

// A gated recurrent unit as torch has it; ONNX orders its gates update, reset, candidate.
function gru(x, ofInput, ofMemory, bias, _lengths, memory) {
  const size = memory.length;
  const dot = (weight, row, y) => {
    let sum = 0;
    for (let j = 0; j < y.length; j++) sum += weight[row * y.length + j] * y[j];
    return sum;
  };
  const next = new Float32Array(size);
  for (let i = 0; i < size; i++) {
    const gate = (row) => sigmoid(dot(ofInput, row, x) + dot(ofMemory, row, memory) + bias[row]
      + bias[3 * size + row]);
    const update = gate(i);
    const remembered = dot(ofMemory, 2 * size + i, memory) + bias[5 * size + i];
    const candidate = Math.tanh(dot(ofInput, 2 * size + i, x) + bias[2 * size + i]
      + gate(size + i) * remembered);
    next[i] = (1 - update) * candidate + update * memory[i];
  }
  return [next, next];
}

const OPERATORS = {
  Add: paired((a, b) => a + b),
  Clip: (a, [least], [most]) => [a.map((x) => clamp(x, least, most))],
  Constant() { return [this.value]; },
  Concat: (...parts) => [Float32Array.from(parts.flatMap((part) => [...part]))],
  Elu: each((x) => (x > 0 ? x : Math.expm1(x))),
  Flatten: same,
  GRU: gru,
  Gather(a, at) { return [Math.abs(this.axis) === 1 ? Float32Array.from(at, (i) => a[i]) : a]; },
  Gemm(x, weight, bias) { return gemm(x, weight, bias, this.transB); },
  MatMul: (x, weight) => gemm(x, weight),
  Mul: paired((a, b) => a * b),
  Relu: each((x) => Math.max(x, 0)),
  Split: split,
  Squeeze: same,
  Sub: paired((a, b) => a - b),
  Tanh: each(Math.tanh),
  Unsqueeze: (a) => [Object.assign(a.slice(), { column: true })],
};
