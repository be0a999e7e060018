// One physics step of the leg: a port of `src/hopping_leg/sim/leg_physics.py`, which has the
// mathematics. `p` is a leg's row of parameters (table.js), named as in Python. Vectors are
// (x, q1, q2), symmetric matrices (m00, m01, m02, m11, m12, m22), in SI units. What a function
// computes goes to its last argument, so that no step makes garbage.

const ROWS = 11; // constraints at most, besides dry friction
const ITERATIONS = 60;
const SEARCHES = 40;
const FIRST_ROW = 64; // bit of the first row, behind two for each dry friction

export const vector = () => new Float64Array(3);
export const symmetric = () => new Float64Array(6);

// Contacts and stops: (J, r, D) each.
export const makeRows = () => Array.from({ length: ROWS }, () => new Float64Array(5));

// Dry frictions: force F (zero for none), D, r, and the bound F / D beyond which they slide.
export const makeFriction = () => ({
  loss: vector(), stiff: vector(), rest: vector(), bound: vector(),
});

// M for the sines of q1 and q1 + q2 and the cosine of q2.
export function massMatrix(p, s1, s12, cosKnee, m) {
  const coupling = p.coupling * cosKnee;
  const railKnee = p.shank_moment * s12;
  m[0] = p.mass;
  m[1] = p.thigh_moment * s1 + railKnee;
  m[2] = railKnee;
  m[3] = p.hip_inertia + 2 * coupling;
  m[4] = p.shank_inertia + coupling;
  m[5] = p.knee_inertia;
}

// Solve M x = b by the factors L D L'.
export function solve(m, b, x) {
  const i0 = 1 / m[0];
  const l10 = m[1] * i0;
  const l20 = m[2] * i0;
  const e12 = m[4] - l20 * m[1];
  const i1 = 1 / (m[3] - l10 * m[1]);
  const l21 = e12 * i1;
  const i2 = 1 / (m[5] - l20 * m[2] - l21 * e12);
  const y1 = b[1] - l10 * b[0];
  x[2] = (b[2] - l20 * b[0] - l21 * y1) * i2;
  x[1] = y1 * i1 - l21 * x[2];
  x[0] = b[0] * i0 - l10 * x[1] - l20 * x[2];
}

export function times(m, x, y) {
  y[0] = m[0] * x[0] + m[1] * x[1] + m[2] * x[2];
  y[1] = m[1] * x[0] + m[3] * x[1] + m[4] * x[2];
  y[2] = m[2] * x[0] + m[4] * x[1] + m[5] * x[2];
}

const dot = (x, y) => x[0] * y[0] + x[1] * y[1] + x[2] * y[2];

// MuJoCo's default impedance of contacts and limits, `solimp` 0.9 0.95 0.001 0.5 2.
function impedance(depth) {
  const x = Math.abs(depth) / 0.001;
  if (x >= 1) return 0.95;
  return 0.9 + 0.05 * (x <= 0.5 ? 2 * x * x : 1 - 2 * (1 - x) * (1 - x));
}

// Add a contact's edges of the friction pyramid to the rows; return the new count.
function addContact(p, rows, count, gap, softness, normal, tangent, speed) {
  const imp = impedance(gap);
  const mu = p.ground_friction;
  const stiffness = 1 / ((1 - imp) / imp * 2 * mu * mu * (1 + mu * mu) * softness);
  const spring = -p.contact_stiffness * imp * gap;
  for (let edge = 0; edge < 3; edge++) {
    const slope = edge === 0 ? 0 : edge === 1 ? mu : -mu;
    const row = rows[count + edge];
    for (let i = 0; i < 3; i++) row[i] = normal[i] + slope * tangent[i];
    row[3] = spring - p.contact_damping * dot(row, speed);
    row[4] = edge === 0 ? 2 * stiffness : stiffness;
  }
  return count + 3;
}

const normal = vector();
const tangent = vector();

function set(x, x0, x1, x2) {
  x[0] = x0;
  x[1] = x1;
  x[2] = x2;
}

// Set the rows of base, knee and foot where they touch the ground; return how many.
export function addContacts(p, rows, height, speed, s1, c1, s12, c12) {
  let count = 0;
  const kneeX = p.thigh_length * s1;
  const kneeZ = -p.thigh_length * c1;
  const footX = kneeX + p.shank_length * s12;
  const footZ = kneeZ - p.shank_length * c12;
  let gap = height + footZ - p.foot_radius;
  if (gap < 0) {
    const at = footZ - p.foot_radius - gap / 2;
    set(normal, 1, footX, footX - kneeX);
    set(tangent, 0, -at, kneeZ - at);
    count = addContact(p, rows, count, gap, p.shank_softness, normal, tangent, speed);
  }
  gap = height + kneeZ - p.knee_radius;
  if (gap < 0) {
    const at = kneeZ - p.knee_radius - gap / 2;
    set(normal, 1, kneeX, 0);
    set(tangent, 0, -at, kneeZ - at);
    count = addContact(p, rows, count, gap, p.shank_softness, normal, tangent, speed);
  }
  gap = height - p.base_radius;
  if (gap < 0) {
    set(normal, 1, 0, 0);
    set(tangent, 0, 0, 0);
    count = addContact(p, rows, count, gap, p.base_softness, normal, tangent, speed);
  }
  return count;
}

