"""The whole campaign: every family, again and again, for every controller; it may be interrupted.

Finished trials are kept, some of a kind in a file, and are not repeated.
"""

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from hopping_leg.cli.options import JsonFile, RobotFile, at_least, say, show_table
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.robot import DEFAULT_ROBOT, Robot, load_robot
from studies.fault_campaign.case import Case, Result
from studies.fault_campaign.families import FAMILIES
from studies.fault_campaign.live import LIVE, play_live
from studies.fault_campaign.trial import play
from studies.shared import Row, do_all, host

_SHOWN = 50
"""Unsafe trials that are told in full."""

_BLOCK = 25
"""Trials that a file keeps."""


@dataclass(frozen=True)
class Faults:
    """Let everything go wrong that can, at random moments of the hop cycle; count what is unsafe.

    Trials run in virtual time behind the emulated wire and are exact; some run in real time, too,
    and measure how soon the host reacts, fairly on an idle computer only. Interrupted, it goes on.
    """

    controllers: tuple[str, ...] = ("fast", "energy-shaping")
    """Shipped names or files."""
    robot: RobotFile = DEFAULT_ROBOT
    families: tuple[str, ...] = tuple(FAMILIES)
    """Families of faults."""
    repeats: int = 100
    """Random moments of each family, for each controller."""
    live: int = 10
    """Of them in real time, of the families that show in an answer: they measure reactions."""
    seed: int = 0
    """Of moments, values and drives."""
    workers: int = 0
    """Processes, 0 for one per core; results do not depend on it."""
    out: Path = Path("runs/bench-faults")
    """Where finished trials are kept; they are not repeated."""
    json: JsonFile = None

    def measure(self) -> Row:
        """Run what is not done yet; print a table, return every number.

        Those in real time come last, one after the other: they have the computer for themselves.
        """
        at_least(1, repeats=self.repeats)
        at_least(0, seed=self.seed, workers=self.workers, live=self.live)
        for name in self.families:
            if name not in FAMILIES:
                raise UsageError(unknown_name("fault family", name, FAMILIES))
        robot = load_robot(self.robot)
        robot.require_leg()
        blocks = do_all(self._blocks(robot, live=False), self.workers)
        blocks += do_all(self._blocks(robot, live=True))
        result = summary(self, robot, [row for block in blocks for row in block["trials"]])
        show(result)
        return result

    def _blocks(self, robot: Robot, *, live: bool) -> Iterator[tuple[Any, ...]]:
        """Yield the jobs, so that every family is tried early."""
        families = [name for name in self.families if name in LIVE] if live else self.families
        repeats = self.live if live else self.repeats
        for first, family, controller in product(
            range(0, repeats, _BLOCK), families, self.controllers
        ):
            cases = [
                Case(family, controller, self.robot, index, self.seed, live)
                for index in range(first, min(first + _BLOCK, repeats))
            ]
            asked = {"robot": robot.digest, "version": version("hopping-leg"),
                     "cases": [asdict(case) for case in cases]}  # fmt: skip
            name = f"{family}-{Path(controller).stem}-{first}{'-live' if live else ''}.json"
            yield self.out / name.replace(" ", "-"), asked, play_block, cases


def summary(campaign: Faults, robot: Robot, rows: Sequence[Row]) -> Row:
    """Return the campaign's numbers."""
    fair = [row for row in rows if not row["disturbed"]]
    measured = [row for row in fair if row["live"]] or fair
    reactions = [row["reaction"] for row in measured if row["reaction"] is not None]
    braked = [row["braked"] for row in fair if row["braked"] is not None]
    bad = [row for row in rows if row["problems"]]
    return {
        "families": list(campaign.families),
        "controllers": list(campaign.controllers),
        "robot": robot.name,
        "robot_digest": robot.digest,
        "repeats": campaign.repeats,
        "live_trials": sum(row["live"] for row in rows),
        "disturbed_trials": len(rows) - len(fair),
        "seed": campaign.seed,
        "trials": len(rows),
        "unsafe": len(bad),
        "reaction_p99_s": _percentile(reactions, 99),
        "reaction_max_s": max(reactions, default=None),
        "host_death_to_brake_max_s": max(braked, default=None),
        "rows": [_family_row(name, rows) for name in campaign.families],
        "unsafe_trials": bad[:_SHOWN],
        "host": host(),
    }


def _family_row(name: str, rows: Sequence[Row]) -> Row:
    own = [row for row in rows if row["family"] == name]
    fair = [row for row in own if not row["disturbed"]]
    reactions = [row["reaction"] for row in fair if row["reaction"] is not None]
    reasons = Counter(row["reason"] or "KILLED" for row in own)
    shown = [row["shown"] for row in own if row["shown"] is not None]
    return {
        "family": name,
        "trials": len(own),
        "unsafe": sum(bool(row["problems"]) for row in own),
        "reasons": dict(reasons.most_common()),
        "reaction_p99_s": _percentile(reactions, 99),
        "shown_p50_s": _percentile(shown, 50),
        "shown_p99_s": _percentile(shown, 99),
        "braked_max_s": max((r["braked"] for r in own if r["braked"] is not None), default=None),
    }


def _percentile(values: Sequence[float], share: float) -> float | None:
    return float(np.percentile(values, share, method="higher")) if values else None


def play_block(cases: Sequence[Case]) -> Row:
    """Run some trials."""
    return {"trials": [play_case(case) for case in cases]}


def play_case(case: Case) -> Row:
    """Run one trial; what it raises is a problem, too."""
    began = time.perf_counter()
    try:
        trial = play_live if case.live else play
        result = trial(case)
    except Exception as error:
        problem = f"the trial failed: {type(error).__name__}: {error}"
        result = Result("", problems=[problem])
    return {**asdict(case), **asdict(result), "seconds": time.perf_counter() - began}


def show(result: Row) -> None:
    """Print the campaign's table and what was unsafe."""
    show_table(
        ("family", "trials", "unsafe", "ended for", "reaction 99 %, ms", "shown 99 %, ms"),
        (
            (row["family"], row["trials"], row["unsafe"],
             ", ".join(f"{name.lower()} {n}" for name, n in row["reasons"].items()),
             _ms(row["reaction_p99_s"]), _ms(row["shown_p99_s"]))
            for row in result["rows"]
        ),
    )  # fmt: skip
    say(
        f"{result['trials']} trials, {result['unsafe']} unsafe. Bad answer to safe command:"
        f" {_ms(result['reaction_p99_s'])} ms at 99 %. Host's death to brake:"
        f" {_ms(result['host_death_to_brake_max_s'])} ms at most."
    )
    if result["disturbed_trials"]:
        say(
            f"{result['disturbed_trials']} of {result['live_trials']} trials in real time ended"
            " safely before their time as the computer was too busy; they tell nothing."
        )
    for row in result["unsafe_trials"]:
        say(f"{row['family']}, {row['controller']}, {row['what']}: {row['problems'][0]}")


def _ms(seconds: float | None) -> str:
    return "-" if seconds is None else f"{seconds * 1e3:.1f}"
