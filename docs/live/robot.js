// Robots: the shipped ones, as the package's own reader resolved them, and those of a visitor's
// file. A port of what `src/hopping_leg/robot/robot_files.py` and `robot_checks.py` refuse.

import { DATA, JOINTS, PageError } from "live/data.js";
import { parseToml } from "live/toml.js";

const FORM = (unit) => `{ value = ..., unit = "${unit}", source = "..." }`;
const REFLECTING = ["motor.rotor_inertia", "motor.gear_ratio", "belt_ratio"];

// Return nested tables of numbers by their dotted paths.
function nested(numbers) {
  const tables = {};
  for (const [path, value] of Object.entries(numbers)) {
    const keys = path.split(".");
    let table = tables;
    for (const key of keys.slice(0, -1)) table = table[key] ??= {};
    table[keys.at(-1)] = value;
  }
  return tables;
}

export const shippedRobot = (name) => ({ name, ...nested(DATA.robots[name]) });

// Return the robot of a file's text; messages name `origin`.
export function readRobot(text, origin) {
  const tree = parseToml(text, origin);
  const { name, description: _, kind = "leg", extends: parent, hardware: __, ...tables } = tree;
  if (typeof name !== "string" || !name.trim()) {
    throw new PageError(`${origin}: 'name' is missing; give the robot a name.`);
  }
  if (Object.hasOwn(DATA.robots, name)) {
    throw new PageError(`${origin}: '${name}' is a shipped robot; give this one a name of its own.`);
  }
  if (kind !== "leg") throw new PageError(`${origin}: a ${kind} cannot hop; open a leg's file.`);
  if (parent !== undefined && !Object.hasOwn(DATA.robots, parent)) {
    throw new PageError(`${origin}: 'extends' is '${parent}', which this page cannot read; extend`
      + ` one of: ${Object.keys(DATA.robots).join(", ")}.`);
  }
  const inherited = parent === undefined ? {} : DATA.robots[parent];
  const own = readNumbers(tables, "", origin);
  const numbers = { ...inherited, ...own };
  for (const joint of JOINTS) {
    const changed = REFLECTING.map((path) => `${joint}.${path}`)
      .some((path) => path in own && own[path] !== inherited[path]);
    if (changed && !(`${joint}.armature` in own)) delete numbers[`${joint}.armature`];
  }
  complete(numbers, origin);
  for (const sentence of contradictions(numbers)) throw new PageError(`${origin}: ${sentence}`);
  return { name, ...nested(numbers) };
}

function readNumbers(table, prefix, origin) {
  const numbers = {};
  for (const [key, entry] of Object.entries(table)) {
    const path = prefix + key;
    if (typeof entry === "object" && !("value" in entry)) {
      Object.assign(numbers, readNumbers(entry, `${path}.`, origin));
    } else numbers[path] = readNumber(entry, path, origin);
  }
  return numbers;
}

function readNumber(entry, path, origin) {
  const field = DATA.fields[path];
  if (!field) throw new PageError(`${origin}: '${path}' is no number of a robot; see the page Robot.`);
  const { unit, zero, signed } = field;
  if (typeof entry !== "object" || Object.keys(entry).sort().join() !== "source,unit,value") {
    throw new PageError(`${origin}: '${path}' needs ${FORM(unit)}.`);
  }
  const { value } = entry;
  if (typeof value !== "number" || !Number.isFinite(value)) {
    throw new PageError(`${origin}: '${path}' must be a finite number, not ${value}.`);
  }
  if (entry.unit !== unit) {
    throw new PageError(`${origin}: '${path}' is in '${entry.unit}' but must be in '${unit}'.`);
  }
  if (typeof entry.source !== "string" || !entry.source.trim()) {
    throw new PageError(`${origin}: '${path}' has no source; say where ${value} comes from.`);
  }
  if (!signed && (value < 0 || (value === 0 && !zero))) {
    const least = zero ? "zero or more" : "more than zero";
    throw new PageError(`${origin}: '${path}' is ${value} ${unit} but must be ${least}.`);
  }
  return value;
}

