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
inertia tie to the others, M y'' + c . (x'', q1'', q2'') = f; y itself acts on nothing, so that none
is kept. On a rail c and f are zero.

``p`` is a row of the leg's table (``leg_table``), or eight rows side by side, whose numbers are
``lanes``. Vectors and matrices are tuples, a symmetric matrix is (m00, m01, m02, m11, m12, m22).
Lengths are in m, masses in kg, angles in rad, in SI units throughout; torques are the joint's.
"""

import numpy as np

from hopping_leg.arrays import Record
from hopping_leg.sim.compiled import inlined
from hopping_leg.sim.lanes import Number, any_of, following, spread, where

ROWS = 11
"""Constraints at most, besides dry friction: three per contact, one per joint at its stop."""

ROW = np.dtype(
    [(name, np.float64) for name in ("j0", "j1", "j2", "j3", "reference", "softness", "holds")]
)
"""A constraint: Jacobian J (of y last), r, D, and D again on the piece that holds or zero."""

Vector = tuple[Number, Number, Number]
Four = tuple[Number, Number, Number, Number]
Symmetric = tuple[Number, Number, Number, Number, Number, Number]

Forward = tuple[Vector, Number, Number, bool]
"""Of y: coupling c, mass M, force f, and whether a leg is on a boom at all."""

Friction = tuple[Vector, Vector, Vector, Vector]
"""Dry frictions: force F (zero for none), D, r, and the bound F / D beyond which they slide."""

_ITERATIONS = 60
_SEARCHES = 40
_NEVER = -1e100  # r of what does not touch


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
def solve_all(m: Symmetric, c: Vector, mass: Number, b: Vector, pull: Number, boom: bool) -> Four:
    """Solve M x + c y = b, c . x + ``mass`` y = ``pull`` for (x, y), where y = 0 without a boom."""
    x, y = solve(m, b), spread(0.0, pull)
    if boom:
        q = solve(m, c)
        y = (pull - dot(c, x)) / (mass - dot(c, q))
        x = (x[0] - q[0] * y, x[1] - q[1] * y, x[2] - q[2] * y)
    return x[0], x[1], x[2], y


@inlined
def times(m: Symmetric, x: Vector) -> Vector:
    """Return M x."""
    return (
        m[0] * x[0] + m[1] * x[1] + m[2] * x[2],
        m[1] * x[0] + m[3] * x[1] + m[4] * x[2],
        m[2] * x[0] + m[4] * x[1] + m[5] * x[2],
    )


@inlined
def dot(x: Vector, y: Vector) -> Number:
    """Return the scalar product."""
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


@inlined
def impedance(depth: Number) -> Number:
    """Return MuJoCo's default impedance of contacts and limits, ``solimp`` 0.9 0.95 0.001 0.5 2."""
    x = min(abs(depth) * 1000.0, 1.0)
    rest = 1.0 - x
    return 0.9 + 0.05 * where(x <= 0.5, 2.0 * x * x, 1.0 - 2.0 * rest * rest)


@inlined
def add_contact(
    p: Record, rows: Record, count: int, gap: Number, softness: Number, normal: Vector,
    tangent: Vector, speed: Vector, drift: Number,
) -> int:  # fmt: skip
    """Add a contact's edges of the friction pyramid to ``rows``; return the new count.

    Out of the leg's plane nothing slides, so that two edges are one. ``drift`` is the velocity y'.
    """
    imp, mu, ahead = impedance(gap), p.ground_friction, where(p.boom_radius > 0.0, 1.0, 0.0)
    stiffness = imp / ((1.0 - imp) * (2.0 * mu * mu * (1.0 + mu * mu)) * softness)
    spring = -p.contact_stiffness * imp * gap
    touching = gap < 0.0
    for edge in range(3):
        slope = spread(0.0, mu) if edge == 0 else (mu if edge == 1 else -mu)
        row = following(rows, count + edge)
        j0 = normal[0] + slope * tangent[0]
        j1 = normal[1] + slope * tangent[1]
        j2 = normal[2] + slope * tangent[2]
        rate = j0 * speed[0] + j1 * speed[1] + j2 * speed[2] + slope * drift
        row.j0, row.j1, row.j2, row.j3 = j0, j1, j2, ahead * slope
        row.reference = where(touching, spring - p.contact_damping * rate, _NEVER)
        row.softness = 2.0 * stiffness if edge == 0 else stiffness
    return count + 3


