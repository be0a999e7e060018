"""A robot in numbers without units: what a policy for any leg is told of the one that it is on.

Lengths are over the stretched leg's L, masses over all that moves M, forces over the weight W,
times over sqrt(L / g), so that legs of one shape have the same numbers whatever their size.
"""

import math

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.robot import GRAVITY, Joint, Link, Robot

LEAST = 1e-5  # What a friction or inertia without a unit is at least, where its logarithm is taken
MOST = 3.0  # Largest number that a policy is told

MIDDLES_AND_SPREADS = np.array(
    [
        (0.0, 0.2), (0.07, 0.3),  # length over leg V2's, thigh over shank (logarithms)
        (0.25, 0.3), (-0.67, 0.25), (-0.9, 0.3), (-2.8, 0.4),  # mass over leg V2's; its shares
        (0.13, 0.05), (0.33, 0.05),  # centres of mass over the link
        (-4.6, 0.6), (-6.9, 0.9),  # inertias of the links (logarithms)
        (0.032, 0.005),  # foot's radius
        (0.02, 0.03), (0.04, 0.06),  # rail: friction, damping
        (-0.2, 0.8), (0.95, 0.25),  # ground: time constant over 30 ms (logarithm), damping ratio
        # Hip and knee: friction, damping (square roots); armature, torque limit, stall torque,
        # no-load speed, torque gain (logarithms).
        (0.12, 0.07), (0.085, 0.04), (-4.3, 0.8), (0.66, 0.2), (1.13, 0.2), (2.1, 0.15), (0, 0.15),
        (0.08, 0.06), (0.21, 0.08), (-2.9, 0.8), (1.36, 0.2), (1.83, 0.2), (1.4, 0.15), (0, 0.15),
    ]
)  # fmt: skip
"""Middle and spread of each number over the legs of the training."""

COUNT = len(MIDDLES_AND_SPREADS)  # How many there are

USUAL = {"length": 0.29, "mass": 1.45, "time_constant": 0.03}
"""Leg V2's length, m, and mass, kg, and a ground's time constant, s, over which others are told."""

FULL_TORQUE = np.array([2.2, 4.6])  # Joint torques of a full action over the weight times L


def leg_length(robot: Robot) -> float:
    """Return the length L of the stretched leg, hip to the foot's centre, m."""
    return robot.thigh.length + robot.shank.length


def full_torque(robot: Robot) -> Array:
    """Return the joint torques of a full action, N m, (2,): multiples of the weight times L."""
    return FULL_TORQUE * robot.mass * GRAVITY * leg_length(robot)


def fall_time(robot: Robot) -> float:
    """Return the unit of time sqrt(L / g), s."""
    return math.sqrt(leg_length(robot) / GRAVITY)


def robot_numbers(robot: Robot) -> Array:
    """Return a robot's numbers, each about -1 to 1 over the legs of the training, (``COUNT``,)."""
    length, mass, time = leg_length(robot), robot.mass, fall_time(robot)
    weight = mass * GRAVITY

    def inertia(value: float) -> float:
        return math.log(max(value / (mass * length**2), LEAST))

    def of_link(link: Link) -> float:
        return inertia(link.inertia)

    def of_joint(joint: Joint) -> tuple[float, ...]:
        moment = weight * length
        return (
            math.sqrt(joint.friction / moment),
            math.sqrt(joint.damping / (moment * time)),
            inertia(joint.armature),
            math.log(joint.torque_limit / moment),
            math.log(joint.motor.peak_torque * joint.belt_ratio / moment),
            math.log(joint.no_load_speed * time),
            math.log(joint.torque_gain),
        )

    values = np.array(
        [
            math.log(length / USUAL["length"]),
            math.log(robot.thigh.length / robot.shank.length),
            math.log(mass / USUAL["mass"]),
            *(math.log(part.mass / mass) for part in (robot.base, robot.thigh, robot.shank)),
            robot.thigh.com / robot.thigh.length,
            robot.shank.com / robot.shank.length,
            of_link(robot.thigh),
            of_link(robot.shank),
            robot.foot.radius / length,
            robot.rail.friction / weight,
            robot.rail.damping * time / mass,
            math.log(robot.contact.time_constant / USUAL["time_constant"]),
            robot.contact.damping_ratio,
            *of_joint(robot.hip),
            *of_joint(robot.knee),
        ]
    )
    middle, spread = MIDDLES_AND_SPREADS.T
    scaled: Array = np.clip((values - middle) / spread, -MOST, MOST)
    return scaled
