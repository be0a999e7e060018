"""Excitations that tell a fit most in their time, by the Fisher information that it will have.

Residuals r + J v, in units of the errors that count, have the covariance S from the sensors' noise;
the least squares of ``pipeline`` then errs by

    C = (J'J)^-1 J'S J (J'J)^-1

in units of changes that matter. J is that of the believed robot as its PD tracks the excitation. On
the ground, S has what noise makes of the states in which windows begin, and J what is known before
from the air. CMA-ES over harmonics, of the joints in the air and of the leg's length on the ground,
finds the least trace of C (A-optimality) within a share of what range and motors allow.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import polars as pl

from hopping_leg import cma_strategy
from hopping_leg.arrays import Array
from hopping_leg.controllers.joint_pd import JointGains
from hopping_leg.errors import UsageError
from hopping_leg.identify import excitation, optimizers
from hopping_leg.identify.cost import Objective
from hopping_leg.identify.parameters import LegHypothesis, Parameter
from hopping_leg.identify.plan import make_plan
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.recording_format import PAIRS, Pair, RecordingMetadata, Rig
from hopping_leg.identify.simulate import WindowSimulator
from hopping_leg.identify.windows import Window, cut
from hopping_leg.robot import MotorLimit, Robot, kinematics
from hopping_leg.trace import Trace

_NOISE = {
    "position": (1.4e-4, 4e-5), "velocity": (0.09, 0.04), "torque": (0.06, 0.03), "height": (1e-4,),
}  # fmt: skip
"""Of hip and knee where the robot file states none: a standing leg V2's; a linear encoder's."""
_PERIODS: dict[Rig, float] = {"fixed-base": 7.5, "rail": 5.0}
"""After which an excitation repeats itself, s, about."""
_TONES, _LOWEST, _HIGHEST = 7, 0.13, 5.0  # Hz
_FADE = 1.0  # s
_WANTED, _GIVEN = 0.6, 0.8
"""Shares of the motors' speed and torque that targets may ask for, and the tracked leg needs."""
_INSET = 0.1  # rad that angles keep from the ends of their range
_LIFT = 0.1  # m that the foot may leave the ground
_BY_GROUND = ("rail.", "contact.", "hip.load", "knee.load")  # what air does not tell
_AIR_SLOPE, _AIR_ERROR = 5.0, 0.03
"""Of a parameter that the air tells, a residual's slope, and its error in changes that matter."""
_LEAST, _SHRINK = 0.05, 0.8
_IMPOSSIBLE = 1e3  # criterion of what the leg must not do


@dataclass(frozen=True)
class Harmonics:
    """Sums of tones around a posture: of hip and knee, on the rail of the leg's length alone."""

    rig: Rig
    duration: float
    """s"""
    frequencies: Array
    """Hz, (tones,)"""
    centre: Pair
    """Hip and knee, rad; on the rail how far the foot is below and in front of the hip, m."""
    waves: Array
    """Amplitudes of cosines and sines of each, rad or m, (2 or 1, 2, tones)."""

    def joints(self, robot: Robot, time: Array) -> Array:
        """Return joint angles at times, rad, (ticks, 2); it begins and ends at rest."""
        phase = 2 * np.pi * np.multiply.outer(time, self.frequencies)
        fade = kinematics.smooth_step(np.minimum(time, self.duration - time) / _FADE)
        tones = np.stack([np.cos(phase), np.sin(phase)])
        moves: Array = fade[:, None] * np.einsum("wtn,jwn->tj", tones, self.waves)
        if self.rig == "fixed-base":
            return self.centre + moves
        foot = np.stack([self.centre[0] + moves[:, 0], np.full(len(time), self.centre[1])], axis=1)
        return kinematics.joint_angles(robot, foot)

    def __str__(self) -> str:
        return f"A-optimal harmonics, {self.duration:g} s"