@inlined
def add_contacts(
    p: Record, rows: Record, height: Number, speed: Vector, s1: Number, c1: Number, s12: Number,
    c12: Number, drift: Number,
) -> int:  # fmt: skip
    """Set the rows of base, knee and foot where they touch the ground; return how many.

    A point's height rises by its distance in front of the joint per angle, and it moves forward by
    its depth below the joint; the contact acts in the middle of the overlap.
    """
    count = 0
    knee_x, knee_z = p.thigh_length * s1, -p.thigh_length * c1
    foot_x, foot_z = knee_x + p.shank_length * s12, knee_z - p.shank_length * c12
    gap = height + foot_z - p.foot_radius
    if any_of(gap < 0.0):
        at = foot_z - p.foot_radius - 0.5 * gap
        normal, tangent = (1.0, foot_x, foot_x - knee_x), (0.0, -at, knee_z - at)
        count = add_contact(p, rows, count, gap, p.shank_softness, normal, tangent, speed, drift)
    gap = height + knee_z - p.knee_radius
    if any_of(gap < 0.0):
        at = knee_z - p.knee_radius - 0.5 * gap
        normal, tangent = (1.0, knee_x, spread(0.0, at)), (0.0, -at, knee_z - at)
        count = add_contact(p, rows, count, gap, p.shank_softness, normal, tangent, speed, drift)
    gap = height - p.base_radius
    if any_of(gap < 0.0):
        none = spread(0.0, gap)
        normal, tangent = (1.0, none, none), (0.0, none, none)
        count = add_contact(p, rows, count, gap, p.base_softness, normal, tangent, speed, drift)
    return count


@inlined
def add_stop(
    p: Record, rows: Record, count: int, joint: int, angle: Number, speed: Number
) -> tuple[int, Number]:
    """Add a row for a joint beyond its mechanical stop; return the new count, and 1 if it is."""
    low = angle - p.stop_lower[joint]
    sign = where(low < 0.0, 1.0, -1.0)
    gap = where(low < 0.0, low, p.stop_upper[joint] - angle)
    beyond = gap < 0.0
    if any_of(beyond):
        imp, row = impedance(gap), following(rows, count)
        row.j0, row.j1, row.j2, row.j3 = 0.0, sign * (1.0 - joint), sign * joint, 0.0
        reference = -p.stop_damping * sign * speed - p.stop_stiffness * imp * gap
        row.reference = where(beyond, reference, _NEVER)
        row.softness = imp / ((1.0 - imp) * p.joint_softness[joint])
        count += 1
    return count, where(beyond, 1.0, 0.0)


@inlined
def along(row: Record, x: Four) -> Number:
    """Return J x of a row."""
    return row.j0 * x[0] + row.j1 * x[1] + row.j2 * x[2] + row.j3 * x[3]


@inlined
def sliding(a: Four, friction: Friction) -> Vector:
    """Return in which direction each dry friction slides, 1 or -1, or 0 where it holds."""
    _, _, rest, bound = friction
    x0, x1, x2 = a[0] - rest[0], a[1] - rest[1], a[2] - rest[2]
    return (
        where(x0 > bound[0], 1.0, where(x0 < -bound[0], -1.0, 0.0)),
        where(x1 > bound[1], 1.0, where(x1 < -bound[1], -1.0, 0.0)),
        where(x2 > bound[2], 1.0, where(x2 < -bound[2], -1.0, 0.0)),
    )


@inlined
def take_pieces(
    a: Four, slides: Vector, friction: Friction, rows: Record, count: int
) -> tuple[Vector, bool]:
    """Let the pieces of the s_i be those at an acceleration.

    Return how dry frictions slide, and whether any piece is another than before.
    """
    now = sliding(a, friction)
    other = (now[0] != slides[0]) | (now[1] != slides[1]) | (now[2] != slides[2])
    for c in range(count):
        row = following(rows, c)
        holds = where(along(row, a) < row.reference, row.softness, 0.0)
        other = other | (holds != row.holds)
        row.holds = holds
    return now, other


@inlined
def friction_slope(i: int, a: Four, friction: Friction, slides: Vector) -> tuple[Number, Number]:
    """Return first and second derivative of a dry friction's s_i by a_i on the piece that holds."""
    loss, stiff, rest, _ = friction
    holds = slides[i] == 0.0
    return (
        where(holds, stiff[i] * (a[i] - rest[i]), slides[i] * loss[i]),
        where(holds, stiff[i], 0.0),
    )


@inlined
def slope_along(
    t: Number, a: Four, x: Four, friction: Friction, rows: Record, count: int
) -> tuple[Number, Number]:
    """Return first and second derivative of all s_i along a + t x."""
    there = (a[0] + t * x[0], a[1] + t * x[1], a[2] + t * x[2], a[3])
    slides = sliding(there, friction)
    s0, d0 = friction_slope(0, there, friction, slides)
    s1, d1 = friction_slope(1, there, friction, slides)
    s2, d2 = friction_slope(2, there, friction, slides)
    first = s0 * x[0] + s1 * x[1] + s2 * x[2]
    second = d0 * x[0] * x[0] + d1 * x[1] * x[1] + d2 * x[2] * x[2]
    for c in range(count):
        row = following(rows, c)
        rise = along(row, x)
        miss = along(row, a) - row.reference + t * rise
        pull = where(miss < 0.0, row.softness * rise, 0.0)
        first, second = first + pull * miss, second + pull * rise
    return first, second


