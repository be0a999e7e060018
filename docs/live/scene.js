// Draws the legs, the ground, the commanded height and the last apexes on a canvas.

import { footPosition } from "live/kinematics.js";

const BELOW = 0.09; // of the ground that is shown, m: feet sink in
const LABEL = "12px system-ui, sans-serif";

// Return a canvas's context for drawing in CSS pixels, on as many pixels as the screen has.
export function sharpContext(canvas) {
  const { clientWidth: width, clientHeight: height } = canvas;
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

// Return the page's colours of the moment, light or dark.
export function pageColours() {
  const style = getComputedStyle(document.documentElement);
  const names = ["ink", "soft", "line", "ground", "thigh", "shank", "paper"];
  return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

export function line(context, colour, width, ...points) {
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.beginPath();
  points.forEach(([x, y]) => context.lineTo(x, y));
  context.stroke();
}

export function disc(context, colour, [x, y], radius) {
  context.fillStyle = colour;
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fill();
}

// Draw `legs`, each with its controller's colour, under a commanded height up to `top`, m; `push`
// is the force on the bases, N.
export function drawScene(canvas, colours, legs, command, top, push) {
  const { context, width, height } = sharpContext(canvas);
  const scale = height / (top + BELOW);
  const y = (z) => height - scale * (z + BELOW);
  context.lineCap = "round";
  context.font = LABEL;
  context.fillStyle = colours.ground;
  context.fillRect(0, y(0), width, height);
  for (let z = 0; z < top; z += 0.1) {
    line(context, colours.line, 1, [34, y(z)], [width, y(z)]);
    context.fillStyle = colours.soft;
    context.fillText(z.toFixed(1), 8, y(z) + 4);
  }
  context.setLineDash([7, 6]);
  line(context, colours.soft, 2, [34, y(command)], [width, y(command)]);
  context.setLineDash([]);
  legs.forEach(({ leg, colour }, i) => {
    const x = width * (i + 1) / (legs.length + 1);
    line(context, colours.line, 10, [x, 0], [x, y(0)]);
    drawApex(context, leg, colour, x, y, Math.min(0.13 * scale, 0.4 * width / (legs.length + 1)));
    drawLeg(context, colours, leg, colour, x, y, scale);
    if (push) drawPush(context, colours, x, y(leg.plant.leg.height), push, scale);
  });
}

function drawLeg(context, colours, { robot, plant: { leg: { state } } }, colour, x, y, scale) {
  const base = state[0];
  const q = [state[1], state[2]];
  const [footDown, footForward] = footPosition(robot, q);
  const hip = [x, y(base)];
  const knee = [x + scale * robot.thigh.length * Math.sin(q[0]),
    y(base - robot.thigh.length * Math.cos(q[0]))];
  const foot = [x + scale * footForward, y(base - footDown)];
  const box = scale * robot.base.radius;
  context.fillStyle = colours.thigh;
  context.beginPath();
  context.roundRect(x - 1.25 * box, hip[1] - 1.1 * box, 2.5 * box, 2.2 * box, 0.3 * box);
  context.fill();
  line(context, colours.thigh, 0.036 * scale, hip, knee);
  line(context, colours.shank, 0.022 * scale, knee, foot);
  disc(context, colour, hip, box);
  disc(context, colours.paper, hip, 0.3 * box);
  disc(context, colour, knee, scale * robot.knee_cap.radius);
  disc(context, colours.ink, foot, Math.max(scale * robot.foot.radius, 4));
}

function drawApex(context, { apexes }, colour, x, y, half) {
  const apex = apexes.at(-1);
  if (apex === undefined) return;
  line(context, colour, 3, [x - half, y(apex)], [x + half, y(apex)]);
}

function drawPush(context, colours, x, hip, push, scale) {
  const from = hip + Math.sign(push) * 0.16 * scale;
  const to = hip + Math.sign(push) * 0.07 * scale;
  const wing = Math.sign(push) * 0.02 * scale;
  line(context, colours.ink, 4, [x, from], [x, to]);
  const half = 0.02 * scale;
  line(context, colours.ink, 4, [x - half, to + wing], [x, to], [x + half, to + wing]);
}
