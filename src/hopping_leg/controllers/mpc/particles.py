"""A step of a particle filter, compiled: particles move, are corrected, weighed and resampled.

See ``particle_filter`` for what it does. ``believed`` is the row of the leg's file (``leg_table``),
``how`` the record of ``FilterOptions``, ``scale`` that of the noise's variances in the air and on
the ground.
"""

import math

import numpy as np

from hopping_leg.arrays import Array, BoolArray, IntArray, Record, Records
from hopping_leg.sim import stepper
from hopping_leg.sim.channel import DELAY_DEPTH
from hopping_leg.sim.compiled import compiled, inlined
from hopping_leg.sim.leg_physics import ROWS

AIR, GROUND = 0, 1

DEPTH = DELAY_DEPTH + 1
"""Ticks in which a late sample still counts."""

DRAWS = 13
"""Standard normal numbers per particle and tick."""

FAR = 100.0
"""Angle, rad, height, m, and speeds of the same that no leg has."""

SLOWLY = 0.02
"""Weight of a tick in what is usual."""

PARTICLE = np.dtype(
    [
        ("state", np.float64, (6,)),
        ("apex", np.float64),  # highest since lift-off
        ("log_weight", np.float64),
        ("parameters", np.float64, (4,)),
        ("past", np.float64, (DEPTH, 4)),  # joints by tick
    ]
)


@inlined
def _set_row(believed: Record, parameters: Array, row: Record) -> None:
    mass = believed.mass * math.exp(parameters[0])
    row.mass = mass
    row.base_softness = 1 / (3 * mass)
    row.shank_softness = believed.shank_softness + (1 / mass - 1 / believed.mass) / 3
    row.rail_friction_stiffness = believed.rail_friction_stiffness * mass / believed.mass
    row.rail_friction = max(believed.rail_friction + parameters[1], 0.0)
    slower = math.exp(parameters[2])
    row.contact_stiffness = believed.contact_stiffness / (slower * slower)
    row.contact_damping = believed.contact_damping / slower
    row.gain[0], row.gain[1] = believed.gain[0], believed.gain[1] * math.exp(parameters[3])


@inlined
def _stand(p: Record, state: Array) -> tuple[float, float]:
    """Return height and speed of the base if the foot stands on hard ground."""
    l1, l2 = p.thigh_length, p.shank_length
    q12 = state[1] + state[2]
    down = l1 * math.cos(state[1]) + l2 * math.cos(q12)
    rate = -l1 * math.sin(state[1]) * state[4] - l2 * math.sin(q12) * (state[4] + state[5])
    return down + p.foot_radius, rate


@compiled
def predict(
    believed: Record, row: Record, particles: Records, memory: Record, scratch: Record,
    draws: Array, scale: Array, how: Record, period: float,
) -> None:  # fmt: skip
    """Advance a leg's particles by a control period, and its commands under way."""
    work, past = np.empty((ROWS, 5)), np.empty((0, 6))
    steps = int(how.steps)
    for i in range(len(particles)):
        x, draw = particles[i], draws[i]
        state = x.state
        _set_row(believed, x.parameters, row)
        for j in range(2):
            row.gain[j] *= 1 + how.torque_noise * draw[j]
        stood = state[0] < _stand(believed, state)[0]
        state[3] += how.rail_noise * scale[GROUND if stood else AIR] * draw[2]
        stepper.copy_memory(memory, scratch)
        stepper.step_leg(row, state, scratch, past, work, 0.0, steps, period / steps)
        if stood and state[0] >= _stand(believed, state)[0]:
            x.apex = 0.0
        if state[3] > 0:
            x.apex = max(x.apex, state[0])
    stepper.copy_memory(scratch, memory)


