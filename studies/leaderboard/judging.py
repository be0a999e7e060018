"""Submissions meet the legs: jobs whose results are kept."""

import json
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from hopping_leg.controllers import RolloutConfig
from hopping_leg.evaluate import runner, statistics
from hopping_leg.evaluate.entries import Entry
from hopping_leg.evaluate.result_files import ResultCache
from hopping_leg.evaluate.robustness import axes, outcome, suite, trials
from hopping_leg.evaluate.trials import COMMANDS
from hopping_leg.io import write_json
from hopping_leg.robot import Robot, load_robot
from hopping_leg.sim import NO_NOISE
from hopping_leg.sim.perturbation import Perturbation
from hopping_leg.sim.randomization import draw_twin
from hopping_leg.sim_to_real.jobs import Job
from studies.leaderboard.submissions import ROBOT, Submission

SEED = 1000
"""Of all trials, and of the first twin; no seed from here on has chosen a shipped controller."""

AXES = tuple(axis.name for axis in axes.AXES if axis.leaderboard)
"""Those of RealAIGym's robustness leaderboard."""

_PACE = 40.0
"""Seconds of one leg that are simulated in a second on one core, roughly."""


@dataclass(frozen=True)
class Judgement(Job):
    """What a submission is put through; the result is a file."""

    submission: Submission
    digest: str
    """Of the submission."""
    folder: Path
    """Holds the results of all submissions."""
    seconds: float = trials.SECONDS
    """Duration of each trial, s."""

    part: ClassVar[str]

    @property
    def kept(self) -> Path:
        """Folder of the results of this submission, as it is now."""
        return self.folder / f"{self.submission.name}-{self.digest}"

    @property
    def file(self) -> Path:
        """Where the result is."""
        return self.kept / f"{self.part}.json"

    @property
    def name(self) -> str:
        """What is done."""
        return f"{self.submission.name}, {self.part}"

    @property
    @abstractmethod
    def asked(self) -> dict[str, Any]:
        """What the result depends on besides the submission, as JSON values."""

    @abstractmethod
    def judge(self) -> dict[str, Any]:
        """Do it; return the result as JSON values."""

    @property
    def done(self) -> bool:
        """Whether the result is stored and of these options."""
        if not self.file.exists():
            return False
        stored = json.loads(self.file.read_bytes())["asked"]
        return bool(stored == json.loads(json.dumps(self.asked)))

    def run(self, *, quiet: bool) -> None:
        """Do it and store the result."""
        write_json(self.file, {"asked": self.asked, "result": self.judge()})

    def result(self) -> dict[str, Any]:
        """Return the stored result."""
        return dict(json.loads(self.file.read_bytes())["result"])


@cache
def twin(number: int) -> Robot:
    """Return a twin of the leg by its number."""
    return draw_twin(SEED + number, ROBOT).robot


@dataclass(frozen=True)
class OnTwins(Judgement):
    """A submission on drawn twins, which bring noise, delay and losses of their own."""

    twins: int = 50

    part = "twins"

    @property
    def weight(self) -> float:
        """Rough time, s."""
        return self.twins * len(COMMANDS) * self.seconds / _PACE

    @property
    def asked(self) -> dict[str, Any]:
        """Twins and trials."""
        return {
            "twins": [twin(number).digest for number in range(self.twins)],
            "commands_m": COMMANDS,
            "seconds": self.seconds,
            "seed": SEED,
            "versions": runner.software_versions(),
        }

    def judge(self) -> dict[str, Any]:
        """Hop at every command on every twin."""
        setup = RolloutConfig(load_robot(ROBOT), NO_NOISE, threads=1)
        legs = tuple(
            trials.RobustnessTrial(0.0, command, number, 0, axes.Case(twin(number)))
            for number in range(self.twins)
            for command in COMMANDS
        )
        ticks = round(self.seconds * setup.rate)
        nothing = np.zeros((ticks, len(legs)))
        robots = tuple(leg.case.robot for leg in legs)
        plan = trials.AxisTrials(
            legs,
            np.tile([leg.command for leg in legs], (ticks, 1)),
            Perturbation(robots, np.zeros((*nothing.shape, 2)), nothing, nothing),
            SEED,
        )
        found = outcome.run_axis(self.submission.load(), setup, plan)
        return {"outcomes": [asdict(one) for one in found]}

    def row(self) -> dict[str, Any]:
        """Return the share of successes and the error, with intervals over twins."""
        found = [outcome.Outcome(**row) for row in self.result()["outcomes"]]
        score, low, high = outcome.share([found], SEED)
        errors = [
            np.array([abs(one.error_m) for one in found if one.repeat == number])
            for number in range(self.twins)
        ]
        least, most = statistics.median_interval(errors, SEED, statistics.LEAST_TWINS)
        return {
            "twins": score,
            "twins_low": low,
            "twins_high": high,
            "median_abs_error_m": float(np.median(np.concatenate(errors))),
            "median_abs_error_low_m": least,
            "median_abs_error_high_m": most,
            "missed_trials": sum(one.missed for one in found),
            "skipped_hops": sum(one.skipped for one in found),
            "body_contacts": sum(one.contacts for one in found),
        }


@dataclass(frozen=True)
class OnAxes(Judgement):
    """A submission on the leg that it believes in, changed along axes; each axis is kept."""

    repeats: int = 10

    part = "robustness"

    @property
    def weight(self) -> float:
        """Rough time, s."""
        levels = 1 + sum(len(axes.axis_named(name).levels) for name in AXES)
        return levels * len(COMMANDS) * self.repeats * self.seconds / _PACE

    @property
    def suite(self) -> suite.Suite:
        """What is run."""
        setup = RolloutConfig(load_robot(ROBOT), threads=1)
        return suite.Suite(setup, AXES, COMMANDS, self.repeats, SEED, False, self.seconds)

    @property
    def asked(self) -> dict[str, Any]:
        """Axes and trials."""
        levels = {name: axes.axis_named(name).levels for name in AXES}
        return {**self.suite.conditions, "levels": levels, "versions": runner.software_versions()}

    def judge(self) -> dict[str, Any]:
        """Run the suite; what is kept of it is not run again."""
        entry = Entry(self.submission.name, self.submission.load())
        found = suite.run_suite([entry], self.suite, ResultCache(self.kept / "axes"))
        return {"scores": found["scores"]}

    def progress(self) -> tuple[float, str]:
        """Return the share of the axes that are done, and what to show."""
        done = len([*(self.kept / "axes").glob("*.json")])
        return min(done / (1 + len(AXES)), 1.0), f"{done} of {1 + len(AXES)} parts"

    def scores(self) -> list[dict[str, Any]]:
        """Return a row per axis, the overall one last."""
        rows = self.result()["scores"]
        return [{"submission": r.pop("controller"), **r} for r in rows]


def judgements(
    submissions: Sequence[Submission], folder: Path, twins: int, repeats: int, seconds: float
) -> list[tuple[OnTwins, OnAxes]]:
    """Return what is to be done for each submission."""
    pairs = []
    for one in submissions:
        digest = one.digest()
        pairs.append(
            (
                OnTwins(one, digest, folder, seconds, twins),
                OnAxes(one, digest, folder, seconds, repeats),
            )
        )
    return pairs
