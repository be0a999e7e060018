// Draws as many pixels as this browser keeps up with; viser's own steps end at three quarters.

const MOST = window.devicePixelRatio;
const LEAST = 0.4;
const SLOW = 50; // pictures per second
const FAST = 57;
const CALM = 3; // s of fast pictures before more pixels are tried
const PAUSE = 500; // ms without a picture: nobody looks

let ratio = MOST; // pixels drawn per pixel of the page, each way
let ceiling = MOST; // what was too much
let calm = 0;
let pictures = 0;
let begun;
let last;

function draw(pixels) {
  ratio = pixels;
  window.__viserTestpoints.devSettings.set({ fixedDpr: ratio });
}

function judge(rate) {
  calm = rate < FAST ? 0 : calm + 1;
  if (rate < SLOW && ratio > LEAST) {
    ceiling = 0.95 * ratio;
    draw(Math.max(LEAST, ratio * Math.max(0.6, Math.sqrt(rate / FAST))));
  } else if (calm >= CALM && ratio < 0.9 * ceiling) {
    calm = 0;
    draw(Math.min(ceiling, 1.15 * ratio));
  }
}

function watch(now) {
  requestAnimationFrame(watch);
  if (begun === undefined || now - last > PAUSE) [begun, pictures] = [now, 0];
  last = now;
  pictures += 1;
  if (now - begun < 1000) return;
  if (window.__viserTestpoints) judge(1000 * (pictures - 1) / (now - begun));
  [begun, pictures] = [now, 1];
}

requestAnimationFrame(watch);