// Fill in what a file may leave out.
function complete(numbers, origin) {
  for (const [path, field] of Object.entries(DATA.fields)) {
    if (path in numbers) continue;
    if (!("default" in field)) {
      throw new PageError(`${origin}: '${path}' is missing; it needs ${FORM(field.unit)}.`);
    }
    if (field.default !== null) numbers[path] = field.default;
  }
  for (const joint of JOINTS) {
    const ratio = numbers[`${joint}.motor.gear_ratio`] * numbers[`${joint}.belt_ratio`];
    numbers[`${joint}.armature`] ??= numbers[`${joint}.motor.rotor_inertia`] * ratio ** 2;
    numbers[`${joint}.stop_lower`] ??= -DATA.stop.reach[joint];
    numbers[`${joint}.stop_upper`] ??= DATA.stop.reach[joint];
  }
}

function* contradictions(n) {
  const above = (low, high, most = n[high]) => (
    n[low] > most && `'${low}' (${n[low]}) must not exceed '${high}' (${most}).`
  );
  const { timestep } = DATA;
  const found = [];
  for (const joint of JOINTS) {
    if (n[`${joint}.lower`] >= n[`${joint}.upper`]) {
      found.push(`'${joint}.lower' must lie below '${joint}.upper'.`);
    }
    found.push(
      above(`${joint}.stop_lower`, `${joint}.lower`), above(`${joint}.upper`, `${joint}.stop_upper`),
      above(`${joint}.motor.torque_limit`, `${joint}.motor.peak_torque`),
      above(`${joint}.motor.rated_torque`, `${joint}.motor.peak_torque`),
    );
    const at = `reality.${joint}`;
    const peak = n[`${joint}.motor.peak_torque`] * n[`${joint}.belt_ratio`];
    found.push(above(`${at}.torque_limit`, `${joint}.motor.peak_torque x belt_ratio`, peak));
    if (n[`${joint}.load_friction`] >= 1) found.push(`'${joint}.load_friction' must be below 1.`);
    if (n[`${at}.efficiency`] > 1) found.push(`'${at}.efficiency' must be at most 1.`);
    if (n[`${at}.stiction`] < 1) found.push(`'${at}.stiction' must be 1 or more.`);
    const stiffness = n[`${at}.stiffness`];
    if (n[`${at}.backlash`] > 0 && stiffness === undefined) {
      found.push(`'${at}' has a backlash but no 'stiffness'; give that of gear and belt beyond it.`);
    }
    const link = joint === "hip" ? "thigh" : "shank";
    const inertia = n[`${link}.inertia`] + n[`${link}.mass`] * n[`${link}.com`] ** 2;
    const most = 1 / (1 / n[`${joint}.armature`] + 1 / inertia) / timestep ** 2;
    if (stiffness > most) {
      found.push(`'${at}.stiffness' is too stiff for a physics step of ${timestep} s; give at most`
        + ` ${most.toPrecision(3)} or leave it out for a rigid one.`);
    }
  }
  for (const link of ["thigh", "shank"]) {
    found.push(above(`${link}.com`, `${link}.extent`,
      Math.max(n[`${link}.length`], n[`${link}.extent`])));
  }
  if (n["knee.lower"] < -Math.PI || n["knee.upper"] > 0) {
    found.push("'knee.lower' and 'knee.upper' must lie between -pi and 0 rad, because a leg's knee"
      + " bends to the negative side.");
  }
  for (const path of ["contact.time_constant", "reality.ground.time_constant"]) {
    if (n[path] < 2 * timestep) found.push(`'${path}' must be at least ${2 * timestep} s.`);
  }
  yield* found.filter(Boolean);
}

// Heights a leg can be asked for, m: folded standing to twice its length.
export function commandLimits({ thigh, shank, foot, hip, knee }) {
  const folded = thigh.length * Math.cos(hip.upper) + shank.length * Math.cos(hip.upper + knee.lower);
  return [folded + foot.radius, 2 * (thigh.length + shank.length + foot.radius)];
}
