"""The stepper is MuJoCo, to rounding, and what it does beyond is as stated."""

import dataclasses

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hopping_leg.robot import GRAVITY, JOINTS, Boom, DriveMismatch, dynamics, get_spec, load_robot
from hopping_leg.sim import LegSimulator, lanes, leg_physics
from hopping_leg.sim.compiled import compiled
from hopping_leg.sim.randomization import IDENTIFIABLE_RANGES, WIDE_RANGES, Range, sample
from tests.sim.legs import with_joints, with_reality, with_strong_motors

BODIES = {"hip": "thigh", "knee": "shank"}
FURTHER = tuple(
    Range(f"{joint}.{name}", "1", 0.0, high, "test")
    for joint in JOINTS
    for name, high in (("load_friction", 0.3), ("friction", 1.0))
)


def tight_model(spec):
    """Compile a spec whose solver goes on to rounding and whose motors have no limits."""
    option = spec.option
    option.tolerance, option.ls_tolerance = 1e-17, 1e-9  # at 1e-15 it is 8e-12 short at worst
    option.iterations, option.ls_iterations = 200, 100
    for actuator in spec.actuators:
        actuator.ctrllimited = False
    return spec.compile()


def add_transmission(spec, name, drive):
    """Hang a joint's link on a second hinge; the joint keeps armature, friction and motor.

    The spring, which may have a dead band, is applied from outside. The stop is the link's.
    """
    joint = spec.joint(name)
    hinge = spec.body(BODIES[name]).add_joint(
        name=f"{name}_link", type=mujoco.mjtJoint.mjJNT_HINGE, axis=joint.axis
    )
    hinge.damping = [drive.stiffness_damping, 0, 0]
    stop = spec.add_tendon(name=f"{name}_stop", limited=True, range=joint.range)
    stop.solref_limit, stop.solimp_limit = joint.solref_limit, joint.solimp_limit
    for each in (name, f"{name}_link"):
        stop.wrap_joint(each, 1.0)
    joint.limited = False


def add_boom(spec, boom):
    """Let the base move forward, too, and add the boom's inertias."""
    rail = spec.joint("rail")
    rail.armature, rail.frictionloss = boom.mass, boom.friction
    rail.damping[0] = boom.damping
    spec.body("base").mass -= boom.slider
    ahead = spec.body("base").add_joint(
        name="ahead", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0]
    )
    ahead.armature = boom.forward_mass


class Reference:
    """Legs in MuJoCo with a tight tolerance, built for these tests alone."""

    def __init__(self, robots, timestep, *, fixed_base=False):
        self.robots, self.legs = robots, []
        self.elastic = robots[0].reality.hip.stiffness is not None
        for robot in robots:
            spec = get_spec(robot, timestep, fixed_base=fixed_base)
            if self.elastic:
                for name in JOINTS:
                    add_transmission(spec, name, getattr(robot.reality, name))
            if robot.boom.radius:
                add_boom(spec, robot.boom)
            model = tight_model(spec)
            self.legs.append((model, mujoco.MjData(model)))
        self.rail = [] if fixed_base else [model.joint("rail").dofadr[0]]
        self.ahead = [model.joint("ahead").dofadr[0]] if robots[0].boom.radius else []
        self.motors = [model.joint(name).dofadr[0] for name in JOINTS]
        self.links = [model.joint(f"{n}_link").dofadr[0] for n in JOINTS] if self.elastic else []

    def set_state(self, state, rotor):
        """Take a stepper's state (n, 6), and its rotors' (n, 4)."""
        for (_, data), leg, motor in zip(self.legs, state, rotor, strict=True):
            for values, at in ((data.qpos, 0), (data.qvel, 1)):
                rail, link = leg[3 * at], leg[3 * at + 1 : 3 * at + 3]
                own = motor[2 * at : 2 * at + 2]
                values[self.rail] = rail
                values[self.motors] = own if self.elastic else link
                if self.elastic:
                    values[self.links] = link - own

    def get_state(self):
        """Return state and rotors' state, (n, 10)."""
        found = np.zeros((len(self.legs), 10))
        for (_, data), leg in zip(self.legs, found, strict=True):
            for values, at in ((data.qpos, 0), (data.qvel, 1)):
                leg[3 * at] = values[self.rail].sum()
                leg[6 + 2 * at : 8 + 2 * at] = motor = values[self.motors]
                leg[3 * at + 1 : 3 * at + 3] = motor + (values[self.links] if self.elastic else 0)
        return found

    def step(self, torque, push, substeps):
        """Hold joint torques and an upward push for some steps."""
        legs = zip(self.robots, self.legs, torque, push, strict=True)
        for robot, (model, data), asked, force in legs:
            data.ctrl[:] = asked / robot.of_joints("belt_ratio")
            load = robot.of_joints("load_friction") * np.abs(asked)
            model.dof_frictionloss[self.motors] = robot.of_joints("friction") + load
            data.qfrc_applied[self.rail] = force - robot.boom.weight
            stiffness, half = (robot.reality.of_drives(n) for n in ("stiffness", "backlash"))
            for _ in range(substeps if self.elastic else 1):
                if self.elastic:
                    twist = data.qpos[self.links]
                    beyond = twist - np.clip(twist, -half / 2, half / 2)
                    data.qfrc_applied[self.links] = -stiffness * beyond
                mujoco.mj_step(model, data, nstep=1 if self.elastic else substeps)


