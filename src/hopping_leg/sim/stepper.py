"""The stepper: many legs, many physics steps, compiled once by numba.

At every physics step, in this order: the commands that arrive, the drive's own PD, software limit,
gain, current loop, torque-speed line and saturation, cogging and gear loss; friction, contact,
stops and transmission; the new velocity and position. Legs do not know of each other, though eight
go side by side (``lanes``), so that the results are the same in any company and with any number of
threads, which run without the interpreter's lock.
"""

import math

import numpy as np

from hopping_leg.arrays import Array, Record, Records
from hopping_leg.sim import leg_physics as physics
from hopping_leg.sim.compiled import compiled, inlined
from hopping_leg.sim.lanes import WIDTH, Number, any_of, exp, side_by_side, sincos, spread, where
from hopping_leg.sim.leg_physics import ROW, ROWS, Vector
from hopping_leg.sim.leg_table import LEG

COMMANDS = 8
"""Commands under way at most, the one that is in force not counted."""

COMMAND = 10
"""Numbers of a command: feed-forward torque, stiffness, position, damping and velocity, each of hip
and knee: N m, N m/rad, rad, N m s/rad, rad/s at the joint."""

LOADS = (
    "hip_mean_square_torque", "knee_mean_square_torque", "hip_power", "knee_power", "least_power",
    "hip_peak_speed", "knee_peak_speed", "stop_contact", "ground_force",
)  # fmt: skip
"""What a control period was for the leg: torque in (N m)^2 and mean power of each motor, W, least
power of both, W, highest joint speeds, rad/s, 1 if one was at its stop, ground force at most, N."""

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

_INBOX = np.dtype(
    [("command", "10f8"), ("motors", "6f8"), ("asked", "2f8"), ("in_force", "f8"), ("due", "f8")]
)
"""Scratch of what a leg exchanges alone: its command; its motors' angles, speeds, torques; torques
asked for; the share of a step in which the last command holds; when the next arrives, s."""

_MOTORS, _ASKED, _IN_FORCE, _DUE = COMMAND, COMMAND + 6, COMMAND + 8, COMMAND + 9

_MOTION = np.dtype([("state", np.float64, (6,)), ("push", np.float64)])
_OF_MEMORY = LEG.itemsize // 8  # where lanes of a table's row end
_OF_STATE = _OF_MEMORY + MEMORY.itemsize // 8
_OF_SCRATCH = _OF_STATE + 7
_CHANGING = 13 + len(LOADS)  # numbers of a memory before its command, which steps change
_CONSTRAINTS = ROWS * ROW.itemsize // 8

SCRATCH = _CONSTRAINTS + _INBOX.itemsize // 8
"""Numbers of the scratch of one leg."""

_ALOFT = 1e6  # height of a base that stays where it is, so that nothing touches the ground, m
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
def asked(command: Array, joint: int, angle: Number, speed: Number) -> Number:
    """Return the torque that a command asks of a joint's drive."""
    stiffness, damping = command[2 + joint], command[6 + joint]
    torque, own = command[joint], (stiffness != 0.0) | (damping != 0.0)
    if any_of(own):
        more = stiffness * (command[4 + joint] - angle) + damping * (command[8 + joint] - speed)
        torque = where(own, torque + more, torque)
    return torque


@inlined
def open_inbox(memory: Record, inbox: Array, lane: int) -> None:
    """Show a leg's command that is in force, and when the next arrives."""
    for i in range(COMMAND):
        inbox[i, lane] = memory.command[i]
    inbox[_DUE, lane] = memory.pending[0, 0] if memory.waiting > 0 else np.inf


@inlined
def receive(memory: Record, inbox: Array, lane: int, now: float, dt: float) -> None:
    """Take the commands of one leg that arrive in a step.

    Set the torques asked for, mean over the step, and the share of it in which the last command was
    in force.
    """
    t1, t2 = inbox[_MOTORS, lane], inbox[_MOTORS + 1, lane]
    w1, w2 = inbox[_MOTORS + 2, lane], inbox[_MOTORS + 3, lane]
    hip = knee = 0.0
    rest, arrived = 1.0, 0
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
    for k in range(arrived, waiting):
        for i in range(1 + COMMAND):
            memory.pending[k - arrived, i] = memory.pending[k, i]
    memory.waiting = waiting - arrived
    inbox[_ASKED, lane] = hip + rest * asked(memory.command, 0, t1, w1)
    inbox[_ASKED + 1, lane] = knee + rest * asked(memory.command, 1, t2, w2)
    inbox[_IN_FORCE, lane] = rest
    open_inbox(memory, inbox, lane)


