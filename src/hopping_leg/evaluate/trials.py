"""The paper's trials (Sec. III): what is commanded when, on which floor, and runs of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import polars as pl

from hopping_leg import errors, io
from hopping_leg.controllers import Controller, RolloutConfig, rollout
from hopping_leg.controllers.command_schedule import CommandSchedule, check_heights
from hopping_leg.evaluate.metrics import stretches
from hopping_leg.flight_recording import load_trace
from hopping_leg.robot import GroundMismatch, Robot, command_limits
from hopping_leg.robot.parameters import Contact
from hopping_leg.sim import LegSimulator
from hopping_leg.trace import Trace, interpolated

COMMANDS = (0.25, 0.30, 0.35)
"""Apex heights the paper trains and tests, m, for a leg of the paper's size."""
STAIRCASE = (0.25, 0.27, 0.29, 0.31, 0.33, 0.35)  # Commands of the 30 s trial, m, 5 s each (Fig. 5)
LADDER = (0.22, 0.24, 0.26, 0.28, 0.30, 0.32, 0.34, 0.36, 0.38, 0.40)
"""Commands that show how a controller interpolates and where it ends, m."""
KINDS = ("fixed", "sequence", "staircase", "ladder")
FIXED_SECONDS = 15.0
STEP_SECONDS = 5.0


@dataclass(frozen=True)
class Trial(CommandSchedule):
    """A command schedule, started from standing; ``kind`` is one of ``KINDS``."""

    kind: str

    @property
    def name(self) -> str:
        """Short and unique within an evaluation, fit for a file name."""
        return f"{self.kind}-{self.steps[0][0]:.3f}" if len(self.steps) == 1 else self.kind


def scaled(heights: Sequence[float], robot: Robot) -> tuple[float, ...]:
    """Return the paper's heights for a leg of another size, m, rounded to 5 mm."""
    return tuple(round(h * robot.size * 200) / 200 for h in heights)


def paper_trials(robot: Robot, commands: Sequence[float] | None = None) -> list[Trial]:
    """Return all trials; UsageError says that a command, m, of the fixed ones is out of reach."""
    chosen = choose_commands(robot, commands)
    trials = [Trial(((c, FIXED_SECONDS),), "fixed") for c in chosen]
    if len(chosen) > 1:
        trials.append(Trial(tuple((c, STEP_SECONDS) for c in chosen), "sequence"))
    trials.append(Trial(tuple((c, STEP_SECONDS) for c in scaled(STAIRCASE, robot)), "staircase"))
    trials += [Trial(((c, FIXED_SECONDS),), "ladder") for c in scaled(LADDER, robot)]
    return trials


def choose_commands(
    robot: Robot, commands: Sequence[float] | None, repeats: int = 1
) -> tuple[float, ...]:
    """Return rising heights, m, those asked for or the paper's scaled, or raise UsageError."""
    if repeats < 1:
        raise errors.UsageError(f"{repeats} seeds are too few; give --seeds 1 or more.")
    if commands is None:
        return scaled(COMMANDS, robot)
    if not commands:
        raise errors.UsageError("No commands were given; give heights in m, e.g. 0.25,0.30.")
    check_heights(commands, command_limits(robot), robot.name)
    return tuple(sorted(set(commands)))


FLOORS = {"soft": "the robot's own contact", "stiff": "MuJoCo's default contact, solref 0.02 1"}
"""Grounds to be judged on."""


@dataclass(frozen=True)
class Run:
    """One trial with one realisation of noise and delay, numbered by ``repeat`` from 0."""

    controller: str
    trial: Trial
    repeat: int
    trace: Trace

    @property
    def file_name(self) -> str:
        """Name of the run's trace file, unique within an evaluation."""
        return f"{io.safe_file_name(self.controller)}-{self.trial.name}-{self.repeat}.parquet"