def worst_difference(robots, ticks, timestep=5e-4, *, fixed_base=False, seed=0):
    """Return the largest difference after a control period, and how often what touched.

    The difference is relative to a leg's greatest number, if above 1.
    Legs are pushed off, caught and thrown against their stops by random torques, and go on from
    MuJoCo's state.
    """
    count, rng = len(robots), np.random.default_rng(seed)
    reference = Reference(robots, timestep, fixed_base=fixed_base)
    legs = LegSimulator(
        robots[0], count, timestep=timestep, threads=1, fixed_base=fixed_base, robots=robots
    )
    legs.height[:] = 0.0 if fixed_base else rng.uniform(0.02, 0.4, count)
    legs.q[:] = np.stack([rng.uniform(-0.5, 1.5, count), rng.uniform(-2.75, 0.2, count)], 1)
    legs.state[:, 3:] = rng.normal(0, 1, (count, 3)) * [not fixed_base, 1, 1]
    legs.forget(slice(None))
    forward = legs.records["forward"]
    limit = robots[0].of_joints("torque_limit")
    worst, seen = 0.0, dict.fromkeys(("foot", "knee", "base", "stop", "still"), 0)
    for tick in range(ticks):
        if tick % 50 == 25:
            legs.state[::4, 1:3] = rng.uniform(-3.2, 3.2, (len(legs.state[::4]), 2))
            legs.forget(slice(None))
        memory = legs.memory()["memory"]
        reference.set_state(legs.state, memory[:, :4])
        for (_, data), speed in zip(reference.legs, forward, strict=True):
            data.qvel[reference.ahead] = speed
        pushing = (legs.height < 0.22)[:, None]
        torque = np.where(pushing, [-6.0, 6.0], 8 * ([0.7, -1.4] - legs.q) - 0.2 * legs.qd)
        torque = (torque + rng.normal(0, 1, (count, 2))).clip(-limit, limit)
        torque[::7] = 0.0
        push = rng.normal(0, 5, count) * (tick % 3 == 0)
        legs.push(push)
        legs.step(torque)
        reference.step(torque, push, legs.substeps)
        rotor = legs.memory()["memory"][:, :4]
        found = reference.get_state()
        scale = np.maximum(1, np.abs(found).max(axis=1, keepdims=True))
        difference = np.abs(np.concatenate([legs.state, rotor], 1) - found)
        worst = max(worst, (difference / scale).max())
        for (_, data), speed in zip(reference.legs, forward, strict=True):
            worst = max([worst, *np.abs(data.qvel[reference.ahead] - speed)])
        for part in ("foot", "knee", "base"):
            seen[part] += np.count_nonzero(getattr(legs, f"{part}_clearance")() < 0)
        seen["stop"] += np.count_nonzero(legs.records["loads"][:, 7])
        seen["still"] += np.count_nonzero(np.abs(legs.qd) < 1e-4)
        legs.state[:] = found[:, :6]
    return worst, seen


def randomised(name, count, seed=0, boom=Boom(), **reality):  # noqa: B008
    ranges = IDENTIFIABLE_RANGES + tuple(r for r in WIDE_RANGES if "reality" not in r.path)
    base = with_reality(load_robot(name), **reality) if reality else load_robot(name)
    base = dataclasses.replace(base, boom=boom)
    robots = sample(base, ranges + FURTHER, count, np.random.default_rng(seed))
    return [with_strong_motors(with_joints(robot, torque_gain=1.0)) for robot in robots]


ELASTIC = {
    "hip": DriveMismatch(stiffness=900.0, stiffness_damping=0.05),
    "knee": DriveMismatch(stiffness=200.0, stiffness_damping=0.02, backlash=0.01),
}


BOOM = {"boom": Boom(1e9, 0.0, 0.3, 0.8, 0.6, -4.0, 0.0, 0.5, 1.0)}  # Its arc is a straight line


@pytest.mark.parametrize(
    ("name", "reality", "fixed_base", "count", "timestep"),
    [
        ("legv2", {}, False, 32, 5e-4),
        ("legv2-paper", {}, False, 32, 5e-4),
        ("legv2", {}, True, 16, 5e-4),
        ("legv2", ELASTIC, False, 16, 5e-4),
        ("legv2", ELASTIC, True, 16, 5e-4),
        ("legv2", BOOM, False, 16, 5e-4),
        pytest.param("legv2", {}, False, 256, 1.25e-4, marks=pytest.mark.slow),
    ],
)
def test_the_stepper_is_mujoco_for_legs_of_any_kind(name, reality, fixed_base, count, timestep):
    robots = randomised(name, count, count, **reality)
    worst, seen = worst_difference(robots, 100, timestep, fixed_base=fixed_base, seed=count)
    assert worst < 1e-12
    touching = ("stop",) if fixed_base or reality else seen
    assert min(seen[part] for part in touching) > 20