// Add a row for each joint beyond its mechanical stop; return the new count.
export function addStops(p, rows, count, q1, q2, speed) {
  for (let joint = 0; joint < 2; joint++) {
    const angle = joint === 0 ? q1 : q2;
    let sign = 1;
    let gap = angle - p.stop_lower[joint];
    if (gap >= 0) {
      sign = -1;
      gap = p.stop_upper[joint] - angle;
    }
    if (gap < 0) {
      const imp = impedance(gap);
      const row = rows[count];
      set(row, 0, 0, 0);
      row[1 + joint] = sign;
      row[3] = -p.stop_damping * sign * speed[1 + joint] - p.stop_stiffness * imp * gap;
      row[4] = 1 / ((1 - imp) / imp * p.joint_softness[joint]);
      count += 1;
    }
  }
  return count;
}

// Which pieces of the constraints hold at an acceleration, as bits: two for each dry friction, which
// slides forward or backward, one for each row, which pushes.
function active(a, friction, rows, count) {
  let bits = 0;
  for (let i = 0; i < 3; i++) {
    if (friction.loss[i] > 0) {
      const x = a[i] - friction.rest[i];
      if (x > friction.bound[i]) bits |= 1 << (2 * i);
      else if (x < -friction.bound[i]) bits |= 2 << (2 * i);
    }
  }
  for (let c = 0; c < count; c++) if (dot(rows[c], a) < rows[c][3]) bits |= FIRST_ROW << c;
  return bits;
}

const slopes = new Float64Array(2);

// First and second derivative of all constraints along a + t x at t = `along`.
function slopeAlong(along, a, x, friction, rows, count, out) {
  const { loss, stiff, rest, bound } = friction;
  let first = 0;
  let second = 0;
  for (let i = 0; i < 3; i++) {
    if (loss[i] > 0) {
      const beyond = a[i] + along * x[i] - rest[i];
      if (beyond > bound[i]) first += loss[i] * x[i];
      else if (beyond < -bound[i]) first -= loss[i] * x[i];
      else {
        first += stiff[i] * beyond * x[i];
        second += stiff[i] * x[i] * x[i];
      }
    }
  }
  for (let c = 0; c < count; c++) {
    const row = rows[c];
    const rise = dot(row, x);
    const miss = dot(row, a) - row[3] + along * rise;
    if (miss < 0) {
      first += row[4] * miss * rise;
      second += row[4] * rise * rise;
    }
  }
  out[0] = first;
  out[1] = second;
}

const residual = vector();
const gradient = vector();
const down = vector();
const hessian = symmetric();
const newton = vector();
const after = vector();
const product = vector();

// Gradient and Hessian of Gauss' principle on the pieces that hold; the residual is M a - f.
function derivatives(m, force, friction, rows, count, a, bits) {
  times(m, a, product);
  hessian.set(m);
  for (let i = 0; i < 3; i++) {
    residual[i] = product[i] - force[i];
    let slope = 0;
    let curvature = 0;
    if (friction.loss[i] > 0) {
      if (bits & (1 << (2 * i))) slope = friction.loss[i];
      else if (bits & (2 << (2 * i))) slope = -friction.loss[i];
      else {
        slope = friction.stiff[i] * (a[i] - friction.rest[i]);
        curvature = friction.stiff[i];
      }
    }
    gradient[i] = residual[i] + slope;
    hessian[i === 0 ? 0 : i === 1 ? 3 : 5] += curvature;
  }
  for (let c = 0; c < count; c++) {
    if (!(bits & (FIRST_ROW << c))) continue;
    const [j0, j1, j2, , d] = rows[c];
    const pull = d * (dot(rows[c], a) - rows[c][3]);
    gradient[0] += j0 * pull;
    gradient[1] += j1 * pull;
    gradient[2] += j2 * pull;
    hessian[0] += d * j0 * j0;
    hessian[1] += d * j0 * j1;
    hessian[2] += d * j0 * j2;
    hessian[3] += d * j1 * j1;
    hessian[4] += d * j1 * j2;
    hessian[5] += d * j2 * j2;
  }
}

// Change `a`, where to begin, to the acceleration that minimises Gauss' principle: Newton's method
// with an exact line search.
export function constrainAcceleration(m, force, friction, rows, count, a) {
  let bits = active(a, friction, rows, count);
  for (let iteration = 0; iteration < ITERATIONS; iteration++) {
    derivatives(m, force, friction, rows, count, a, bits);
    for (let i = 0; i < 3; i++) down[i] = -gradient[i];
    solve(hessian, down, newton);
    for (let i = 0; i < 3; i++) after[i] = a[i] + newton[i];
    if (active(after, friction, rows, count) === bits) {
      a.set(after);
      return;
    }
    const descent = Math.abs(dot(gradient, newton));
    const linear = dot(residual, newton);
    times(m, newton, product);
    const square = dot(newton, product);
    let along = 1;
    let low = 0;
    let high = Infinity;
    for (let search = 0; search < SEARCHES; search++) {
      slopeAlong(along, a, newton, friction, rows, count, slopes);
      const first = slopes[0] + linear + along * square;
      if (Math.abs(first) <= 1e-12 * descent) break;
      if (first > 0) high = along;
      else low = along;
      along -= first / (slopes[1] + square);
      if (!(low < along && along < high)) along = high < Infinity ? (low + high) / 2 : 2 * low;
    }
    for (let i = 0; i < 3; i++) a[i] += along * newton[i];
    bits = active(a, friction, rows, count);
    if (descent <= 1e-300) return;
  }
}

// A rotor's acceleration behind an elastic transmission: the same principle in one unknown.
export function rotorAcceleration(inertia, force, rest, loss, stiff) {
  if (loss <= 0) return force / inertia;
  const a = (force + stiff * rest) / (inertia + stiff);
  if (stiff * (a - rest) > loss) return (force - loss) / inertia;
  if (stiff * (a - rest) < -loss) return (force + loss) / inertia;
  return a;
}
