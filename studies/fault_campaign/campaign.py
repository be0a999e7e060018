"""The whole campaign: every family, again and again, for every controller; it may be interrupted.

Finished trials are kept in a file, one JSON line each, and are not repeated.
"""

import json
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed
from dataclasses import asdict, dataclass
from functools import lru_cache
from importlib.metadata import version
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from hopping_leg.cli.options import at_least
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.progress import ShareProgress
from hopping_leg.robot import DEFAULT_ROBOT, Robot, load_robot
from hopping_leg.terminal import plain_console
from hopping_leg.workers import ProcessWorkers
from studies.fault_campaign.case import Case, Result
from studies.fault_campaign.families import FAMILIES
from studies.fault_campaign.live import LIVE, play_live
from studies.fault_campaign.trial import play
from studies.shared import host

_TRIALS = "trials.jsonl"
_ABOUT = "campaign.json"
_SHOWN = 50
"""Unsafe trials that are told in full."""

Row = dict[str, Any]
"""A trial: its case and its result."""


@dataclass(frozen=True)
class Campaign:
    """What is tried.

    Raises:
        UsageError: A family is unknown.
    """

    controllers: tuple[str, ...] = ("fast", "energy-shaping")
    """Shipped names or files."""
    robot: str = DEFAULT_ROBOT
    """The leg behind the wire: a shipped name or the path of a .toml file."""
    families: tuple[str, ...] = tuple(FAMILIES)
    """Families of faults."""
    repeats: int = 100
    """Random moments of each family, for each controller."""
    live: int = 10
    """Of them in real time, of the families that show in an answer: they measure reactions."""
    seed: int = 0
    """Of moments, values and drives."""

    def __post_init__(self) -> None:
        for name in self.families:
            if name not in FAMILIES:
                raise UsageError(unknown_name("fault family", name, FAMILIES))

    def cases(self) -> Iterator[Case]:
        """Yield all trials, so that every family is tried early; those in real time come last."""
        shown = [family for family in self.families if family in LIVE]
        for live, repeats, families in (
            (False, self.repeats, self.families),
            (True, self.live, shown),
        ):
            for index, family, controller in product(range(repeats), families, self.controllers):
                yield Case(family, controller, self.robot, index, self.seed, live)


def run_campaign(
    campaign: Campaign,
    folder: Path,
    *,
    workers: int = 0,
    on_trial: Callable[[int, int, int], None] = lambda _done, _total, _unsafe: None,
) -> dict[str, Any]:
    """Run what is not done yet; return the summary of all trials.

    Args:
        campaign: What is tried.
        folder: Where finished trials are kept.
        workers: Processes, 0 for one per core.
        on_trial: Called with (trials done, trials in all, unsafe ones so far).

    Raises:
        UsageError: The folder holds another campaign.
    """
    robot = load_robot(campaign.robot)
    robot.require_leg()
    _claim(folder, campaign, robot)
    rows = _load(folder / _TRIALS)
    cases = list(campaign.cases())
    wanted = {_key(asdict(case)) for case in cases}
    rows = [row for row in rows if _key(row) in wanted]
    done = {_key(row) for row in rows}
    missing = [case for case in cases if _key(asdict(case)) not in done]
    on_trial(len(rows), len(cases), _unsafe(rows))
    with (folder / _TRIALS).open("a", encoding="utf-8") as file:
        for row in _run(missing, workers):
            file.write(json.dumps(row) + "\n")
            file.flush()
            rows.append(row)
            on_trial(len(rows), len(cases), _unsafe(rows))
    return summary(campaign, robot, rows)


def summary(campaign: Campaign, robot: Robot, rows: Sequence[Row]) -> dict[str, Any]:
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


def _family_row(name: str, rows: Sequence[Row]) -> dict[str, Any]:
    own = [row for row in rows if row["family"] == name]
    fair = [row for row in own if not row["disturbed"]]
    reactions = [row["reaction"] for row in fair if row["reaction"] is not None]
    reasons = Counter(row["reason"] or "KILLED" for row in own)
    return {
        "family": name,
        "trials": len(own),
        "unsafe": _unsafe(own),
        "reasons": dict(reasons.most_common()),
        "reaction_p99_s": _percentile(reactions, 99),
        "braked_max_s": max((r["braked"] for r in own if r["braked"] is not None), default=None),
    }


def _percentile(values: Sequence[float], share: float) -> float | None:
    return float(np.percentile(values, share, method="higher")) if values else None


