"""One physics step of the leg as MuJoCo 4 computes it, written out for rail, hip and knee.

Generalised coordinates are the base height and the links' angles, p = (x, q1, q2); the dynamics
M(p) p'' + b(p, p') = f are those of ``robot.dynamics``. Among all accelerations a, MuJoCo's soft
constraints choose the minimum of Gauss' principle,

    1/2 (a - a0)' M (a - a0) + sum_i s_i(J_i a - r_i),      M a0 = f - b,

where s_i is a quadratic of curvature D_i: of dry friction one that goes on as a straight line where
it reaches the friction (Huber), of contacts and stops one that is zero on the positive side. The
reference r_i is a spring's and damper's, see MuJoCo's documentation, "Computation: Constraint
model". Newton's method with an exact line search finds the minimum. Damping is implicit in the
velocity, and the position follows the new velocity (``implicitfast``).

A joint with an elastic transmission has a rotor of its own that carries armature, friction and
damping; a spring with a dead band and a damper tie it to the link, and nothing else does.

On a boom the base moves forward, too: a fourth coordinate y, which only contacts and the links'
inertia tie to the others, M y'' + c . (x'', q1'', q2'') = f. What takes ``forward`` leaves it out
where that is False, which the compiler knows; y itself acts on nothing, so that none is kept.

``p`` is a row of the leg's table (``leg_table``), vectors and matrices are tuples, a symmetric
matrix is (m00, m01, m02, m11, m12, m22). Lengths are in m, masses in kg, angles in rad, in SI units
throughout; torques are the joint's.
"""

import numpy as np

from hopping_leg.arrays import Array, Record
from hopping_leg.sim.compiled import inlined

ROWS = 11
"""Constraints at most, besides dry friction: three per contact, one per joint at its stop."""

SCRATCH = (ROWS, 6)
"""Shape of what holds them: (J, r, D, J_y) of each."""

Vector = tuple[float, float, float]
Four = tuple[float, float, float, float]
Symmetric = tuple[float, float, float, float, float, float]

Forward = tuple[Vector, float, float]
"""Of y: coupling c, mass M, and force f."""

Friction = tuple[Vector, Vector, Vector, Vector]
"""Dry frictions: force F (zero for none), D, r, and the bound F / D beyond which they slide."""

_ITERATIONS = 60
_SEARCHES = 40
_FIRST_ROW = 64  # bit of the first row, behind two for each dry friction


@inlined
def mass_matrix(p: Record, s1: float, s12: float, cos_knee: float) -> Symmetric:
    """Return M for the sines of q1 and q1 + q2 and the cosine of q2."""
    coupling = p.coupling * cos_knee
    rail_knee = p.shank_moment * s12
    return (
        p.mass,
        p.thigh_moment * s1 + rail_knee,
        rail_knee,
        p.hip_inertia + 2 * coupling,
        p.shank_inertia + coupling,
        p.knee_inertia,
    )


@inlined
def solve(m: Symmetric, b: Vector) -> Vector:
    """Solve M x = b by the factors L D L'."""
    i0 = 1 / m[0]
    l10, l20 = m[1] * i0, m[2] * i0
    e12 = m[4] - l20 * m[1]
    i1 = 1 / (m[3] - l10 * m[1])
    l21 = e12 * i1
    i2 = 1 / (m[5] - l20 * m[2] - l21 * e12)
    y1 = b[1] - l10 * b[0]
    x2 = (b[2] - l20 * b[0] - l21 * y1) * i2
    x1 = y1 * i1 - l21 * x2
    return b[0] * i0 - l10 * x1 - l20 * x2, x1, x2


@inlined
def solve_forward(m: Symmetric, c: Vector, mass: float, b: Vector, pull: float) -> Four:
    """Solve M x + c y = b, c . x + ``mass`` y = ``pull`` for (x, y)."""
    p, q = solve(m, b), solve(m, c)
    y = (pull - dot(c, p)) / (mass - dot(c, q))
    return p[0] - q[0] * y, p[1] - q[1] * y, p[2] - q[2] * y, y