def floor_robot(robot: Robot, floor: str) -> Robot:
    """Return the robot on another floor; UsageError where there is no such floor."""
    if floor not in FLOORS:
        raise errors.UsageError(errors.unknown_name("floor", floor, FLOORS))
    if floor == "soft":
        return robot
    reality = replace(robot.reality, ground=GroundMismatch())
    return replace(robot, contact=Contact(0.02, 1.0, robot.contact.friction), reality=reality)


def run_trials(
    label: str,
    controller: Controller,
    setup: RolloutConfig,
    trials: Sequence[Trial],
    *,
    repeats: int,
    seed: int,
    robots: Sequence[Robot] = (),
    on_progress: Callable[[float], None] = lambda _share: None,
) -> list[Run]:
    """Record all trials of one controller; those of equal length run as one batch.

    Each has so many realisations of noise and delay, which follow from the seed, each on the robot
    of its number if there are some. ``on_progress`` is called with the share done.
    """
    total, done = sum(trial.seconds for trial in trials), 0.0
    runs: list[Run] = []
    for seconds in sorted({trial.seconds for trial in trials}):
        batch = [trial for trial in trials if trial.seconds == seconds]
        share = len(batch) * seconds / total

        def on_tick(tick: int, ticks: int, done: float = done, share: float = share) -> None:
            on_progress(done + share * tick / ticks)

        legs = [(trial, repeat) for trial in batch for repeat in range(repeats)]
        commands = np.stack([trial.commands(setup.rate) for trial, _ in legs], axis=1)
        noise = np.random.SeedSequence([seed, round(1000 * seconds)]).generate_state(1)
        world = LegSimulator(
            setup.robot, len(legs), rate=setup.rate, timestep=setup.timestep,
            threads=setup.threads, robots=[robots[repeat] for _, repeat in legs if robots],
        )  # fmt: skip
        record = rollout(controller, setup, commands, int(noise[0]), on_tick, legs=world)
        for leg, (trial, repeat) in enumerate(legs):
            header = {"trial": trial.name, "kind": trial.kind, "repeat": repeat, "seed": seed}
            trace = record.trace(leg, controller=label, **header)
            runs.append(Run(label, trial, repeat, trace))
        done += share
    return sorted(runs, key=lambda run: (trials.index(run.trial), run.repeat))


def load_run(path: Path) -> Run:
    """Load a trace as a run; traces from elsewhere count as fixed trials of their own.

    The name of a controller whose height was measured on hardware says so.
    """
    trace = load_trace(path)
    hopping = measured_hopping(trace)
    trace, measured = (trace, "") if hopping is None else (hopping, ", measured")
    trace.require_ticks(path)
    command, period = trace.column("command_m"), float(np.median(np.diff(trace.column("time_s"))))
    if not np.isfinite(command).all():
        raise errors.TraceError(f"{path} is no run: 'command_m' must be a number in every row.")
    steps = tuple((float(command[a]), (b - a) * period) for a, b in stretches(command))
    header, default = trace.header, "fixed" if len(steps) == 1 else "sequence"
    return Run(
        controller=str(header.get("controller", path.stem)) + measured,
        trial=Trial(steps, str(header.get("kind", default))),
        repeat=repeat if isinstance(repeat := header.get("repeat"), int) else 0,
        trace=trace,
    )


def measured_hopping(trace: Trace) -> Trace | None:
    """Return the hopping of a trial on hardware, from time zero, with the rate of its height.

    Short gaps of the heights are interpolated; None where no hopping was measured.
    """
    if not trace.header.get("height_sensor") or trace.table.height < 2:
        return None
    table = trace.table.with_columns(interpolated("^(height|.*_clearance)_m$"))
    rate = np.gradient(Trace(table).column("height_m"), trace.column("time_s"))
    hops = np.isfinite(trace.column("hip_command_nm"))
    hopping = table.with_columns(height_rate_m_s=rate).filter(hops)
    if hopping["height_m"].null_count() == hopping.height:
        return None
    return Trace(hopping.with_columns(pl.col("time_s") - pl.col("time_s").first()), trace.header)
