"""How well energy shaping hops: the law as printed, the tuned one, and what each part is worth."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from rich.progress import track

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.cli.options import JsonFile, RobotFile, at_least
from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.energy_shaping import paper_energy_shaping, tuned_energy_shaping
from hopping_leg.controllers.energy_shaping.controller import EnergyShaping, LiteralEnergyShaping
from hopping_leg.controllers.energy_shaping.virtual_leg import LegView, Phase
from hopping_leg.evaluate.metrics import HopWindow, measure
from hopping_leg.evaluate.result import summarise
from hopping_leg.io import plain, replace_at
from hopping_leg.robot import DEFAULT_ROBOT, TIMESTEP, Robot, load_robot
from hopping_leg.sim import CONTROL_RATE, NO_NOISE, LegSimulator, NoiseAndDelay
from hopping_leg.trace import Trace
from studies.shared import Row, show_rows

COMMANDS = (0.25, 0.30, 0.35)
"""The paper's heights, m."""

RANGE = (0.22, 0.25, 0.28, 0.30, 0.32, 0.35, 0.38, 0.40)
"""Heights over which the baseline is to hold, m."""

_SHOWN = (
    *("median_error_m", "std_m", "hops", "hop_rate_hz", "skipped_hops", "flight_fraction"),
    *("min_base_height_m", "body_contacts"),
)


@dataclass(frozen=True)
class Case:
    """One row of the table.

    Attributes:
        name: Of the row.
        controller: What hops.
        robot: The leg it hops on, not always the one it knows.
        disturbance: Noise and delay.
        commands: Heights, m.
    """

    name: str
    controller: EnergyShaping
    robot: Robot
    disturbance: NoiseAndDelay = field(default_factory=NoiseAndDelay)
    commands: Sequence[float] = COMMANDS


class Knowing(LiteralEnergyShaping):
    """Energy shaping that the simulator tells of contact, base velocity and apexes."""

    def watch(self, legs: LegSimulator) -> None:
        """Take the legs, live."""
        self.legs = legs
        self._highest = np.zeros(legs.count)

    def _braked_rate(self, leg: LegView) -> Array:
        return self.legs.height_rate

    def _touched(self, leg: LegView, planned: Array, torque: Array, shortest: Array) -> BoolArray:
        return (self.legs.foot_clearance() <= 0) & self._settled()

    def _reached(self, ballistic: Array, timed: Array) -> Array:
        return self._highest

    def _estimate_height(self, leg: LegView) -> None:
        super()._estimate_height(leg)
        flying = self._phase == Phase.FLIGHT
        self._highest = np.where(flying, np.maximum(self._highest, self.legs.height), 0.0)

    def _settled(self) -> BoolArray:
        """Return where contact no longer flickers after a change of phase."""
        settled: BoolArray = self._clock > 4 * self.period
        return settled


class Waiting(Knowing):
    """The same that also pushes until contact is lost."""

    def _lifted_off(self, leg: LegView, liftoff: Array) -> tuple[BoolArray, Array, Array]:
        lost = (self.legs.foot_clearance() > 0) & self._settled()
        return lost, leg.rate, np.zeros_like(leg.rate)


def cases(robot: Robot) -> list[Case]:
    """Return every case for a leg: laws, rates, disturbances, ablations, changed legs."""
    tuned, paper = tuned_energy_shaping(robot), paper_energy_shaping(robot)
    knowing = Knowing(robot, paper.gains, name=paper.name)
    waiting = Waiting(robot, paper.gains, name=paper.name)
    fast, noise = 2 * CONTROL_RATE, NoiseAndDelay
    torque = replace(NO_NOISE, torque_noise=noise.torque_noise)
    late = replace(NO_NOISE, delay_probability=noise.delay_probability)
    rubbing = replace(robot.rail, friction=3 * robot.rail.friction)
    others = [load_robot(name) for name in ("legv2", "legv2-paper")]

    def without(name: str, gains: dict[str, float], *literal: str) -> Case:
        """Return the tuned law with other gains, or with what the literal one does instead."""
        methods = {method: getattr(LiteralEnergyShaping, method) for method in literal}
        kind = type(f"Without{'_'.join(literal)}", (EnergyShaping,), methods)
        return Case(f"tuned, {name}", kind(robot, replace(tuned.gains, **gains)), robot)

    raw = {"height_offset": 0.0, "height_scale": 1.0}
    joint = replace(NO_NOISE, joint_noise=noise.joint_noise)
    return [
        Case("tuned", tuned, robot, commands=RANGE),
        Case("tuned, undisturbed", tuned, robot, NO_NOISE, RANGE),
        Case("tuned, 400 Hz", tuned_energy_shaping(robot, rate=fast), robot),
        Case("paper, true contact and height", knowing, robot, NO_NOISE),
        Case("paper, true contact and height, disturbed", knowing, robot),
        Case("paper, push until contact is lost", waiting, robot, NO_NOISE),
        Case("paper", paper, robot),
        Case("paper, undisturbed", paper, robot, NO_NOISE),
        Case("paper, 400 Hz", paper_energy_shaping(robot, rate=fast), robot),
        Case("tuned, joint noise only", tuned, robot, joint),
        Case("tuned, torque noise only", tuned, robot, torque),
        Case("tuned, delay only", tuned, robot, late),
        without("ballistic estimate", raw, "_reached"),
        without("newest sample only", {}, "_joints"),
        without("single-sample contact", {}, "debounced"),
        without("lift-off on whole periods", {}, "_pushing_share", "_lifted_off"),
        without("no pull to a leg rate", {"push_damping": 0.0}),
        without("exponent 2", {"exponent": 2.0}),
        without("exponent 1", {"exponent": 1.0}),
        Case("tuned, 20 % more mass", tuned, _heavier(robot, 0.2)),
        Case("tuned, 20 % less mass", tuned, _heavier(robot, -0.2)),
        Case("tuned, soft floor", tuned, replace(robot, contact=others[1].contact)),
        Case("tuned, three times the rail friction", tuned, replace(robot, rail=rubbing)),
        *(Case(f"tuned, leg {leg.name}", tuned_energy_shaping(leg), leg) for leg in others),
    ]