@inlined
def times(m: Symmetric, x: Vector) -> Vector:
    """Return M x."""
    return (
        m[0] * x[0] + m[1] * x[1] + m[2] * x[2],
        m[1] * x[0] + m[3] * x[1] + m[4] * x[2],
        m[2] * x[0] + m[4] * x[1] + m[5] * x[2],
    )


@inlined
def dot(x: Vector, y: Vector) -> float:
    """Return the scalar product."""
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


@inlined
def impedance(depth: float) -> float:
    """Return MuJoCo's default impedance of contacts and limits, ``solimp`` 0.9 0.95 0.001 0.5 2."""
    x = abs(depth) / 0.001
    if x >= 1:
        return 0.95
    return 0.9 + 0.05 * (2 * x * x if x <= 0.5 else 1 - 2 * (1 - x) * (1 - x))


@inlined
def add_contact(
    p: Record,
    rows: Array,
    count: int,
    gap: float,
    softness: float,
    normal: Vector,
    tangent: Vector,
    speed: Vector,
    drift: float,
) -> int:
    """Add a contact's edges of the friction pyramid to ``rows``; return the new count.

    Out of the leg's plane nothing slides, so that two edges are one. ``drift`` is the velocity y'.
    """
    imp, mu = impedance(gap), p.ground_friction
    stiffness = 1 / ((1 - imp) / imp * 2 * mu * mu * (1 + mu * mu) * softness)
    spring = -p.contact_stiffness * imp * gap
    for edge in range(3):
        slope = 0.0 if edge == 0 else (mu if edge == 1 else -mu)
        row = rows[count + edge]
        row[0] = normal[0] + slope * tangent[0]
        row[1] = normal[1] + slope * tangent[1]
        row[2] = normal[2] + slope * tangent[2]
        rate = row[0] * speed[0] + row[1] * speed[1] + row[2] * speed[2]
        row[3] = spring - p.contact_damping * (rate + slope * drift)
        row[4] = 2 * stiffness if edge == 0 else stiffness
        row[5] = slope
    return count + 3


