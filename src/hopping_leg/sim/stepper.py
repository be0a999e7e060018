"""The stepper: many legs, many physics steps, compiled once by numba.

At every physics step, in this order: the commands that arrive, the drive's own PD, software limit,
gain, current loop, torque-speed line and saturation, cogging and gear loss; friction, contact,
stops and transmission; the new velocity and position. Legs do not know of each other, so that the
results are the same with any number of threads, which run without the interpreter's lock.
"""

import math

import numpy as np

from hopping_leg.arrays import Array, Record, Records
from hopping_leg.sim.compiled import compiled, inlined
from hopping_leg.sim.leg_physics import (
    SCRATCH,
    add_contacts,
    add_stops,
    constrained_acceleration,
    mass_matrix,
    rotor_acceleration,
    solve,
    solve_forward,
    times,
)  # fmt: skip

COMMANDS = 8
"""Commands under way at most, the one that is in force not counted."""

COMMAND = 10
"""Numbers of a command: feed-forward torque, stiffness, position, damping and velocity, each of hip
and knee: N m, N m/rad, rad, N m s/rad, rad/s at the joint."""

LOADS = (
    "hip_mean_square_torque", "knee_mean_square_torque", "hip_power", "knee_power", "least_power",
    "hip_peak_speed", "knee_peak_speed", "stop_contact",
)  # fmt: skip
"""What a control period was for the motors: torque in (N m)^2 and mean mechanical power of each, W,
least power of both together, W, highest speeds of the joints, rad/s, 1 if one was at its stop."""

MEMORY = np.dtype(
    [
        ("rotor", np.float64, (4,)),  # angles and speeds behind elastic transmissions
        ("acceleration", np.float64, (4,)),
        ("forward", np.float64),  # velocity of the base on a boom
        ("motor_torque", np.float64, (2,)),
        ("mean_torque", np.float64, (2,)),
        ("loads", np.float64, (len(LOADS),)),
        ("command", np.float64, (COMMAND,)),
        ("pending", np.float64, (COMMANDS, 1 + COMMAND)),  # by time of arrival
        ("waiting", np.float64),
        ("newest", np.float64),
    ]
)
"""What a leg remembers besides its state, all float64."""

_LOSS_SPEED = 0.1  # joint speed below which a gear's loss fades: power has no direction at rest


@inlined
def send(memory: Record, command: Array, arrival: float) -> None:
    """Put a command under way that arrives so many seconds from now.

    It replaces those that would arrive later: none overtakes another.
    """
    count = int(memory.waiting)
    while count > 0 and memory.pending[count - 1, 0] >= arrival:
        count -= 1
    count = min(count, COMMANDS - 1)
    memory.pending[count, 0] = arrival
    for i in range(COMMAND):
        memory.pending[count, 1 + i] = command[i]
    memory.waiting = count + 1


@inlined
def copy_memory(source: Record, target: Record) -> None:
    """Copy what a leg's next steps depend on."""
    for i in range(4):
        target.rotor[i] = source.rotor[i]
    for i in range(4):
        target.acceleration[i] = source.acceleration[i]
    target.forward = source.forward
    for i in range(2):
        target.motor_torque[i] = source.motor_torque[i]
    for i in range(COMMAND):
        target.command[i] = source.command[i]
    for k in range(int(source.waiting)):
        for i in range(1 + COMMAND):
            target.pending[k, i] = source.pending[k, i]
    target.waiting = source.waiting


@inlined
def asked(command: Array, joint: int, angle: float, speed: float) -> float:
    """Return the torque that a command asks of a joint's drive."""
    torque: float = command[joint]
    if command[2 + joint] != 0 or command[6 + joint] != 0:
        torque += command[2 + joint] * (command[4 + joint] - angle)
        torque += command[6 + joint] * (command[8 + joint] - speed)
    return torque


