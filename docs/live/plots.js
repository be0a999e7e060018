// Curves of the last seconds on a canvas: heights with apexes, motors' torques at the joints.

import { PERIOD } from "live/data.js";
import { disc, line, sharpContext } from "live/scene.js";

const SECONDS = 5;
const LEFT = 40;
const RIGHT = 8;
const TITLE = 32;
const TIMES = 20; // px for the time axis

// A panel: title, share of the canvas's height, unit's range of values, and the rows' column.
const panels = (top, limits) => [
  { title: "height / m", share: 0.46, low: 0, high: top, column: 1, step: 0.1 },
  { title: "hip torque / N m", share: 0.27, low: -limits[0], high: limits[0], column: 2 },
  { title: "knee torque / N m", share: 0.27, low: -limits[1], high: limits[1], column: 3 },
];

// Draw the past of `legs`, each with its colour; heights up to `top`, m, torques up to `limits`.
export function drawPlots(canvas, colours, legs, top, limits) {
  const { context, width, height } = sharpContext(canvas);
  const x = (age) => LEFT + (width - LEFT - RIGHT) * (1 - age / SECONDS);
  context.font = "12px system-ui, sans-serif";
  let from = 0;
  for (const panel of panels(top, limits)) {
    const to = from + panel.share * (height - TIMES);
    const y = (value) => (
      to - (to - from - TITLE) * (value - panel.low) / (panel.high - panel.low)
    );
    grid(context, colours, panel, x, y, from);
    context.save();
    context.beginPath();
    context.rect(LEFT, from, width - LEFT, to - from);
    context.clip();
    if (panel.column === 1 && legs.length) {
      context.setLineDash([5, 4]);
      curve(context, legs[0].leg.past, 0, colours.soft, x, y);
      context.setLineDash([]);
    }
    for (const { leg, colour } of legs) {
      curve(context, leg.past, panel.column, colour, x, y);
      if (panel.column === 1) dots(context, leg.past, colour, x, y);
    }
    context.restore();
    from = to;
  }
  context.fillStyle = colours.soft;
  context.textAlign = "center";
  for (let age = 0; age <= SECONDS; age++) {
    context.fillText(age ? `\u2212${age} s` : "now", Math.min(x(age), width - 14), height - 5);
  }
  context.textAlign = "left";
}

function grid(context, colours, { title, low, high, step = high }, x, y, from) {
  context.fillStyle = colours.ink;
  context.fillText(title, LEFT, from + 22);
  context.fillStyle = colours.soft;
  context.textAlign = "right";
  for (let value = low; value <= high + 1e-9; value += step) {
    line(context, colours.line, 1, [x(SECONDS), y(value)], [x(0), y(value)]);
    const text = value.toFixed(step < 1 ? 1 : 0).replace("-", "\u2212");
    context.fillText(text, LEFT - 6, y(value) + 4);
  }
  context.textAlign = "left";
}

function curve(context, past, column, colour, x, y) {
  const last = past.slice(-Math.round(SECONDS / PERIOD) - 1);
  const points = last.map((row, i) => [x((last.length - 1 - i) * PERIOD), y(row[column])]);
  line(context, colour, 1.6, ...points);
}

function dots(context, past, colour, x, y) {
  past.forEach(([, , , , apex], i) => {
    if (!Number.isNaN(apex)) disc(context, colour, [x((past.length - 1 - i) * PERIOD), y(apex)], 3.5);
  });
}