@inlined
def _set_gain(
    how: Record, scale: float, share: float, angle: float, speed: float, period: float, gain: Array
) -> None:
    """Set what corrects a joint by its angle and speed, (11,).

    These are the Kalman gain (4), the inverse of the innovation's covariance (3), half of the
    logarithm of its determinant, and the Cholesky factor of what remains unknown (3).
    """
    d = scale * how.speed_noise**2
    a, c = d * period * period / 4 + scale * how.angle_noise**2, d * period / 2
    s11 = a + scale * how.measured_angle**2 + (share * angle) ** 2
    s22 = d + scale * how.measured_speed**2 + (share * speed) ** 2
    det = s11 * s22 - c * c
    i11, i12, i22 = s22 / det, -c / det, s11 / det
    k11, k12, k21, k22 = a * i11 + c * i12, a * i12 + c * i22, c * i11 + d * i12, c * i12 + d * i22
    gain[0], gain[1], gain[2], gain[3] = k11, k12, k21, k22
    gain[4], gain[5], gain[6], gain[7] = i11, i12, i22, math.log(det) / 2
    gain[8] = math.sqrt(max(a - k11 * a - k12 * c, 0.0))
    gain[9] = (c - k11 * c - k12 * d) / gain[8] if gain[8] > 0 else 0.0
    gain[10] = math.sqrt(max(d - k21 * c - k22 * d - gain[9] * gain[9], 0.0))


@inlined
def _correct(
    believed: Record, x: Record, sample: Array, gains: Array, draw: Array, tail: float
) -> tuple[bool, float, float]:
    """Correct a particle by a fresh sample.

    Returns whether it stands, its innovation (one as expected) and the likelihood's logarithm.
    """
    state = x.state
    height, rate = _stand(believed, state)
    stands = state[0] < height
    hip, knee = state[4], state[5]
    surprise = log = 0.0
    for j in range(2):
        k = gains[GROUND if stands else AIR, j]
        e, f = sample[j] - state[1 + j], sample[2 + j] - state[4 + j]
        square = e * e * k[4] + 2 * e * f * k[5] + f * f * k[6]
        surprise += square / 4
        log -= (1 + tail / 2) * math.log(1 + square / tail) + k[7]
        n1, n2 = draw[3 + 2 * j], draw[4 + 2 * j]
        state[1 + j] += k[0] * e + k[1] * f + k[8] * n1
        state[4 + j] += k[2] * e + k[3] * f + k[9] * n1 + k[10] * n2
    if stands:
        new_height, new_rate = _stand(believed, state)
        state[0] += new_height - height
        state[3] += new_rate - rate
    else:
        shank = believed.shank_moment * math.sin(state[1] + state[2])
        thigh = believed.thigh_moment * math.sin(state[1]) + shank
        state[3] -= (thigh * (state[4] - hip) + shank * (state[5] - knee)) / believed.mass
    return stands, surprise, log