@inlined
def receive(
    memory: Record, now: float, dt: float, t1: float, w1: float, t2: float, w2: float
) -> tuple[float, float, float]:
    """Take the commands that arrive in a step.

    Return the torques asked for, mean over the step, and the share of it in which the last command
    was in force.
    """
    hip = knee = 0.0
    rest = 1.0
    arrived = 0
    waiting = int(memory.waiting)
    while arrived < waiting and memory.pending[arrived, 0] < now + dt:
        share = min(max((memory.pending[arrived, 0] - now) / dt, 0.0) - (1 - rest), rest)
        if share > 0:
            hip += share * asked(memory.command, 0, t1, w1)
            knee += share * asked(memory.command, 1, t2, w2)
            rest -= share
        for i in range(COMMAND):
            memory.command[i] = memory.pending[arrived, 1 + i]
        arrived += 1
    if arrived > 0:
        for k in range(arrived, waiting):
            for i in range(1 + COMMAND):
                memory.pending[k - arrived, i] = memory.pending[k, i]
        memory.waiting = waiting - arrived
    hip += rest * asked(memory.command, 0, t1, w1)
    knee += rest * asked(memory.command, 1, t2, w2)
    return hip, knee, rest


@inlined
def motor_torque(
    p: Record, joint: int, torque: float, before: float, speed: float
) -> tuple[float, float]:
    """Return what the motor gives, at the joint, if asked for ``torque`` and giving ``before``.

    Where it drives, the torque-speed line bounds it: from the stall torque at rest to none at the
    no-load speed. The second number is the derivative by what is asked: none where a limit holds.
    """
    limit = p.torque_limit[joint]
    within = min(max(torque, -limit), limit)
    free = before + p.follow[joint] * (p.gain[joint] * within - before)
    drop = p.speed_slope[joint] * speed
    upper = min(max(p.stall_torque[joint] - drop, 0.0), p.saturation[joint])
    lower = max(min(-p.stall_torque[joint] - drop, 0.0), -p.saturation[joint])
    given = min(max(free, lower), upper)
    limited = within != torque or given != free
    return given, 0.0 if limited else p.follow[joint] * p.gain[joint]


@inlined
def after_arrival(
    p: Record, command: Array, joint: int, mean: float, angle: float, speed: float
) -> float:
    """Return the motor's torque at the end of a step in which a command arrived.

    It is the new command's, no mean of both; a current loop that lags knows the mean alone.
    """
    if p.follow[joint] < 1:
        return mean
    given, _ = motor_torque(p, joint, asked(command, joint, angle, speed), mean, speed)
    return given


@inlined
def after_gear(p: Record, joint: int, torque: float, angle: float, speed: float) -> float:
    """Return what arrives at the joint: with cogging, less what the gear loses."""
    if p.ripple[joint] != 0:
        torque += p.ripple[joint] * math.sin(p.ripple_periods[joint] * angle)
    if p.log_efficiency[joint] < 0:
        share = speed / math.sqrt(speed * speed + _LOSS_SPEED * _LOSS_SPEED)
        torque *= math.exp(p.log_efficiency[joint] * (share if torque > 0 else -share))
    return torque


@inlined
def dry_friction(p: Record, joint: int, torque: float, speed: float) -> float:
    """Return a joint's dry friction under a motor's torque (Coulomb, load, Stribeck)."""
    friction: float = p.friction[joint] + p.load_friction[joint] * abs(torque)
    if p.stiction[joint] > 0 and abs(speed) < 6 * p.stiction_speed[joint]:
        friction += p.stiction[joint] * math.exp(-((speed / p.stiction_speed[joint]) ** 2))
    return friction


@inlined
def transmitted(p: Record, joint: int, twist: float, rate: float) -> float:
    """Return the torque of an elastic transmission with a dead band."""
    half = p.half_backlash[joint]
    beyond = twist - min(max(twist, -half), half)
    return p.belt_stiffness[joint] * beyond + p.belt_damping[joint] * rate


@inlined
def through_transmission(
    p: Record, joint: int, torque: float, loss: float, q: float, v: float, t: float, w: float
) -> tuple[float, float, float]:
    """Return the torque on a link, the dry friction that holds it, and its rotor's acceleration.

    A rigid link (q, v) is its rotor (t, w), too: torque, damping and friction are its own.
    """
    if p.elastic[joint] == 0:
        return torque - p.damping[joint] * v, loss, 0.0
    link = transmitted(p, joint, t - q, w - v)
    pull, rest = torque - p.damping[joint] * w - link, -p.friction_damping * w
    stiff = p.friction_stiffness[joint]
    return link, 0.0, rotor_acceleration(p.armature[joint], pull, rest, loss, stiff)