@inlined
def motor_torque(
    p: Record, joint: int, torque: Number, before: Number, speed: Number
) -> tuple[Number, Number]:
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
    limited = (within != torque) | (given != free)
    return given, where(limited, 0.0, p.follow[joint] * p.gain[joint])


@inlined
def after_arrival(
    p: Record, command: Array, joint: int, in_force: Number, mean: Number, angle: Number,
    speed: Number,
) -> Number:  # fmt: skip
    """Return the motor's torque at the end of a step in which a command may have arrived.

    It is the new command's, no mean of both; a current loop that lags knows the mean alone.
    """
    given, _ = motor_torque(p, joint, asked(command, joint, angle, speed), mean, speed)
    return where((in_force < 1.0) & (p.follow[joint] == 1.0), given, mean)


@inlined
def after_gear(p: Record, joint: int, torque: Number, angle: Number, speed: Number) -> Number:
    """Return what arrives at the joint: with cogging, less what the gear loses."""
    cogs = p.ripple[joint] != 0.0
    if any_of(cogs):
        sine, _ = sincos(p.ripple_periods[joint] * angle)
        torque = where(cogs, torque + p.ripple[joint] * sine, torque)
    if any_of(p.log_efficiency[joint] < 0.0):
        share = speed / math.sqrt(speed * speed + _LOSS_SPEED * _LOSS_SPEED)
        torque = torque * exp(p.log_efficiency[joint] * where(torque > 0.0, share, -share))
    return torque


@inlined
def dry_friction(p: Record, joint: int, torque: Number, speed: Number) -> Number:
    """Return a joint's dry friction under a motor's torque (Coulomb, load, Stribeck)."""
    friction = p.friction[joint] + p.load_friction[joint] * abs(torque)
    sticks = (p.stiction[joint] > 0.0) & (abs(speed) < 6.0 * p.stiction_speed[joint])
    if any_of(sticks):
        share = speed / p.stiction_speed[joint]
        more = p.stiction[joint] * exp(-share * share)
        friction = where(sticks, friction + more, friction)
    return friction


@inlined
def through_transmission(
    p: Record, joint: int, torque: Number, loss: Number, q: Number, v: Number, t: Number, w: Number
) -> Vector:
    """Return the torque on a link, the dry friction that holds it, and its rotor's acceleration.

    A rigid link (q, v) is its rotor (t, w), too: torque, damping and friction are its own.
    """
    force, rotor, elastic = torque - p.damping[joint] * v, spread(0.0, v), p.elastic[joint] > 0.0
    if any_of(elastic):
        half, twist = p.half_backlash[joint], t - q
        beyond = twist - min(max(twist, -half), half)
        link = p.belt_stiffness[joint] * beyond + p.belt_damping[joint] * (w - v)
        pull, rest = torque - p.damping[joint] * w - link, -p.friction_damping * w
        stiff = p.friction_stiffness[joint]
        rotor = physics.rotor_acceleration(p.armature[joint], pull, rest, loss, stiff)
        force, loss, rotor = where(elastic, link, force), where(elastic, 0.0, loss), rotor
    return force, loss, where(elastic, rotor, 0.0)


@inlined
def implicit_damping(p: Record, joint: int, relief: Number, dt: float) -> Vector:
    """Return what damping that is implicit in the new velocity adds to a link's inertia.

    Of an elastic joint (link l, rotor r, belt's damping c, armature A) the rows are

        (M + dt c) y_l - dt c y_r = M a_l,    -dt c y_l + (A + dt (d + c)) y_r = A a_r,

    from which y_r is eliminated; the other two numbers are dt c and its factor's inverse, zero for
    a rigid joint. ``relief`` is damping of the drive's own PD.
    """
    drag, tie, ease = dt * (p.damping[joint] + relief), spread(0.0, relief), spread(0.0, relief)
    elastic = p.elastic[joint] > 0.0
    if any_of(elastic):
        tie = where(elastic, dt * p.belt_damping[joint], 0.0)
        ease = where(elastic, 1.0 / (p.armature[joint] + drag + tie), 0.0)
        drag = where(elastic, tie - tie * tie * ease, drag)
    return drag, tie, ease


@inlined
def with_rotor(
    elastic: bool, gain: Number, dt: float, t: Number, w: Number, q: Number, v: Number
) -> tuple[Number, Number]:
    """Return the rotor's new angle and speed, of a rigid joint (q, v)."""
    w = where(elastic, w + dt * gain, v)
    return where(elastic, t + dt * w, q), w


