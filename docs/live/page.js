// The page: what a visitor sets, and the loop that lets time pass.

import { DATA, JOINTS, PERIOD, PageError, clamp } from "live/data.js";
import { Leg } from "live/leg.js";
import { drawPlots } from "live/plots.js";
import { Policy } from "live/policy.js";
import { groundOf, shippedRobot } from "live/robot.js";
import { drawScene, pageColours } from "live/scene.js";
import { EnergyShaping } from "live/shaping.js";

const NONE = "none";
const HEADROOM = 0.11; // above the highest command, m: half a base and a little, of a leg like V2
const LATEST = 0.1; // most simulated time of a picture, s: what is missed beyond is given up
const KEY_STEP = 0.01; // of the height, m
const SLOW = 0.2;
const PLOT_EVERY = 3; // pictures

const $ = (id) => document.getElementById(id);

const policies = new Map(); // bytes of the policies that were loaded or opened, by name
let legs = []; // {leg, colour, card} each
let command = 0.3;
let pushTicks = 0;
let force = 0;
let choice = 0;
let playing = true;
let behind = 0; // simulated time that is due, s
let top = 0.5;

function say(text, bad = false) {
  $("status").textContent = text;
  $("status").classList.toggle("bad", bad);
}

function colourOf(name) {
  return DATA.colours[name] ?? DATA.other_colour;
}

async function policyBytes(name) {
  if (!policies.has(name)) {
    const answer = await fetch(DATA.policies[name]);
    if (!answer.ok) throw new PageError(`The policy ${name} is not beside the page.`);
    policies.set(name, new Uint8Array(await answer.arrayBuffer()));
  }
  return policies.get(name);
}

async function makeController(name, robot) {
  if (name === "energy-shaping") return new EnergyShaping(name, robot);
  return new Policy(await policyBytes(name), name, robot);
}

const settings = () => ({
  payload: Number($("payload").value),
  ground: 10 ** Number($("ground").value),
  delay: Number($("delay").value) / 1000,
  noise: $("noise").checked,
});

// Let the chosen controllers begin on the chosen robot; the former legs hop on until all are there.
async function begin() {
  const robot = shippedRobot($("robot").value);
  const names = ["first", "second"].map((id) => $(id).value).filter((name) => name !== NONE);
  const own = ++choice;
  const controllers = await Promise.all(names.map((name) => makeController(name, robot)));
  if (own !== choice) return; // something else was chosen meanwhile
  setRange(controllers, robot);
  const sentences = controllers.map((one) => one.stranger(robot)).filter(Boolean);
  say(sentences.join(" "));
  legs = controllers.map((controller) => {
    const colour = colourOf(controller.name);
    return { leg: new Leg(controller, robot, settings(), command), colour, card: null };
  });
  showCards();
}

// Bring the height into what all controllers can be asked for.
function setRange(controllers, robot) {
  const low = Math.max(...controllers.map((one) => one.range[0]));
  const high = Math.min(...controllers.map((one) => one.range[1]));
  const names = controllers.map((one) => one.name).join(" and ");
  if (!(low < high)) throw new PageError(`${names} share no height; show them in turn.`);
  $("height").min = Math.ceil(low * 200) / 200;
  $("height").max = Math.floor(high * 200) / 200;
  top = high + HEADROOM * Math.max(robot.base.radius / 0.05, 1);
  setHeight(command);
}

function setHeight(height) {
  const { min, max } = $("height");
  command = clamp(height, Number(min), Number(max));
  $("height").value = command;
  $("height-value").textContent = `${command.toFixed(3)} m`;
}

function showSettings() {
  const { payload, ground, delay } = settings();
  $("payload-value").textContent = `${payload.toFixed(2)} kg`;
  $("ground-value").textContent = `${(1000 * ground).toFixed(0)} ms`;
  $("delay-value").textContent = `${(1000 * delay).toFixed(0)} ms`;
}

// Set the ground to what the robot's file says.
function ownGround() {
  const [low, high] = DATA.ranges.ground;
  const own = clamp(groundOf(shippedRobot($("robot").value)), low, high);
  $("ground").value = Math.log10(own);
}

function showCards() {
  $("cards").replaceChildren(...legs.map((entry) => {
    const card = $("card").content.cloneNode(true).firstElementChild;
    card.style.setProperty("--colour", entry.colour);
    card.querySelector(".name").textContent = entry.leg.controller.name;
    entry.card = card.querySelector("dl");
    return card;
  }));
}

function millimetres(metres) {
  const whole = Math.round(1000 * metres);
  return `${whole < 0 ? "\u2212" : "+"}${Math.abs(whole)} mm`;
}

function updateCards() {
  for (const { leg: { apexes, deepest }, card } of legs) {
    const [apex, hops, sinks] = card.querySelectorAll("dd");
    const last = apexes.at(-1);
    apex.textContent = last === undefined ? "\u2013"
      : `${last.toFixed(3)} m (${millimetres(last - command)})`;
    hops.textContent = apexes.length;
    sinks.textContent = `${(1000 * deepest).toFixed(0)} mm`;
  }
}