@inlined
def implicit_damping(p: Record, joint: int, relief: float, dt: float) -> tuple[float, float, float]:
    """Return what damping that is implicit in the new velocity adds to a link's inertia.

    Of an elastic joint (link l, rotor r, belt's damping c, armature A) the rows are

        (M + dt c) y_l - dt c y_r = M a_l,    -dt c y_l + (A + dt (d + c)) y_r = A a_r,

    from which y_r is eliminated; the other two numbers are dt c and its factor's inverse, zero for
    a rigid joint. ``relief`` is damping of the drive's own PD.
    """
    drag = dt * (p.damping[joint] + relief)
    if p.elastic[joint] == 0:
        return drag, 0.0, 0.0
    tie = dt * p.belt_damping[joint]
    ease = 1 / (p.armature[joint] + drag + tie)
    return tie - tie * tie * ease, tie, ease


@inlined
def advance(
    p: Record,
    state: Array,
    memory: Record,
    past: Array,
    rows: Array,
    push: float,
    steps: int,
    dt: float,
    forward: bool,
) -> None:
    """Advance one leg by physics steps.

    Args:
        p: The leg's row of the table.
        state: (x, q1, q2) of the links and their rates, (6,).
        memory: The leg's ``MEMORY``.
        past: Ring of what the sensors saw, (k, 6); empty if nothing needs it.
        rows: Scratch for constraints, ``SCRATCH``.
        push: Upward force on the base, N.
        steps: How many.
        dt: Physics step, s.
        forward: Whether it is on a boom and moves forward, or on the rail.
    """
    x, q1, q2, v0, v1, v2 = state[0], state[1], state[2], state[3], state[4], state[5]
    t1, t2, w1, w2 = memory.rotor[0], memory.rotor[1], memory.rotor[2], memory.rotor[3]
    a = (memory.acceleration[0], memory.acceleration[1], memory.acceleration[2], 0.0)
    drift, moving = 0.0, ((0.0, 0.0, 0.0), 1.0, 0.0)
    if forward:
        drift = memory.forward
        a = (a[0], a[1], a[2], memory.acceleration[3])
    hip, knee = memory.motor_torque[0], memory.motor_torque[1]
    elastic1, elastic2 = p.elastic[0] > 0, p.elastic[1] > 0
    fixed = p.fixed_base > 0
    armature1, armature2 = p.armature[0], p.armature[1]
    stiff = (p.rail_friction_stiffness, p.friction_stiffness[0], p.friction_stiffness[1])
    soft = (1 / stiff[0], 1 / stiff[1], 1 / stiff[2])
    rail = 0.0 if fixed else p.rail_friction
    rail_drag = 0.0 if fixed else dt * p.rail_damping
    mean1 = mean2 = square1 = square2 = power1 = power2 = 0.0
    least, peak1, peak2, stop = np.inf, 0.0, 0.0, 0.0
    if not elastic1:
        t1, w1 = q1, v1
    if not elastic2:
        t2, w2 = q2, v2
    for step in range(steps):
        # The drives: torques of motors and gears, dry friction.
        asked1, asked2, in_force = receive(memory, step * dt, dt, t1, w1, t2, w2)
        hip, response1 = motor_torque(p, 0, asked1, hip, w1)
        knee, response2 = motor_torque(p, 1, asked2, knee, w2)
        relief1, relief2 = response1 * memory.command[6], response2 * memory.command[7]
        loss1, loss2 = dry_friction(p, 0, hip, w1), dry_friction(p, 1, knee, w2)
        force1, loss1, rotor1 = through_transmission(
            p, 0, after_gear(p, 0, hip, t1, w1), loss1, q1, v1, t1, w1
        )
        force2, loss2, rotor2 = through_transmission(
            p, 1, after_gear(p, 1, knee, t2, w2), loss2, q2, v2, t2, w2
        )

        # Mass matrix M and forces f - b.
        s1, c1, s12, c12 = math.sin(q1), math.cos(q1), math.sin(q1 + q2), math.cos(q1 + q2)
        m = mass_matrix(p, s1, s12, c1 * c12 + s1 * s12)
        bend = p.coupling * (s12 * c1 - c12 * s1)
        v12 = v1 + v2
        swing = p.thigh_moment * c1 * v1 * v1 + p.shank_moment * c12 * v12 * v12
        force0 = push - p.weight - swing - p.rail_damping * v0
        force1 += bend * v2 * (v1 + v12) - p.gravity * m[1]
        force2 -= bend * v1 * v1 + p.gravity * m[2]

        if forward:  # the boom's arc makes it heavier away from its pivot's height
            lean = (x - p.boom_pivot) / p.boom_radius
            level = 1 - lean * lean
            force0 -= p.mass * lean / (p.boom_radius * level * level) * v0 * v0
            m = (p.mass / level, m[1], m[2], m[3], m[4], m[5])
            fold = p.shank_moment * c12
            swing = p.thigh_moment * s1 * v1 * v1 + p.shank_moment * s12 * v12 * v12
            moving = ((0.0, p.thigh_moment * c1 + fold, fold), p.forward_mass, swing)

        # Constraints, and the acceleration under them.
        speed = (v0, v1, v2)
        touching = 0
        if fixed:
            m = (1.0, 0.0, 0.0, m[3], m[4], m[5])
            force0 = 0.0
        else:
            touching = add_contacts(p, rows, x, speed, s1, c1, s12, c12, drift)
        count = add_stops(p, rows, touching, (x, q1, q2), speed)
        if count > touching:
            stop = 1.0
        b = -p.friction_damping
        loss = (rail, loss1, loss2)
        bound = (rail * soft[0], loss1 * soft[1], loss2 * soft[2])
        friction = (loss, stiff, (b * v0, b * v1, b * v2), bound)
        force = (force0, force1, force2)
        a = constrained_acceleration(m, force, moving, friction, rows, count, a, forward)

        # The new velocity, in which damping is implicit, and the position that follows it.
        f0, f1, f2 = times(m, (a[0], a[1], a[2]))
        drag1, tie1, ease1 = implicit_damping(p, 0, relief1, dt)
        drag2, tie2, ease2 = implicit_damping(p, 1, relief2, dt)
        f1 += tie1 * ease1 * armature1 * rotor1
        f2 += tie2 * ease2 * armature2 * rotor2
        damped = (m[0] + rail_drag, m[1], m[2], m[3] + drag1, m[4], m[5] + drag2)
        if forward:
            c, mass, _ = moving
            f1, f2 = f1 + c[1] * a[3], f2 + c[2] * a[3]
            pull = c[1] * a[1] + c[2] * a[2] + mass * a[3]
            y0, y1, y2, y3 = solve_forward(damped, c, mass, (f0, f1, f2), pull)
            drift += dt * y3
        else:
            y0, y1, y2 = solve(damped, (f0, f1, f2))
        v0, v1, v2 = v0 + dt * y0, v1 + dt * y1, v2 + dt * y2
        x, q1, q2 = x + dt * v0, q1 + dt * v1, q2 + dt * v2
        if elastic1:
            w1 += dt * ease1 * (armature1 * rotor1 + tie1 * y1)
            t1 += dt * w1
        else:
            t1, w1 = q1, v1
        if elastic2:
            w2 += dt * ease2 * (armature2 * rotor2 + tie2 * y2)
            t2 += dt * w2
        else:
            t2, w2 = q2, v2

        # What it was for the motors, and what their sensors see.
        mean1, mean2 = mean1 + hip, mean2 + knee
        square1, square2 = square1 + hip * hip, square2 + knee * knee
        power1, power2 = power1 + hip * w1, power2 + knee * w2
        least = min(least, hip * w1 + knee * w2)
        peak1, peak2 = max(peak1, abs(v1)), max(peak2, abs(v2))
        if in_force < 1:
            hip = after_arrival(p, memory.command, 0, hip, t1, w1)
            knee = after_arrival(p, memory.command, 1, knee, t2, w2)
        if len(past):
            slot = int(memory.newest) + 1
            if slot == len(past):
                slot = 0
            memory.newest = slot
            seen = past[slot]
            seen[0], seen[1], seen[2], seen[3], seen[4], seen[5] = t1, t2, w1, w2, hip, knee
    for k in range(int(memory.waiting)):
        memory.pending[k, 0] -= steps * dt
    state[0], state[1], state[2], state[3], state[4], state[5] = x, q1, q2, v0, v1, v2
    memory.rotor[0], memory.rotor[1], memory.rotor[2], memory.rotor[3] = t1, t2, w1, w2
    memory.acceleration[0], memory.acceleration[1], memory.acceleration[2] = a[0], a[1], a[2]
    if forward:
        memory.forward, memory.acceleration[3] = drift, a[3]
    memory.motor_torque[0], memory.motor_torque[1] = hip, knee
    memory.mean_torque[0], memory.mean_torque[1] = mean1 / steps, mean2 / steps
    loads = memory.loads
    loads[0], loads[1] = square1 / steps, square2 / steps
    loads[2], loads[3] = power1 / steps, power2 / steps
    loads[4], loads[5], loads[6], loads[7] = least, peak1, peak2, stop