@dataclass(frozen=True)
class Design:
    """What an excitation is to be found for."""

    robot: Robot
    """As it is believed to be."""
    rig: Rig = "fixed-base"
    duration: float = 15.0
    """s"""
    rate: float = excitation.RATE
    """Hz"""
    limits: excitation.HardwareRange = field(default_factory=excitation.HardwareRange)
    gains: JointGains = field(default_factory=JointGains)
    """Of the joint PD that will track it."""
    track_velocity: bool = False
    """As ``make_excitation``."""
    threads: int = 0

    def __post_init__(self) -> None:
        excitation.require_positive(duration=self.duration, rate=self.rate)
        if self.duration < _PERIODS[self.rig]:
            raise UsageError(
                f"'duration' is {self.duration:g} s but must be {_PERIODS[self.rig]:g} s or more."
            )

    @property
    def period(self) -> float:
        """After which the excitation repeats itself, s."""
        return self.duration / round(self.duration / _PERIODS[self.rig])

    @cached_property
    def _time(self) -> Array:
        """Of a period and the fade before it: all that the excitation asks of the leg, s."""
        seconds = min(self.period + _FADE, self.duration)
        return np.arange(round(seconds * self.rate)) / self.rate

    @cached_property
    def tones(self) -> Array:
        """Frequencies, multiples of one over the period and evenly spread over octaves, Hz."""
        wanted = np.geomspace(_LOWEST, _HIGHEST, _TONES) * self.period
        return np.maximum(np.round(wanted), np.arange(1, _TONES + 1)) / self.period

    @cached_property
    def space(self) -> tuple[Array, Array]:
        """Values of centre and waves where the search begins, and units in which it moves them."""
        slow = 0.5 / np.maximum(self.tones, 0.5)
        if self.rig == "fixed-base":
            middle = np.mean([self.limits.hip, self.limits.knee], axis=1)
            units = np.append([0.5, 0.5], np.tile(0.4 * slow, 4))
            return np.pad(middle, (0, 4 * _TONES)), units
        reach = self.robot.thigh.length + self.robot.shank.length
        units = reach * np.append([0.1, 0.05], np.tile(0.1 * slow, 2))
        return np.pad([0.75 * reach, 0.0], (0, 2 * _TONES)), units

    def harmonics(self, vector: Array) -> Harmonics | None:
        """Return what a search vector stands for, as large as the leg may follow; None if still."""
        first, units = self.space
        values = first + units * vector
        waves = values[2:].reshape(-1, 2, _TONES)
        whole = Harmonics(self.rig, self.duration, self.tones, (values[0], values[1]), waves)
        low, high = 0.0, 2.0
        for _ in range(8):
            share = (low + high) / 2
            fits = self._can_follow(replace(whole, waves=share * waves))
            low, high = (share, high) if fits else (low, share)
        while low > _LEAST:
            smaller = replace(whole, waves=low * waves)
            if self._tracked(smaller) is not None:
                return smaller
            low *= _SHRINK
        return None

    def _can_follow(self, harmonics: Harmonics) -> bool:
        position = harmonics.joints(self.robot, self._time)
        if np.isnan(position).any():
            return False
        wanted = excitation.demand(self.robot, self.rig, position, self.rate)
        clear = bool((wanted.clearance >= excitation.LEAST_CLEARANCE).all())
        return clear and self._allowed(position, wanted.velocity, wanted.torque, _WANTED)

    def _allowed(self, position: Array, velocity: Array, torque: Array, share: float) -> bool:
        lower, upper = np.array([self.limits.hip, self.limits.knee]).T
        inside = (position >= lower + _INSET) & (position <= upper - _INSET)
        slow = np.abs(velocity) <= share * self.robot.of_joints("no_load_speed")
        possible = MotorLimit(self.robot).clip(torque / share, velocity / share)
        return bool((inside & slow & (np.abs(torque / share - possible) <= 1e-9)).all())

    def expected(self, harmonics: Harmonics) -> dict[Parameter, float] | None:
        """Return by how much a fit to the whole excitation would err, in each parameter's unit.

        None says that the leg, tracked by the PD, would come too near its limits.
        """
        recording = self._tracked(harmonics)
        if recording is None:
            return None
        plan = make_plan([recording], self.robot)
        length = None if self.rig == "fixed-base" else plan.window  # in the air one is like many
        windows = tuple(cut([recording], length, unscored=plan.unscored))
        objective = Objective(
            (recording,), windows, plan.parameters, plan.scoring, plan.timestep, self.threads
        )
        start, bounds = np.zeros(len(plan.parameters.names)), plan.parameters.bounds
        step = optimizers.LeastSquaresOptions().step
        slopes = optimizers.jacobian(objective.residuals, start, bounds, step, objective.jumping)
        noisy = [objective.deviations(self._noise)[:, None] * slopes]
        if self.rig != "fixed-base":
            noisy += self._start_noise(recording, objective, slopes)
            told = [not name.startswith(_BY_GROUND) for name in plan.parameters.names]
            air = _AIR_SLOPE * np.diag(told).astype(float)
            slopes, noisy = np.concatenate([slopes, air]), [*noisy, _AIR_ERROR * air]
        together = np.concatenate(noisy)
        inverse = np.linalg.pinv(slopes.T @ slopes, hermitian=True)
        errors = np.linalg.norm(together @ inverse, axis=0) * np.sqrt(
            self._time[-1] / self.duration
        )
        return dict(zip(plan.parameters.parameters, errors * plan.parameters.scale, strict=True))

    @property
    def _noise(self) -> dict[str, Array]:
        """Deviations of what sensors report, of both joints."""
        noise = {name: np.array(pair) for name, pair in _NOISE.items()}
        for name in ("position", "velocity", "torque"):
            stated = self.robot.reality.of_sensors(f"{name}_noise")
            noise[name] = np.where(stated > 0, stated, noise[name])
        return noise

    def _start_noise(
        self, recording: Recording, objective: Objective, slopes: Array
    ) -> list[Array]:
        """Return what noise of the states in which windows begin makes of J'r, (windows, k) each.

        A row that begins a window is not scored in it, so that nothing else changes.
        """
        origin, found = np.zeros((1, slopes.shape[1])), []
        still, rows = objective.residuals(origin)[0], [w.start for w in objective.windows]
        for name in ("position", "velocity"):
            for column, deviation in zip(PAIRS[name], self._noise[name], strict=True):
                moved = recording.trace.column(column)
                moved[rows] += deviation
                table = recording.trace.table.with_columns(pl.Series(column, moved))
                other = (replace(recording, trace=Trace(table)),)
                change = replace(objective, recordings=other).residuals(origin)[0] - still
                found.append(np.zeros((len(rows), slopes.shape[1])))
                np.add.at(found[-1], objective.window_numbers, change[:, None] * slopes)
        return found

    def _tracked(self, harmonics: Harmonics) -> Recording | None:
        """Return what a PD makes of it; None where the leg comes too near its limits."""
        target = harmonics.joints(self.robot, self._time)
        pairs = {"position": target, "position_command": target}
        if self.track_velocity:
            pairs["velocity_command"] = np.gradient(target, 1 / self.rate, axis=0)
        metadata = RecordingMetadata(
            self.rig, self.rate, self.robot.name, "expected", onboard="zoh",
            stiffness=self.gains.stiffness, damping=self.gains.damping,
        )  # fmt: skip
        asked = Recording(_trace(self._time, pairs), metadata, "expected")
        whole = [Window(0, 0, len(target), 1)]
        found = WindowSimulator([asked], whole, threads=self.threads).run(
            [LegHypothesis(self.robot)]
        )
        position, velocity, torque = found.position[0, 0], found.velocity[0, 0], found.torque[0, 0]
        if not self._allowed(position, velocity, torque, _GIVEN):
            return None
        pairs |= {"position": position, "velocity": velocity, "torque": torque}
        trace = _trace(self._time, pairs)
        if self.rig != "fixed-base":
            height = found.height[0, 0]
            if not kinematics.foot_clearance(self.robot, height, position).max() < _LIFT:
                return None
            trace = Trace(trace.table.with_columns(height_m=height))
        return replace(asked, trace=trace)


