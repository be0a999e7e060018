// What the documentation's build wrote into the page: robots, gains, constants of the package.

export const DATA = JSON.parse(document.getElementById("data").textContent);
export const JOINTS = ["hip", "knee"];
export const PERIOD = 1 / DATA.rate; // of control, s

export const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

// Something that a visitor can put right; its message is a sentence.
export class PageError extends Error {}