@compiled
def step_leg(
    p: Record,
    state: Array,
    memory: Record,
    past: Array,
    rows: Array,
    push: float,
    steps: int,
    dt: float,
) -> None:
    """Advance one leg on its rail, see ``advance``."""
    advance(p, state, memory, past, rows, push, steps, dt, False)


@compiled
def step_leg_on_boom(
    p: Record,
    state: Array,
    memory: Record,
    past: Array,
    rows: Array,
    push: float,
    steps: int,
    dt: float,
) -> None:
    """Advance one leg on its boom, see ``advance``."""
    advance(p, state, memory, past, rows, push, steps, dt, True)


@compiled
def step_legs(
    table: Records,
    state: Array,
    memory: Records,
    past: Array,
    command: Array,
    jitter: Array,
    push: Array,
    first: int,
    last: int,
    steps: int,
    dt: float,
) -> None:
    """Send commands to the legs from ``first`` to before ``last`` and advance these.

    Commands are (n, ``COMMAND``); ``jitter`` is the share of it, [0, 1), (n,).
    """
    rows = np.empty(SCRATCH)
    for k in range(first, last):
        p, leg = table[k], memory[k]
        send(leg, command[k], p.command_latency + jitter[k] * p.command_jitter)
        if p.boom_radius > 0:
            step_leg_on_boom(p, state[k], leg, past[k], rows, push[k], steps, dt)
        else:
            step_leg(p, state[k], leg, past[k], rows, push[k], steps, dt)