@inlined
def advance(
    p: Record, state: Array, memory: Record, records: Records, past: Array, scratch: Array,
    columns: Array, push: Number, steps: int, dt: float,
) -> None:  # fmt: skip
    """Advance one leg, or lanes, by physics steps.

    Args:
        p: The leg's row of the table, or rows side by side.
        state: (x, q1, q2) of the links and their rates, (6,).
        memory: The leg's ``MEMORY`` but commands, or ``MEMORY`` side by side.
        records: The ``MEMORY`` of each leg, (n,).
        past: Rings of what the sensors saw, (n, k, 6); empty if nothing needs it.
        scratch: ``SCRATCH`` numbers, of each.
        columns: Those behind the constraints, a column for each leg.
        push: Upward force on the base, N.
        steps: How many.
        dt: Physics step, s.
    """
    rows, inbox = side_by_side(scratch, ROW), side_by_side(scratch[_CONSTRAINTS:], _INBOX)
    for k in range(len(records)):
        open_inbox(records[k], columns, k)
    zero, one = spread(0.0, push), spread(1.0, push)
    x, q1, q2, v0, v1, v2 = state[0], state[1], state[2], state[3], state[4], state[5]
    t1, t2, w1, w2 = memory.rotor[0], memory.rotor[1], memory.rotor[2], memory.rotor[3]
    on_boom, a = p.boom_radius > 0.0, memory.acceleration
    a = (a[0], a[1], a[2], where(on_boom, a[3], 0.0))
    drift, boom = where(on_boom, memory.forward, 0.0), any_of(on_boom)
    radius, moving = where(on_boom, p.boom_radius, 1.0), ((zero, zero, zero), one, zero, boom)
    hip, knee = memory.motor_torque[0], memory.motor_torque[1]
    elastic1, elastic2 = p.elastic[0] > 0.0, p.elastic[1] > 0.0
    fixed = p.fixed_base > 0.0
    armature1, armature2 = p.armature[0], p.armature[1]
    stiff = (p.rail_friction_stiffness, p.friction_stiffness[0], p.friction_stiffness[1])
    soft = (1.0 / stiff[0], 1.0 / stiff[1], 1.0 / stiff[2])
    rail = where(fixed, 0.0, p.rail_friction)
    rail_drag = where(fixed, 0.0, dt * p.rail_damping)
    mean1 = mean2 = square1 = square2 = power1 = power2 = peak1 = peak2 = stop = most = zero
    least = spread(np.inf, push)
    t1, w1 = where(elastic1, t1, q1), where(elastic1, w1, v1)
    t2, w2 = where(elastic2, t2, q2), where(elastic2, w2, v2)
    for step in range(steps):
        # The drives: torques of motors and gears, dry friction.
        asked1, asked2 = asked(inbox.command, 0, t1, w1), asked(inbox.command, 1, t2, w2)
        arrives = inbox.due < step * dt + dt
        if any_of(arrives):
            inbox.motors[0], inbox.motors[1], inbox.motors[2], inbox.motors[3] = t1, t2, w1, w2
            for k in range(len(records)):
                if columns[_DUE, k] < step * dt + dt:
                    receive(records[k], columns, k, step * dt, dt)
            asked1 = where(arrives, inbox.asked[0], asked1)
            asked2 = where(arrives, inbox.asked[1], asked2)
        hip, response1 = motor_torque(p, 0, asked1, hip, w1)
        knee, response2 = motor_torque(p, 1, asked2, knee, w2)
        relief1, relief2 = response1 * inbox.command[6], response2 * inbox.command[7]
        loss1, loss2 = dry_friction(p, 0, hip, w1), dry_friction(p, 1, knee, w2)
        force1, loss1, rotor1 = through_transmission(
            p, 0, after_gear(p, 0, hip, t1, w1), loss1, q1, v1, t1, w1
        )
        force2, loss2, rotor2 = through_transmission(
            p, 1, after_gear(p, 1, knee, t2, w2), loss2, q2, v2, t2, w2
        )

        # Mass matrix M and forces f - b.
        s1, c1 = sincos(q1)
        s12, c12 = sincos(q1 + q2)
        m = physics.mass_matrix(p, s1, s12, c1 * c12 + s1 * s12)
        bend = p.coupling * (s12 * c1 - c12 * s1)
        v12 = v1 + v2
        swing = p.thigh_moment * c1 * v1 * v1 + p.shank_moment * c12 * v12 * v12
        force0 = push - p.weight - swing - p.rail_damping * v0
        force1 += bend * v2 * (v1 + v12) - p.gravity * m[1]
        force2 -= bend * v1 * v1 + p.gravity * m[2]

        if boom:  # its arc makes it heavier away from its pivot's height
            lean = where(on_boom, (x - p.boom_pivot) / radius, 0.0)
            level = 1.0 - lean * lean
            force0 -= p.mass * lean / (radius * level * level) * v0 * v0
            m = (p.mass / level, m[1], m[2], m[3], m[4], m[5])
            thigh = where(on_boom, p.thigh_moment, 0.0)
            shank = where(on_boom, p.shank_moment, 0.0)
            tie, fold = where(on_boom, p.forward_mass, 1.0), shank * c12
            swing = thigh * s1 * v1 * v1 + shank * s12 * v12 * v12
            moving = ((zero, thigh * c1 + fold, fold), tie, swing, boom)

        # Constraints, and the acceleration under them.
        speed, height = (v0, v1, v2), x
        if any_of(fixed):
            m0, m1, m2 = where(fixed, 1.0, m[0]), where(fixed, 0.0, m[1]), where(fixed, 0.0, m[2])
            m = (m0, m1, m2, m[3], m[4], m[5])
            force0, height = where(fixed, 0.0, force0), where(fixed, _ALOFT, x)
        count = physics.add_contacts(p, rows, height, speed, s1, c1, s12, c12, drift)
        count, stop1 = physics.add_stop(p, rows, count, 0, q1, v1)
        count, stop2 = physics.add_stop(p, rows, count, 1, q2, v2)
        b = -p.friction_damping
        loss = (rail, loss1, loss2)
        bound = (rail * soft[0], loss1 * soft[1], loss2 * soft[2])
        hold = (
            where(rail > 0.0, stiff[0], 0.0), where(loss1 > 0.0, stiff[1], 0.0),
            where(loss2 > 0.0, stiff[2], 0.0),
        )  # fmt: skip
        friction = (loss, hold, (b * v0, b * v1, b * v2), bound)
        force = (force0, force1, force2)
        a = physics.constrained_acceleration(m, force, moving, friction, rows, count, a)

        # The new velocity, in which damping is implicit, and the position that follows it.
        f0, f1, f2 = physics.times(m, (a[0], a[1], a[2]))
        drag1, tie1, ease1 = implicit_damping(p, 0, relief1, dt)
        drag2, tie2, ease2 = implicit_damping(p, 1, relief2, dt)
        f1 += tie1 * ease1 * armature1 * rotor1
        f2 += tie2 * ease2 * armature2 * rotor2
        damped = (m[0] + rail_drag, m[1], m[2], m[3] + drag1, m[4], m[5] + drag2)
        c, mass, _, _ = moving
        f1, f2 = f1 + c[1] * a[3], f2 + c[2] * a[3]
        pull = c[1] * a[1] + c[2] * a[2] + mass * a[3]
        y0, y1, y2, y3 = physics.solve_all(damped, c, mass, (f0, f1, f2), pull, boom)
        drift += dt * y3
        v0, v1, v2 = v0 + dt * y0, v1 + dt * y1, v2 + dt * y2
        x, q1, q2 = x + dt * v0, q1 + dt * v1, q2 + dt * v2
        gain1 = ease1 * (armature1 * rotor1 + tie1 * y1)
        gain2 = ease2 * (armature2 * rotor2 + tie2 * y2)
        t1, w1 = with_rotor(elastic1, gain1, dt, t1, w1, q1, v1)
        t2, w2 = with_rotor(elastic2, gain2, dt, t2, w2, q2, v2)

        # What it was for the motors, and what their sensors see.
        mean1, mean2 = mean1 + hip, mean2 + knee
        square1, square2 = square1 + hip * hip, square2 + knee * knee
        power1, power2 = power1 + hip * w1, power2 + knee * w2
        least = min(least, hip * w1 + knee * w2)
        peak1, peak2 = max(peak1, abs(v1)), max(peak2, abs(v2))
        stop = max(stop, max(stop1, stop2))
        rubs, _ = physics.friction_slope(0, a, friction, physics.sliding(a, friction))
        most = max(most, f0 + rubs - force0)
        if any_of(arrives):
            in_force = where(arrives, inbox.in_force, 1.0)
            hip = after_arrival(p, inbox.command, 0, in_force, hip, t1, w1)
            knee = after_arrival(p, inbox.command, 1, in_force, knee, t2, w2)
        if past.shape[1]:
            inbox.motors[0], inbox.motors[1], inbox.motors[2] = t1, t2, w1
            inbox.motors[3], inbox.motors[4], inbox.motors[5] = w2, hip, knee
            for k in range(len(records)):
                slot = int(records[k].newest) + 1
                if slot == past.shape[1]:
                    slot = 0
                records[k].newest = slot
                for i in range(6):
                    past[k, slot, i] = columns[_MOTORS + i, k]
    for k in range(len(records)):
        for i in range(int(records[k].waiting)):
            records[k].pending[i, 0] -= steps * dt
    state[0], state[1], state[2], state[3], state[4], state[5] = x, q1, q2, v0, v1, v2
    memory.rotor[0], memory.rotor[1], memory.rotor[2], memory.rotor[3] = t1, t2, w1, w2
    memory.acceleration[0], memory.acceleration[1] = a[0], a[1]
    memory.acceleration[2], memory.acceleration[3], memory.forward = a[2], a[3], drift
    memory.motor_torque[0], memory.motor_torque[1] = hip, knee
    memory.mean_torque[0], memory.mean_torque[1] = mean1 / steps, mean2 / steps
    loads = memory.loads
    loads[0], loads[1] = square1 / steps, square2 / steps
    loads[2], loads[3] = power1 / steps, power2 / steps
    loads[4], loads[5], loads[6], loads[7], loads[8] = least, peak1, peak2, stop, most