def _heavier(robot: Robot, share: float) -> Robot:
    return replace_at(robot, "base.mass", robot.base.mass + share * robot.mass)


@dataclass(frozen=True)
class Baseline:
    """Measure energy shaping: the printed law, the tuned one, what each part is worth."""

    robot: RobotFile = DEFAULT_ROBOT
    runs: int = 6
    """Realisations of noise and delay per command."""
    duration: float = 12.0
    """Of a run, s; the first 2 s do not count."""
    seed: int = 1000
    """Of noise and delay; those from 1000 on have tuned nothing."""
    json: JsonFile = None

    def measure(self) -> Row:
        """Try every case, print a table, return every number.

        ``cases`` has a record each, ``commands`` one per case and command.
        """
        at_least(1, runs=self.runs)
        robot = load_robot(self.robot)
        overall, single = [], []
        for case in track(cases(robot), "hopping", transient=True):
            traces = self._hop(case)
            rows = [
                _row(case, c, [measure(t)[0] for t in traces[i * self.runs : (i + 1) * self.runs]])
                for i, c in enumerate(case.commands)
            ]
            overall.append(summary(case, rows))
            single += rows
        faults = ("skipped_hops", "body_contacts")
        show_rows(overall, "case", "mean_abs_median_error_m", "mean_std_m", "hop_rate_hz", *faults)
        return {
            "robot": robot.name,
            "seed": self.seed,
            "runs_per_command": self.runs,
            "exponent": float(tuned_energy_shaping(robot).gains.exponent),
            "seconds": self.duration,
            "timestep_s": TIMESTEP,
            "cases": overall,
            "commands": single,
        }

    def _hop(self, case: Case) -> list[Trace]:
        """Return one trace per command and run, commands in the outer order."""
        rate = 1 / case.controller.period
        setup = RolloutConfig(case.robot, case.disturbance, rate=rate)
        commands = np.tile(np.repeat(case.commands, self.runs), (round(self.duration * rate), 1))
        run = rollout(case.controller, setup, commands, self.seed)
        return [run.trace(leg) for leg in range(commands.shape[1])]


def _row(case: Case, command: float, windows: Sequence[HopWindow]) -> Row:
    found = plain(vars(summarise(case.name, command, windows, 0)))
    error = found["median_error_m"]
    row = {"case": case.name, "command_m": command, "median_m": command + error}
    return row | {name: found[name] for name in _SHOWN}


def summary(case: Case, rows: Sequence[Row]) -> Row:
    """Average errors over the paper's three commands, spreads over those with hops; rest: all."""
    core = [row for row in rows if row["command_m"] in COMMANDS]
    errors = [abs(row["median_error_m"]) for row in core]
    stds = [row["std_m"] for row in core if row["hops"]]
    return {
        "case": case.name,
        "mean_abs_median_error_m": float(np.mean(errors)),
        "worst_median_error_m": max(errors),
        "mean_std_m": float(np.mean(stds)) if stds else None,
        "hop_rate_hz": float(np.mean([row["hop_rate_hz"] for row in rows])),
        "commands_without_hops": sum(not row["hops"] for row in rows),
        "skipped_hops": sum(row["skipped_hops"] for row in rows),
        "min_base_height_m": min(row["min_base_height_m"] for row in rows),
        "body_contacts": sum(row["body_contacts"] for row in rows),
    }