@compiled
def elementary(x):
    return (*lanes.sincos(x), lanes.exp(0.01 * x))


def test_sine_cosine_and_exponential_are_the_libraries_to_rounding():
    rng = np.random.default_rng(0)
    angles = np.concatenate([rng.uniform(-9, 9, 2000), rng.uniform(-6e4, 6e4, 2000), [0.0]])
    found = np.transpose([elementary(angle) for angle in angles])
    assert np.abs(found[:2] - [np.sin(angles), np.cos(angles)]).max() < 3e-16
    assert np.abs(found[2] / np.exp(0.01 * angles) - 1).max() < 5e-16


@compiled
def acceleration(m, force, moving, friction, rows, count, start):
    """Return the same as the function that is compiled into others; kept between sessions."""
    first = lanes.side_by_side(rows, leg_physics.ROW)
    return leg_physics.constrained_acceleration(m, force, moving, friction, first, count, start)


@given(
    st.integers(0, 2**32 - 1), st.integers(0, leg_physics.ROWS), st.integers(0, 7), st.booleans()
)
@settings(max_examples=300)
def test_the_acceleration_obeys_gauss_principle(seed, count, sliding, boom):
    """At the minimum, mass times acceleration is force plus what the constraints give."""
    rng, n = np.random.default_rng(seed), 3 + boom
    root = (rng.normal(0, 1, (n, n)) + 2 * np.eye(n)) * 10 ** rng.uniform(-1, 0, (n, 1))
    mass, (force, start) = root @ root.T, rng.normal(0, [[100.0], [1000.0]], (2, n))
    loss = np.where([sliding >> i & 1 for i in range(3)], 10 ** rng.uniform(-2, 2, 3), 0.0)
    stiff, rest = 10 ** rng.uniform(0, 3, 3), rng.normal(0, 100, 3)
    rows = np.zeros((leg_physics.ROWS, 7))
    rows[:count] = rng.normal(0, 1, (count, 7)) * [1, 1, 1, boom, 100, 0, 0]
    rows[:count, 5] = 10 ** rng.uniform(-1, 3, count)
    friction = tuple(map(tuple, (loss, stiff, rest, loss / stiff)))
    numbers, start = tuple(mass[:3, :3][np.triu_indices(3)]), np.append(start, 0.0)[:4]
    moving = (tuple(mass[:3, 3]), mass[3, 3], force[3]) if boom else ((0.0, 0.0, 0.0), 1.0, 0.0)
    force3, flat = tuple(force[:3]), rows.ravel()
    found = acceleration(numbers, force3, (*moving, boom), friction, flat, count, tuple(start))
    a, pushing = np.array(found[:n]), rows[:count, :n]
    miss = np.minimum(pushing @ a - rows[:count, 4], 0.0)
    given_by_rows = -(rows[:count, 5] * miss) @ pushing
    given_by_friction = np.zeros(n)
    given_by_friction[:3] = np.clip(-stiff * (a[:3] - rest), -loss, loss)
    residual = mass @ a - force - given_by_rows - given_by_friction
    scale = np.abs(mass) @ np.abs(a) + np.abs(force) + np.abs(given_by_rows)
    assert (np.abs(residual) <= 1e-8 * scale.max()).all()


def test_energy_stays_what_it_is_on_a_booms_arc():
    """Of a frictionless leg in the air: inertia grows away from the pivot's height, weight not."""
    boom = Boom(1.1, 0.3, 0.38, masses=((1.3, -0.7, 0.3), (0.5, 0.4, 0.0)))
    smooth = with_joints(load_robot("legv2"), friction=0.0, damping=0.0)
    legs = LegSimulator(dataclasses.replace(smooth, boom=boom), 1, timestep=2e-5)
    legs.state[:] = [0.6, 0.3, -1.0, 2.0, 3.0, -4.0]
    legs.forget(slice(None))
    legs.records["forward"] = 0.5
    p, energies = legs.table[0], []
    moments = np.array([p["thigh_moment"], p["shank_moment"]])
    for _ in range(40):
        height, speed, forward = legs.height[0], legs.state[0, 3:], legs.records["forward"][0]
        angles, rates, lean = np.cumsum(legs.q[0]), np.cumsum(legs.qd[0]), (height - 0.3) / 1.1
        mass = dynamics.mass_matrix(smooth, legs.q)[0]
        mass[0, 0] = p["mass"] / (1 - lean**2)
        kinetic = (speed @ mass @ speed + p["forward_mass"] * forward**2) / 2
        kinetic += forward * moments @ (np.cos(angles) * rates)
        energies.append(kinetic + p["weight"] * height - GRAVITY * moments @ np.cos(angles))
        legs.step(np.zeros((1, 2)))
    assert abs(lean) > 0.3
    assert np.ptp(energies) < 2e-4 * kinetic