@inlined
def moved(condition: bool, a: Four, t: Number, x: Four) -> Four:
    """Return a + t x where a condition holds, a elsewhere."""
    return (
        where(condition, a[0] + t * x[0], a[0]),
        where(condition, a[1] + t * x[1], a[1]),
        where(condition, a[2] + t * x[2], a[2]),
        where(condition, a[3] + t * x[3], a[3]),
    )


@inlined
def constrained_acceleration(
    m: Symmetric, force: Vector, moving: Forward, friction: Friction, rows: Record, count: int,
    a: Four,
) -> Four:  # fmt: skip
    """Return the acceleration (x'', q1'', q2'', y'') that minimises Gauss' principle.

    Where the pieces at the end of a full Newton step are those at its beginning, it is the minimum.

    Args:
        m: Mass matrix.
        force: f - b.
        moving: What there is of y.
        friction: The dry frictions.
        rows: Contacts and stops, first of ``ROWS`` of ``ROW``.
        count: How many there are.
        a: Where to begin; y'' stays zero where there is none.
    """
    c, mass, force_y, boom = moving
    slides, _ = take_pieces(a, sliding(a, friction), friction, rows, count)
    sought = a[0] == a[0]
    for _ in range(_ITERATIONS):
        # Gradient g and Hessian (h, e, e3) of the principle on the pieces that hold.
        y, at = a[3], (a[0], a[1], a[2])
        r0, r1, r2 = times(m, at)
        r0, r1, r2 = r0 + c[0] * y - force[0], r1 + c[1] * y - force[1], r2 + c[2] * y - force[2]
        r3 = dot(c, at) + mass * y - force_y
        s0, d0 = friction_slope(0, a, friction, slides)
        s1, d1 = friction_slope(1, a, friction, slides)
        s2, d2 = friction_slope(2, a, friction, slides)
        g0, g1, g2, g3 = r0 + s0, r1 + s1, r2 + s2, r3
        h0, h1, h2, h3, h4, h5 = m[0] + d0, m[1], m[2], m[3] + d1, m[4], m[5] + d2
        e0, e1, e2, e3 = c[0], c[1], c[2], mass
        for k in range(count):
            row = following(rows, k)
            d = row.holds
            if any_of(d > 0.0):
                j0, j1, j2, j3 = row.j0, row.j1, row.j2, row.j3
                pull = d * (along(row, a) - row.reference)
                g0, g1, g2, g3 = g0 + j0 * pull, g1 + j1 * pull, g2 + j2 * pull, g3 + j3 * pull
                d0, d1, d2, d3 = d * j0, d * j1, d * j2, d * j3
                h0, h1, h2 = h0 + d0 * j0, h1 + d0 * j1, h2 + d0 * j2
                h3, h4, h5 = h3 + d1 * j1, h4 + d1 * j2, h5 + d2 * j2
                e0, e1, e2, e3 = e0 + d3 * j0, e1 + d3 * j1, e2 + d3 * j2, e3 + d3 * j3
        x = solve_all(
            (h0, h1, h2, h3, h4, h5), (e0, e1, e2), e3, (-g0, -g1, -g2), -g3, boom
        )  # fmt: skip
        t = spread(1.0, y)
        after = moved(sought, a, t, x)
        slides, other = take_pieces(after, slides, friction, rows, count)
        unsettled, sought = sought, sought & other
        if not any_of(sought):
            return after
        # Exact line search: Newton's method within a bracket on the slope along x.
        step = (x[0], x[1], x[2])
        descent = abs(g0 * x[0] + g1 * x[1] + g2 * x[2] + g3 * x[3])
        linear = r0 * x[0] + r1 * x[1] + r2 * x[2] + r3 * x[3]
        square = dot(step, times(m, step)) + x[3] * (2.0 * dot(c, step) + mass * x[3])
        low, high, searched = spread(0.0, y), spread(np.inf, y), sought
        for _ in range(_SEARCHES):
            first, second = slope_along(t, a, x, friction, rows, count)
            first, second = first + linear + t * square, second + square
            searched = searched & (abs(first) > 1e-12 * descent)
            if not any_of(searched):
                break
            rises = first > 0.0
            high, low = where(searched & rises, t, high), where(searched & ~rises, t, low)
            newton = t - first / second
            half = where(high < np.inf, 0.5 * (low + high), 2.0 * low)
            t = where(searched, where((low < newton) & (newton < high), newton, half), t)
        a = moved(unsettled, a, t, x)
        slides, _ = take_pieces(a, slides, friction, rows, count)
        sought = sought & (descent > 1e-300)
    return a


@inlined
def rotor_acceleration(
    inertia: Number, force: Number, rest: Number, loss: Number, stiff: Number
) -> Number:
    """Return a rotor's acceleration: the same principle in one unknown."""
    a = (force + stiff * rest) / (inertia + stiff)
    pull = stiff * (a - rest)
    return where(abs(pull) > loss, (force - where(pull > 0.0, loss, -loss)) / inertia, a)