@compiled
def update(
    believed: Record, particles: Records, spare: Records, samples: Array, slots: IntArray,
    slot: int, share: float, scale: Array, draws: Array, start: float, how: Record,
    period: float, mean: Array, health: Array,
) -> bool:  # fmt: skip
    """Correct, weigh and resample a leg's particles by samples, (3, 4); False if none is possible.

    ``slots`` are the samples' places in ``past``, -1 of those that are known; ``slot`` is now's.
    Sets ``mean``: state, parameters, apex.
    """
    count, fresh = len(particles), -1
    gains = np.zeros((2, 2, 11))
    for s in range(3):
        if slots[s] == slot:
            fresh = s
            for g in range(2):
                for j in range(2):
                    angle, speed = samples[s, j], samples[s, 2 + j]
                    _set_gain(how, scale[g], share, angle, speed, period, gains[g, j])
    own = (how.measured_angle**2, how.measured_speed**2)
    likely, surprise = np.empty(count), np.zeros(count)
    standing, best = np.zeros(count, np.bool_), -np.inf
    for i in range(count):
        x = particles[i]
        log = x.log_weight
        for s in range(3):
            if slots[s] >= 0 and s != fresh:
                for j in range(4):
                    error = samples[s, j] - x.past[slots[s], j]
                    variance = (share * samples[s, j]) ** 2 + 2 * scale.max() * own[j // 2]
                    log -= error * error / variance / 2
        if fresh >= 0:
            standing[i], surprise[i], more = _correct(
                believed, x, samples[fresh], gains, draws[i], how.tail
            )
            log += more
        for j in range(2):
            x.past[slot, j], x.past[slot, 2 + j] = x.state[1 + j], x.state[4 + j]
        likely[i] = log if abs(x.state[0]) + abs(x.state[3]) < FAR else -np.inf
        best = max(best, likely[i])
    if not best > -np.inf:
        return False
    likely = np.exp(likely - best)
    total = likely.sum()
    _set_mean(particles, likely / total, mean)
    lost = False
    if fresh >= 0:
        _scale_noise(likely / total, standing, surprise, scale, how)
        lost = _is_lost(best + math.log(total / count), health, how)
    if lost or total * total < (likely * likely).sum() * count / 2:
        _resample(believed, particles, spare, likely / total, mean, draws, start, lost, how)
    else:
        for i in range(count):
            particles[i].log_weight = math.log(max(likely[i] / total * count, 1e-300))
    return True


@inlined
def _set_mean(particles: Records, weight: Array, mean: Array) -> None:
    mean[:] = 0.0
    for i in range(len(particles)):
        if weight[i] > 0:
            x = particles[i]
            for j in range(6):
                mean[j] += weight[i] * x.state[j]
            for j in range(4):
                mean[6 + j] += weight[i] * x.parameters[j]
            mean[10] += weight[i] * x.apex


@inlined
def _scale_noise(
    weight: Array, standing: BoolArray, surprise: Array, scale: Array, how: Record
) -> None:
    """Follow the innovations of where most particles are, on the ground or in the air."""
    ground = (weight * standing).sum()
    here = GROUND if ground > 0.5 else AIR
    there = 0.0
    for i in range(len(weight)):
        if weight[i] > 0 and standing[i] == (here == GROUND):
            there += weight[i] * surprise[i]
    there /= ground if here == GROUND else 1 - ground
    scale[here] *= 1 + how.adapt * (min(there, 10.0) - 1)
    scale[here] = min(max(scale[here], 1.0), how.most_noise)


@inlined
def _is_lost(evidence: float, health: Array, how: Record) -> bool:
    """Follow the likelihood; ``health`` is its mean, the sum below that, and losses so far."""
    health[1] = max(health[1] + health[0] - evidence - how.margin, 0.0)
    health[0] += SLOWLY * max(evidence - health[0], -how.lost)
    if health[1] <= how.lost:
        return False
    health[1] = 0.0
    health[2] += 1
    return True


@inlined
def _resample(
    believed: Record, particles: Records, spare: Records, weight: Array, mean: Array, draws: Array,
    start: float, lost: bool, how: Record,
) -> None:  # fmt: skip
    """Draw particles systematically; where track is lost, let half of them begin anew."""
    count = len(particles)
    spread = (how.payload, how.rail_friction, how.ground_time, how.knee_gain)
    jitter = np.zeros(4)
    for j in range(4):
        for i in range(count):
            jitter[j] += weight[i] * (particles[i].parameters[j] - mean[6 + j]) ** 2
        least = how.least_spread * spread[j]
        jitter[j] = math.sqrt((1 - how.kernel**2) * max(jitter[j], least * least))
    j, reached = 0, weight[0]
    for i in range(count):
        while reached < (i + start) / count and j < count - 1:
            j += 1
            reached += weight[j]
        spare[i] = particles[j]
    for i in range(count):
        particles[i] = spare[i]
        x, draw = particles[i], draws[i]
        x.log_weight = 0.0
        anew = lost and i % 2 == 0
        for m in range(4):
            kept = mean[6 + m] + how.kernel * (x.parameters[m] - mean[6 + m])
            x.parameters[m] = spread[m] * draw[7 + m] if anew else kept + jitter[m] * draw[7 + m]
        if anew and i % 4 == 0:
            height, rate = _stand(believed, x.state)
            x.state[0], x.state[3] = height - 0.001, rate + 0.1 * draw[11]
        elif anew:
            x.state[0] += 0.02 * draw[12]
            x.state[3] += 0.3 * draw[11]


@compiled
def send(memory: Record, command: Array, late: float) -> None:
    """Put a command under way, see ``stepper.send``."""
    stepper.send(memory, command, late)


@compiled
def set_mean_row(believed: Record, mean: Array, row: Record) -> None:
    """Set the row of the leg that a ``mean`` describes."""
    _set_row(believed, mean[6:10], row)