@compiled
def read_sensors(
    table: Records, memory: Records, past: Array, draws: Array, reading: Array, dt: float
) -> None:
    """Set what each leg's sensors report at the end of a control period.

    Late positions and velocities are interpolated between physics steps; torques are those of the
    step, as a blend of two commands is none that any motor gave.

    Args:
        table: Rows of ``LEG``, (n,).
        memory: Rows of ``MEMORY``, (n,).
        past: Rings of true values after each physics step, (n, k, 6).
        draws: Standard normal, (n, 6).
        reading: Position, velocity and torque of hip and knee, (n, 6); set.
        dt: Physics step, s.
    """
    depth = past.shape[1]
    for k in range(len(memory)):
        p, leg = table[k], memory[k]
        back = p.measurement_latency / dt
        whole = int(back)
        near, far = int(leg.newest) - whole, int(leg.newest) - whole - 1
        for i in range(6):
            if back == 0:
                value = leg.rotor[i] if i < 4 else leg.motor_torque[i - 4]
            else:
                value = past[k, near % depth, i]
                if i < 4:
                    value += (back - whole) * (past[k, far % depth, i] - value)
            if p.sensor_noise[i] > 0:
                value += p.sensor_noise[i] * draws[k, i]
            step = p.sensor_step[i]
            reading[k, i] = round(value / step) * step if step > 0 else value


def rounded(values: Array, step: Array) -> Array:
    """Return values rounded to steps, zero for none."""
    safe = np.where(step > 0, step, 1.0)
    return np.where(step > 0, np.round(values / safe) * safe, values)