def _unsafe(rows: Sequence[Row]) -> int:
    return sum(bool(row["problems"]) for row in rows)


def _key(row: Row) -> tuple[str, str, int, int, bool]:
    return row["family"], row["controller"], row["index"], row["seed"], row["live"]


def _claim(folder: Path, campaign: Campaign, robot: Robot) -> None:
    """Refuse to mix trials of another leg or version with these."""
    about = {"robot_digest": robot.digest, "version": version("hopping-leg")}
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / _ABOUT
    if not file.exists():
        file.write_text(json.dumps(about), encoding="utf-8")
    elif json.loads(file.read_text(encoding="utf-8")) != about:
        raise UsageError(
            f"{folder} holds trials of another leg or version than {campaign.robot};"
            " give another --out or remove it."
        )


def _load(file: Path) -> list[Row]:
    """Return the finished trials; a line that was cut off by a kill is dropped."""
    if not file.exists():
        return []
    rows, whole = [], b""
    for line in file.read_bytes().splitlines(keepends=True):
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError:
            break
        whole += line
    file.write_bytes(whole)
    return rows


def _run(cases: Sequence[Case], workers: int) -> Iterator[Row]:
    """Yield rows as they come; what is timed has the computer for itself.

    The slow ones come first, so that the time left does not rise.
    """
    for case in cases:
        if case.live:
            yield play_case(case)
    yield from _run_virtual([case for case in cases if not case.live], workers)


def _run_virtual(cases: Sequence[Case], workers: int) -> Iterator[Row]:
    with ProcessWorkers(workers) as processes:
        if min(processes.count, len(cases)) <= 1:
            yield from map(play_case, cases)
            return
        for future in as_completed([processes.submit(play_case, case) for case in cases]):
            yield future.result()


def play_case(case: Case) -> Row:
    """Run one trial; what it raises is a problem, too."""
    began = time.perf_counter()
    try:
        trial = play_live if case.live else play
        result = trial(case, FAMILIES[case.family], _robot(case.robot))
    except Exception as error:
        problem = f"the trial failed: {type(error).__name__}: {error}"
        result = Result("", problems=[problem])
    return {**asdict(case), **asdict(result), "seconds": time.perf_counter() - began}


@lru_cache(maxsize=4)
def _robot(name: str) -> Robot:
    return load_robot(name)


@dataclass(frozen=True)
class Faults(Campaign):
    """Let everything go wrong that can, at random moments of the hop cycle; count what is unsafe.

    Trials run in virtual time behind the emulated wire and are exact; some run in real time, too,
    and measure how soon the host reacts, fairly on an idle computer only. Interrupted, it goes on.
    """

    workers: int = 0
    """Processes, 0 for one per core; results do not depend on it."""
    out: Path = Path("runs/bench-faults")
    """Where finished trials are kept; they are not repeated."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        at_least(1, repeats=self.repeats)
        at_least(0, seed=self.seed, workers=self.workers, live=self.live)
        with ShareProgress() as bar:
            result = run_campaign(
                self,
                self.out,
                workers=self.workers,
                on_trial=lambda done, total, unsafe: bar.show(
                    f"trials, {unsafe} unsafe", done / total
                ),
            )
        _print(result)
        return result


def _print(result: dict[str, Any]) -> None:
    table = Table("family", "trials", "unsafe", "ended for", "reaction 99 %, ms")
    for row in result["rows"]:
        reasons = ", ".join(f"{name.lower()} {n}" for name, n in row["reasons"].items())
        table.add_row(
            row["family"],
            str(row["trials"]),
            str(row["unsafe"]),
            reasons,
            _ms(row["reaction_p99_s"]),
        )
    console = plain_console()
    console.print(table)
    console.print(
        f"{result['trials']} trials, {result['unsafe']} unsafe. Bad answer to safe command:"
        f" {_ms(result['reaction_p99_s'])} ms at 99 %. Host's death to brake:"
        f" {_ms(result['host_death_to_brake_max_s'])} ms at most."
    )
    if result["disturbed_trials"]:
        console.print(
            f"{result['disturbed_trials']} of {result['live_trials']} trials in real time ended"
            " safely before their time as the computer was too busy; they tell nothing."
        )
    for row in result["unsafe_trials"]:
        console.print(f"{row['family']}, {row['controller']}, {row['what']}: {row['problems'][0]}")


def _ms(seconds: float | None) -> str:
    return "-" if seconds is None else f"{seconds * 1e3:.1f}"