@compiled
def step_leg(
    p: Record, state: Array, leg: Records, past: Array, scratch: Array, push: float, steps: int,
    dt: float,
) -> None:  # fmt: skip
    """Advance one leg, see ``advance``; its ``MEMORY`` is (1,), ``past`` is (k, 6)."""
    columns = scratch[_CONSTRAINTS:, np.newaxis]
    advance(p, state, leg[0], leg, past[np.newaxis], scratch, columns, push, steps, dt)


@compiled
def step_legs(
    table: Records, state: Array, memory: Records, past: Array, command: Array, jitter: Array,
    push: Array, first: int, last: int, steps: int, dt: float,
) -> None:  # fmt: skip
    """Send commands to the legs from ``first`` to before ``last`` and advance these.

    Commands are (n, ``COMMAND``); ``jitter`` is the share of it, [0, 1), (n,).
    """
    for k in range(first, last):
        p = table[k]
        send(memory[k], command[k], p.command_latency + jitter[k] * p.command_jitter)
    # Numbers of lanes, aligned: rows of the table, memory, state and push, scratch.
    flat = np.empty((_OF_SCRATCH + SCRATCH + 1) * WIDTH)
    skip = -(flat.ctypes.data // 8) % WIDTH
    space = flat[skip : len(flat) - WIDTH + skip].reshape(_OF_SCRATCH + SCRATCH, WIDTH)
    motion = side_by_side(space[_OF_STATE:], _MOTION)
    fixed = table.view(np.float64).reshape(len(table), _OF_MEMORY)
    kept = memory.view(np.float64).reshape(len(table), _OF_STATE - _OF_MEMORY)
    whole = last - (last - first) % WIDTH
    for k in range(first, whole, WIDTH):
        for lane in range(WIDTH):
            for i in range(_OF_MEMORY):
                space[i, lane] = fixed[k + lane, i]
            for i in range(_CHANGING):
                space[_OF_MEMORY + i, lane] = kept[k + lane, i]
            for i in range(6):
                space[_OF_STATE + i, lane] = state[k + lane, i]
            space[_OF_STATE + 6, lane] = push[k + lane]
        wide, own = side_by_side(space, LEG), side_by_side(space[_OF_MEMORY:], MEMORY)
        these, rings, scratch = memory[k : k + WIDTH], past[k : k + WIDTH], space[_OF_SCRATCH:]
        columns, push_of = scratch[_CONSTRAINTS:], motion.push
        advance(wide, motion.state, own, these, rings, scratch, columns, push_of, steps, dt)
        for lane in range(WIDTH):
            for i in range(_CHANGING):
                kept[k + lane, i] = space[_OF_MEMORY + i, lane]
            for i in range(6):
                state[k + lane, i] = space[_OF_STATE + i, lane]
    alone = np.empty(SCRATCH)
    for k in range(whole, last):
        leg = memory[k : k + 1]
        step_leg(table[k], state[k], leg, past[k], alone, push[k], steps, dt)


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