def _trace(time: Array, pairs: dict[str, Array]) -> Trace:
    columns = {"time_s": time}
    for name, values in pairs.items():
        columns |= dict(zip(PAIRS[name], values.T, strict=True))
    return Trace(pl.DataFrame(columns))


def optimal_excitation(
    design: Design,
    *,
    generations: int = 80,
    population: int = 16,
    seed: int = 0,
    report: Callable[[float, float], None] = lambda share, error: None,
) -> tuple[Harmonics, dict[Parameter, float]]:
    """Return the best excitation that a search finds, and its expected errors.

    The same seed finds the same. ``report`` gets the share done and the error of all parameters in
    changes that matter, as root of the sum of squares.

    Raises:
        UsageError: The leg can follow none of those that were tried.
    """
    first = np.zeros(len(design.space[0]))
    strategy = cma_strategy.seeded_strategy(first, 0.5, [None, None], population, seed)
    best, least = None, _IMPOSSIBLE
    for generation in range(generations):
        vectors, errors = strategy.ask(), []
        for vector in vectors:
            harmonics = design.harmonics(vector)
            known = None if harmonics is None else design.expected(harmonics)
            error = math.hypot(*(e / p.scale for p, e in known.items())) if known else _IMPOSSIBLE
            errors.append(error)
            if harmonics and known and error < least:
                best, least = (harmonics, known), error
        strategy.tell(vectors, np.log(errors).tolist())
        report((generation + 1) / generations, least)
    if best is None:
        raise UsageError(
            f"No excitation was found that {design.robot.name} can follow; give wider ranges of the"
            " joints, or check the robot file."
        )
    return best