@inlined
def add_contacts(
    p: Record,
    rows: Array,
    height: float,
    speed: Vector,
    s1: float,
    c1: float,
    s12: float,
    c12: float,
    drift: float,
) -> int:
    """Set the rows of base, knee and foot where they touch the ground; return how many.

    A point's height rises by its distance in front of the joint per angle, and it moves forward by
    its depth below the joint; the contact acts in the middle of the overlap.
    """
    count = 0
    knee_x, knee_z = p.thigh_length * s1, -p.thigh_length * c1
    foot_x, foot_z = knee_x + p.shank_length * s12, knee_z - p.shank_length * c12
    gap = height + foot_z - p.foot_radius
    if gap < 0:
        at = foot_z - p.foot_radius - gap / 2
        normal, tangent = (1.0, foot_x, foot_x - knee_x), (0.0, -at, knee_z - at)
        count = add_contact(p, rows, count, gap, p.shank_softness, normal, tangent, speed, drift)
    gap = height + knee_z - p.knee_radius
    if gap < 0:
        at = knee_z - p.knee_radius - gap / 2
        normal, tangent = (1.0, knee_x, 0.0), (0.0, -at, knee_z - at)
        count = add_contact(p, rows, count, gap, p.shank_softness, normal, tangent, speed, drift)
    gap = height - p.base_radius
    if gap < 0:
        normal, tangent = (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        count = add_contact(p, rows, count, gap, p.base_softness, normal, tangent, speed, drift)
    return count


@inlined
def add_stops(p: Record, rows: Array, count: int, q: Vector, speed: Vector) -> int:
    """Add a row for each joint beyond its mechanical stop; return the new count."""
    for joint in range(2):
        angle = q[1] if joint == 0 else q[2]
        sign, gap = 1.0, angle - p.stop_lower[joint]
        if gap >= 0:
            sign, gap = -1.0, p.stop_upper[joint] - angle
        if gap < 0:
            imp = impedance(gap)
            row = rows[count]
            row[0], row[1], row[2], row[5] = 0.0, 0.0, 0.0, 0.0
            row[1 + joint] = sign
            rate = sign * (speed[1] if joint == 0 else speed[2])
            row[3] = -p.stop_damping * rate - p.stop_stiffness * imp * gap
            row[4] = 1 / ((1 - imp) / imp * p.joint_softness[joint])
            count += 1
    return count


@inlined
def along(row: Array, x: Four, forward: bool) -> float:
    """Return J x of a row."""
    value: float = row[0] * x[0] + row[1] * x[1] + row[2] * x[2]
    return value + row[5] * x[3] if forward else value


@inlined
def active(a: Four, friction: Friction, rows: Array, count: int, forward: bool) -> int:
    """Return which pieces of the s_i hold at an acceleration, as bits.

    Two bits each say whether a dry friction slides forward or backward, one whether a row pushes.
    """
    loss, _, rest, bound = friction
    bits = 0
    for i in range(3):
        if loss[i] > 0:
            x = a[i] - rest[i]
            if x > bound[i]:
                bits |= 1 << (2 * i)
            elif x < -bound[i]:
                bits |= 2 << (2 * i)
    for c in range(count):
        row = rows[c]
        if along(row, a, forward) < row[3]:
            bits |= _FIRST_ROW << c
    return bits


@inlined
def friction_slope(i: int, a: Four, friction: Friction, bits: int) -> tuple[float, float]:
    """Return first and second derivative of a dry friction's s_i by a_i on the piece that holds."""
    loss, stiff, rest, _ = friction
    if loss[i] <= 0:
        return 0.0, 0.0
    if bits & (1 << (2 * i)):
        return loss[i], 0.0
    if bits & (2 << (2 * i)):
        return -loss[i], 0.0
    return stiff[i] * (a[i] - rest[i]), stiff[i]


@inlined
def slope_along(
    t: float, a: Four, x: Four, friction: Friction, rows: Array, count: int, forward: bool
) -> tuple[float, float]:
    """Return first and second derivative of all s_i along a + t x."""
    loss, stiff, rest, bound = friction
    first = second = 0.0
    for i in range(3):
        if loss[i] > 0:
            beyond = a[i] + t * x[i] - rest[i]
            if beyond > bound[i]:
                first += loss[i] * x[i]
            elif beyond < -bound[i]:
                first -= loss[i] * x[i]
            else:
                first += stiff[i] * beyond * x[i]
                second += stiff[i] * x[i] * x[i]
    for c in range(count):
        row = rows[c]
        rise = along(row, x, forward)
        miss = along(row, a, forward) - row[3] + t * rise
        if miss < 0:
            first += row[4] * miss * rise
            second += row[4] * rise * rise
    return first, second


@inlined
def constrained_acceleration(
    m: Symmetric,
    force: Vector,
    moving: Forward,
    friction: Friction,
    rows: Array,
    count: int,
    a: Four,
    forward: bool,
) -> Four:
    """Return the acceleration (x'', q1'', q2'', y'') that minimises Gauss' principle.

    Where the pieces at the end of a full Newton step are those at its beginning, it is the minimum.

    Args:
        m: Mass matrix.
        force: f - b.
        moving: What there is of y.
        friction: The dry frictions.
        rows: Contacts and stops, ``SCRATCH``.
        count: How many there are.
        a: Where to begin.
        forward: Whether there is a y; its acceleration stays zero where there is none.
    """
    coupling, mass, force_y = moving
    bits = active(a, friction, rows, count, forward)
    for _ in range(_ITERATIONS):
        # Gradient g and Hessian h of the principle on the pieces that hold.
        y = a[3]
        r0, r1, r2 = times(m, (a[0], a[1], a[2]))
        if forward:
            r0, r1, r2 = r0 + coupling[0] * y, r1 + coupling[1] * y, r2 + coupling[2] * y
        residual = (r0 - force[0], r1 - force[1], r2 - force[2])
        s0, d0 = friction_slope(0, a, friction, bits)
        s1, d1 = friction_slope(1, a, friction, bits)
        s2, d2 = friction_slope(2, a, friction, bits)
        g0, g1, g2 = residual[0] + s0, residual[1] + s1, residual[2] + s2
        h0, h1, h2, h3, h4, h5 = m[0] + d0, m[1], m[2], m[3] + d1, m[4], m[5] + d2
        e0, e1, e2, e3, g3 = coupling[0], coupling[1], coupling[2], mass, 0.0
        residual_y = 0.0
        if forward:
            residual_y = dot(coupling, (a[0], a[1], a[2])) + mass * y - force_y
            g3 = residual_y
        for c in range(count):
            if bits & (_FIRST_ROW << c):
                row = rows[c]
                j0, j1, j2, d = row[0], row[1], row[2], row[4]
                pull = d * (along(row, a, forward) - row[3])
                g0, g1, g2 = g0 + j0 * pull, g1 + j1 * pull, g2 + j2 * pull
                h0, h1, h2 = h0 + d * j0 * j0, h1 + d * j0 * j1, h2 + d * j0 * j2
                h3, h4, h5 = h3 + d * j1 * j1, h4 + d * j1 * j2, h5 + d * j2 * j2
                if forward:
                    j3 = row[5]
                    e0, e1, e2 = e0 + d * j0 * j3, e1 + d * j1 * j3, e2 + d * j2 * j3
                    e3, g3 = e3 + d * j3 * j3, g3 + j3 * pull
        if forward:
            x = solve_forward((h0, h1, h2, h3, h4, h5), (e0, e1, e2), e3, (-g0, -g1, -g2), -g3)
        else:
            x0, x1, x2 = solve((h0, h1, h2, h3, h4, h5), (-g0, -g1, -g2))
            x = (x0, x1, x2, 0.0)
        after = (a[0] + x[0], a[1] + x[1], a[2] + x[2], y + x[3])
        if active(after, friction, rows, count, forward) == bits:
            return after
        # Exact line search: Newton's method within a bracket on the slope along x.
        step = (x[0], x[1], x[2])
        descent = abs(g0 * x[0] + g1 * x[1] + g2 * x[2])
        linear, square = dot(residual, step), dot(step, times(m, step))
        if forward:
            descent = abs(g0 * x[0] + g1 * x[1] + g2 * x[2] + g3 * x[3])
            linear += residual_y * x[3]
            square += x[3] * (2 * dot(coupling, step) + mass * x[3])
        t, low, high = 1.0, 0.0, np.inf
        for _ in range(_SEARCHES):
            first, second = slope_along(t, a, x, friction, rows, count, forward)
            first, second = first + linear + t * square, second + square
            if abs(first) <= 1e-12 * descent:
                break
            if first > 0:
                high = t
            else:
                low = t
            t -= first / second
            if not low < t < high:
                t = (low + high) / 2 if high < np.inf else 2 * low
        a = (a[0] + t * x[0], a[1] + t * x[1], a[2] + t * x[2], y + t * x[3])
        bits = active(a, friction, rows, count, forward)
        if descent <= 1e-300:
            break
    return a


@inlined
def rotor_acceleration(
    inertia: float, force: float, rest: float, loss: float, stiff: float
) -> float:
    """Return a rotor's acceleration: the same principle in one unknown."""
    free = force / inertia
    if loss <= 0:
        return free
    a = (force + stiff * rest) / (inertia + stiff)
    if stiff * (a - rest) > loss:
        return (force - loss) / inertia
    if stiff * (a - rest) < -loss:
        return (force + loss) / inertia
    return a
