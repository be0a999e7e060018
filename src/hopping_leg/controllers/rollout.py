"""Run a controller on many legs at once and record what happened."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import polars as pl

from hopping_leg.arrays import Array
from hopping_leg.controllers.protocol import Controller
from hopping_leg.errors import UsageError
from hopping_leg.hop_detection import FLIGHT_CLEARANCE
from hopping_leg.robot import TIMESTEP, Robot, SoftLimits, kinematics
from hopping_leg.sim import CONTROL_RATE, LOADS, LegSimulator, NoiseAndDelay, Plant
from hopping_leg.trace import COLUMNS, Trace

_START_SHARE = 0.2 / 0.29  # leg length of the standing start as a share of the straight leg's

_COLUMNS = (*list(COLUMNS)[2:], "command_m", "hip_soft_limit_nm", "knee_soft_limit_nm", *LOADS)
"""Columns of a rollout, which its loop fills by their places."""


@dataclass(frozen=True)
class RolloutConfig:
    """Where a controller is tried: robot, disturbances, rates and start."""

    robot: Robot
    disturbance: NoiseAndDelay = field(default_factory=NoiseAndDelay)
    soft_limits: SoftLimits | None = field(default_factory=SoftLimits)
    rate: float = CONTROL_RATE
    """Control rate, Hz."""
    timestep: float = TIMESTEP
    """Physics step, s."""
    threads: int = 0
    """Worker threads, 0 for one per core."""

    def __post_init__(self) -> None:
        self.robot.require_leg()
        for name in ("rate", "timestep"):
            value = getattr(self, name)
            if not 0 < value < np.inf:
                raise UsageError(f"'{name}' is {value:g} but must be positive and finite.")
        if self.threads < 0:
            raise UsageError(f"'threads' is {self.threads} but must be 0 (all cores) or more.")

    @property
    def start_posture(self) -> Array:
        """Joint angles of the standing start, rad, (2,)."""
        return kinematics.joint_angles(self.robot, np.array([self.standing_length, 0.0]))

    @property
    def standing_length(self) -> float:
        """Length from hip to foot at the standing start, m: the paper leg's 0.2 m, scaled."""
        return _START_SHARE * (self.robot.thigh.length + self.robot.shank.length)


@dataclass(frozen=True)
class Perturbation:
    """What happens to n legs in a run, unknown to their controller and fixed before it begins."""

    robots: tuple[Robot, ...]
    """What each leg is, whatever its controller believes, n of them."""
    torque: Array
    """Added to the torques asked for, N m, (ticks, n, 2)."""
    force: Array
    """Upward push on the base, N, (ticks, n)."""
    ground: Array
    """Where the ground is to be, m above where it was, (ticks, n); it moves under a leg as soon as
    the foot is clear of it."""

    def act(self, legs: LegSimulator, ground: Array, tick: int) -> Array:
        """Push legs and move their ground, which is at ``ground``, (n,); return where it is now."""
        legs.push(self.force[tick])
        rise = self.ground[tick] - ground
        room = legs.foot_clearance() >= FLIGHT_CLEARANCE + np.maximum(rise, 0)
        rise = np.where(room, rise, 0.0)
        legs.raise_ground(rise)
        return ground + rise


@dataclass(frozen=True)
class Rollout:
    """Recorded runs of n legs."""

    time: Array
    """Start of each control period, s, (ticks,)."""
    data: dict[str, Array]
    """Trace columns to (ticks, n) arrays."""
    header: dict[str, Any]
    """Shared header of the traces."""

    def trace(self, leg: int, **header: Any) -> Trace:  # noqa: ANN401
        """Return one leg's run; ``header`` entries are added to the shared ones."""
        columns = {"time_s": self.time} | {k: v[:, leg] for k, v in self.data.items()}
        return Trace(pl.DataFrame(columns), {**self.header, **header})


def rollout(
    controller: Controller,
    config: RolloutConfig,
    commands: Array,
    seed: int,
    on_tick: Callable[[int, int], None] | None = None,
    perturbation: Perturbation | None = None,
    legs: LegSimulator | None = None,
) -> Rollout:
    """Let a controller hop from a standing start; return a row per control period.

    A row is the state at its start and the torques during it. Desired heights are in m, (ticks, n);
    noise and delay follow from the seed; ``on_tick`` is called with (ticks done, ticks in all). A
    perturbation changes legs in ways that ``config`` does not know: recorded heights are above the
    ground of the moment, recorded commands are the controller's. ``legs`` hop instead of what
    ``config`` describes. A controller of a study, never of a robot, may have a method ``watch``: it
    gets the legs, live, and may place them elsewhere. PhysicsError says that the simulation became
    unstable.
    """
    ticks, count = commands.shape
    if legs is None:
        legs = LegSimulator(
            config.robot, count, rate=config.rate, timestep=config.timestep,
            threads=config.threads, robots=() if perturbation is None else perturbation.robots,
        )  # fmt: skip
    plant = Plant(legs, config.disturbance, config.soft_limits, np.random.default_rng(seed))
    legs.stand(slice(None), config.start_posture)
    plant.channel.restart(slice(None), legs.q, legs.qd, commands[0])
    controller.reset(count)
    if hasattr(controller, "watch"):
        controller.watch(legs)
    data = np.empty((len(_COLUMNS), ticks, count))
    internals, ground = dict[str, Array](), np.zeros(count)
    for tick in range(ticks):
        if perturbation is not None:
            ground = perturbation.act(legs, ground, tick)
        row = data[:, tick]
        row[0], row[1], row[2:4], row[4:6] = legs.height, legs.height_rate, legs.q.T, legs.qd.T
        row[10:13] = legs.foot_clearance(), legs.knee_clearance(), legs.base_clearance()
        row[13] = commands[tick]
        torque = controller.act(plant.sense(commands[tick]))
        for name, values in controller.internals().items():
            internals.setdefault(name, np.empty((ticks, count)))[tick] = values
        row[6:8] = torque.T
        if perturbation is not None:
            torque = torque + perturbation.torque[tick]
        row[8:10] = plant.drive(torque).T
        row[14:16], row[16:] = plant.soft_limit_torque.T, legs.records["loads"].T
        if on_tick is not None:
            on_tick(tick + 1, ticks)
    legs.require_stable(data[4:6])
    header = {
        "robot": config.robot.name,
        "robot_digest": config.robot.digest,
        "controller": controller.name,
        "policy_digest": getattr(controller, "digest", None),
        "seed": seed,
        "rate_hz": config.rate,
        "timestep_s": config.timestep,
    }
    columns = dict(zip(_COLUMNS, data, strict=True))
    # A controller's internals do not replace what is recorded of the leg.
    return Rollout(np.arange(ticks) / config.rate, columns | internals | columns, header)