function tick() {
  const push = pushTicks > 0 ? force : 0;
  pushTicks = Math.max(pushTicks - 1, 0);
  for (const { leg } of legs) leg.tick(command, push);
}

function push(sign) {
  force = sign * Number($("force").value);
  pushTicks = Math.round(DATA.push_seconds / PERIOD);
}

function play(on) {
  playing = on;
  $("play").textContent = on ? "Pause" : "Go on";
}

let colours = pageColours();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  colours = pageColours();
});

let before;
let pictures = 0;

function picture(now) {
  requestAnimationFrame(picture);
  const passed = (now - (before ?? now)) / 1000;
  before = now;
  if (playing && legs.length) {
    behind = Math.min(behind + passed * ($("slow").checked ? SLOW : 1), LATEST);
    for (; behind >= PERIOD; behind -= PERIOD) tick();
  }
  pictures += 1;
  draw();
}

function draw() {
  if (!legs.length) return;
  if (!performance.getEntriesByName("first hop").length && legs[0].leg.apexes.length) {
    performance.mark("first hop");
  }
  drawScene($("scene"), colours, legs, command, top, pushTicks > 0 ? force : 0);
  if (pictures % PLOT_EVERY) return;
  updateCards();
  const { robot } = legs[0].leg;
  const limits = JOINTS.map((joint) => robot[joint].motor.torque_limit * robot[joint].belt_ratio);
  drawPlots($("plots"), colours, legs, top, limits);
}

// Do something that may be refused with a sentence.
async function attempt(work) {
  try {
    await work();
  } catch (error) {
    if (!(error instanceof PageError)) throw error;
    say(error.message, true);
  }
}

async function open(file) {
  const { name } = file; // with its ending, so that no shipped policy has it
  if (!name.endsWith(".onnx")) throw new PageError(`${name} is no policy (.onnx).`);
  const bytes = new Uint8Array(await file.arrayBuffer());
  void new Policy(bytes, name, shippedRobot($("robot").value)); // refused before it is listed
  policies.set(name, bytes);
  for (const list of [$("first"), $("second")]) {
    if (![...list.options].some((option) => option.value === name)) list.add(new Option(name, name));
  }
  $("first").value = name;
  await begin();
}

const KEYS = {
  k: () => setHeight(command + KEY_STEP),
  j: () => setHeight(command - KEY_STEP),
  p: () => push(1),
  o: () => push(-1),
  s: () => { play(false); tick(); },
  r: () => begin(),
  " ": () => play(!playing),
};
KEYS.ArrowUp = KEYS.k;
KEYS.ArrowDown = KEYS.j;

function connect() {
  for (const name of DATA.controllers) {
    $("first").add(new Option(name, name));
    $("second").add(new Option(name, name));
  }
  $("second").add(new Option("nothing", NONE), 0);
  for (const name of Object.keys(DATA.robots)) $("robot").add(new Option(name, name));
  for (const [id, [low, high], scale] of [
    ["payload", DATA.ranges.payload, 1], ["delay", DATA.ranges.delay, 1000],
    ["ground", DATA.ranges.ground.map(Math.log10), 1],
  ]) [$(id).min, $(id).max] = [low * scale, high * scale];
  $("robot").value = DATA.robot;
  [$("first").value, $("second").value] = DATA.controllers;
  for (const id of ["payload", "delay"]) $(id).value = 0;
  ownGround();

  $("height").addEventListener("input", () => setHeight(Number($("height").value)));
  for (const id of ["payload", "ground", "delay", "noise"]) {
    $(id).addEventListener("input", () => {
      showSettings();
      for (const { leg } of legs) leg.setSettings(settings());
    });
  }
  for (const id of ["first", "second"]) $(id).addEventListener("change", () => attempt(begin));
  $("robot").addEventListener("change", () => {
    ownGround();
    showSettings();
    attempt(begin);
  });
  $("up").addEventListener("click", () => push(1));
  $("down").addEventListener("click", () => push(-1));
  $("play").addEventListener("click", () => play(!playing));
  $("restart").addEventListener("click", () => attempt(begin));
  $("file").addEventListener("change", () => {
    for (const file of $("file").files) attempt(() => open(file));
    $("file").value = "";
  });
  addEventListener("dragover", (event) => event.preventDefault());
  addEventListener("drop", (event) => {
    event.preventDefault();
    for (const file of event.dataTransfer.files) attempt(() => open(file));
  });
  addEventListener("keydown", (event) => {
    const used = event.ctrlKey || event.metaKey || event.altKey
      || event.target.closest("input, select, button, a");
    const act = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (used || !act) return;
    event.preventDefault();
    attempt(act);
  });
}

connect();
showSettings();
play(true);
requestAnimationFrame(picture);
attempt(begin);
