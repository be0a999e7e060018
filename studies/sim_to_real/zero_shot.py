"""Controllers on legs that they have never met, without any tuning: pairs of leg and command."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from hopping_leg import io
from hopping_leg.arrays import BoolArray, IntArray
from hopping_leg.cli.options import Heights, JsonFile, at_least, say
from hopping_leg.controllers import RolloutConfig, registry, rollout
from hopping_leg.controllers.command_schedule import command_range
from hopping_leg.controllers.rollout import Rollout
from hopping_leg.deploy.drive_link import DriveMode, Reply
from hopping_leg.deploy.safety_limits import hopping_limits
from hopping_leg.deploy.stop_reasons import SupervisorInput
from hopping_leg.deploy.supervisor import State, SupervisorState, supervise
from hopping_leg.errors import UsageError
from hopping_leg.evaluate import runner, statistics, trials
from hopping_leg.hop_detection import find_hops, measure_hops
from hopping_leg.robot import JOINTS, NO_MISMATCH, Robot, load_robot, parent_robot
from studies.shared import Row, do_all, show_rows
from studies.sim_to_real.twins import LEAST_TWINS, Noise, disturbance_of, drawn_twin, fingerprint

COMMANDS = (0.22, 0.24, 0.26, 0.28, 0.30, 0.32, 0.34, 0.36, 0.38, 0.40)
"""Apex heights of a leg of the paper's size, m; others are asked for as many times as much."""

REACHED = 0.005
"""Median error with which shooting, undisturbed and told state and leg, reaches a command, m."""

_NEAR = 0.010  # error of a hop that is near its command, m
_UNCOUNTED = 5  # hops at the start of a run
_SEED = 1000
_MEASURED = ("position_rad", "velocity_rad_s", "torque_nm")
_CONTACTS = ("body_contacts", "stop_contacts")

_SHARES: dict[str, Callable[[Row], tuple[int, int]]] = {
    "hops_within_10mm": lambda r: (r["hops_within_10mm"], r["hops"] + r["missed_hops"]),
    "within_5mm": lambda r: (r["median_abs_error_m"] <= 0.005, 1),
    "within_10mm": lambda r: (r["median_abs_error_m"] <= _NEAR, 1),
    "within_3_percent": lambda r: (r["median_abs_error_m"] <= 0.03 * r["command_m"], 1),
    "reached_within_10mm": lambda r: (r["reached"] * _SHARES["within_10mm"](r)[0], r["reached"]),
}
"""How many of how many are counted in each pair."""


def believed_of(source: str) -> Robot:
    """Return what is told of a leg: of one with [reality] what its file extends, else itself."""
    robot, parent = load_robot(source), parent_robot(source)
    if robot.reality == NO_MISMATCH or parent is None:
        return robot
    return load_robot(parent)


def stopped(run: Rollout, leg: int, robot: Robot) -> bool:
    """Return whether the supervisor of the real leg would end a run, from the true state."""
    limits = hopping_limits(robot, 1 / (run.time[1] - run.time[0]))
    columns = [
        [run.data[f"{joint}_{name}"][:, leg].tolist() for name in _MEASURED] for joint in JOINTS
    ]
    voltage = (limits.voltage_low + limits.voltage_high) / 2
    state = SupervisorState(State.RUNNING)
    for tick, time in enumerate(run.time.tolist()):
        hip, knee = (
            Reply(q[tick], qd[tick], torque[tick], DriveMode.POSITION, 0, voltage, 20.0, time)
            for q, qd, torque in columns
        )
        state, _ = supervise(limits, state, SupervisorInput(time, 0.0, (hip, knee), (0.0, 0.0)))
        if state.state is not State.RUNNING:
            return True
    return False


def pair(run: Rollout, leg: int, command: float, robot: Robot) -> Row:
    """Return a leg's hops at one command, m, after the fifth; of fewer, after a third of the run.

    A skipped hop, and the whole run of a leg that never hops, err by how much lower it stands.
    """
    data = {name: values[:, leg] for name, values in run.data.items()}
    rate = 1 / (run.time[1] - run.time[0])
    series = (data["height_m"], data["height_rate_m_s"], data["foot_clearance_m"])
    ticks = find_hops(*series).tick
    first = int(ticks[_UNCOUNTED - 1]) + 1 if len(ticks) > _UNCOUNTED else len(run.time) // 3
    hops = measure_hops(*series, rate, first)
    missed = hops.skipped if len(hops.apex) else max(hops.skipped, 1)
    below = np.full(missed, abs(data["height_m"][0] - command))
    error = np.concatenate([np.abs(hops.apex - command), below])
    body = np.minimum(data["base_clearance_m"], data["knee_clearance_m"]) <= 0
    return {
        "command_m": command,
        "median_abs_error_m": float(np.median(error)),
        "mean_abs_error_m": float(error.mean()),
        "std_m": float(hops.apex.std()) if len(hops.apex) else None,
        "hops": len(hops.apex),
        "hops_within_10mm": int(np.count_nonzero(error <= _NEAR)),
        "missed_hops": missed,
        "skipped_hops": hops.skipped,
        "body_contacts": _times(body),
        "stop_contacts": _times(data["stop_contact"] > 0),
        "would_be_stopped": stopped(run, leg, robot),
    }


def _times(happens: BoolArray) -> int:
    return int(np.count_nonzero(np.diff(happens.astype(int), prepend=0) > 0))


def try_out(source: str, name: str, commands: Sequence[float], seconds: float, noise: Noise) -> Row:
    """Let a controller hop on the leg of a robot file at each command; return the pairs."""
    robot, believed = load_robot(source), believed_of(source)
    config = RolloutConfig(robot, disturbance_of(robot, noise), threads=1)
    controller = registry.load_controller(name, believed, simulated=True)
    heights = trials.scaled(commands, believed)
    shown = np.clip(heights, *command_range(controller, believed))
    schedule = np.tile(shown, (round(seconds * config.rate), 1))
    run = rollout(controller, config, schedule, _SEED)
    where = {"controller": name, "disturbance": noise, "robot": Path(source).stem}
    pairs = [pair(run, leg, command, robot) for leg, command in enumerate(heights)]
    return {"pairs": [{**where, **row} for row in pairs]}


def summarize(pairs: Sequence[Row]) -> list[Row]:
    """Return a row per controller and disturbance, over all pairs, whether reached or not.

    Shares are of pairs, or of single hops where they say so; intervals are 95 % over legs.
    """
    rows = []
    for name, noise in dict.fromkeys((row["controller"], row["disturbance"]) for row in pairs):
        own = [row for row in pairs if (row["controller"], row["disturbance"]) == (name, noise)]
        errors = [row["median_abs_error_m"] for row in own]
        stds = [row["std_m"] for row in own if row["std_m"] is not None]
        rows.append({
            "controller": name,
            "disturbance": noise,
            "pairs": len(own),
            **_shares(own),
            "closer_than_energy_shaping": _closer(own, pairs, registry.ENERGY_SHAPING),
            "closer_than_tuned": _closer(own, pairs, registry.ENERGY_SHAPING_TUNED),
            "median_abs_error_m": float(np.median(errors)),
            "worst_abs_error_m": max(errors),
            "median_std_m": float(np.median(stds)) if stds else None,
            "would_be_stopped": float(np.mean([row["would_be_stopped"] for row in own])),
            **{key: sum(row[key] for row in own) for key in ("skipped_hops", *_CONTACTS)},
        })  # fmt: skip
    return rows


def _closer(own: Sequence[Row], pairs: Sequence[Row], than: str) -> float | None:
    """Return on what share of its pairs a controller errs by less than another, if there."""
    other = {_place(row): row["mean_abs_error_m"] for row in pairs if row["controller"] == than}
    closer = [row["mean_abs_error_m"] < other[_place(row)] for row in own if _place(row) in other]
    return float(np.mean(closer)) if closer and own[0]["controller"] != than else None


def _shares(rows: Sequence[Row]) -> Row:
    legs, found = list(dict.fromkeys(row["robot"] for row in rows)), Row()
    for name, count in _SHARES.items():
        sums = np.array([np.sum([count(r) for r in rows if r["robot"] == k], axis=0) for k in legs])

        def share(index: Sequence[int], sums: IntArray = sums) -> float:
            held, of = sums[list(index)].sum(axis=0)
            return float(held / max(of, 1))

        low, high = statistics.bootstrap(range(len(legs)), share, 0, LEAST_TWINS)
        found |= {name: share(range(len(legs)))}
        found |= {f"{name}_low": float(low), f"{name}_high": float(high)}
    return found


def _place(row: Row) -> tuple[str, float, str]:
    return row["robot"], row["command_m"], row["disturbance"]


@dataclass(frozen=True)
class ZeroShot:
    """Let controllers hop on legs that they have never met: drawn twins, or a folder's robots."""

    controllers: tuple[str, ...] = ("universal", "energy-shaping", "energy-shaping-tuned")
    """Names or files of controllers; each is told the robot that a twin's file extends."""
    twins: int = 100
    """How many twins to draw."""
    seed: int = 0
    """Seed of the first; each has the next."""
    friction: float = 0.0
    """How much more friction both joints of a drawn twin have than usual, N m."""
    hip_gain: float = 1.0
    """How many times as much as usual its hip's motor gives of what it is asked for."""
    folder: Path | None = None
    """Take the robot files of this folder instead; those without [reality] are told as they are."""
    commands: Heights = COMMANDS
    """Apex heights, m, for a leg of the paper's size."""
    disturbance: tuple[Literal["on", "off"], ...] = ("on",)
    """The paper's noise and delay, on top of a twin's own; both may be named."""
    seconds: float = 12.0
    """Duration of each run, s; the first five hops do not count."""
    jobs: int = 1
    """Trials at the same time, each in its own process."""
    out: Path = Path("runs/zero-shot")
    """Folder for twins and trials; what is there is not done again."""
    json: JsonFile = None

    def measure(self) -> Row:
        """Hop, print the summary, return every number."""
        at_least(1, jobs=self.jobs, twins=self.twins)
        asked = itertools.product(dict.fromkeys(self.controllers), dict.fromkeys(self.disturbance))
        every = list(dict.fromkeys([(registry.MPC_TRUE_STATE, "off"), *asked]))
        sources = self._sources()
        tried = do_all((self._trial(s, *one) for s in sources for one in every), self.jobs)
        pairs = [row for found in tried for row in found["pairs"]]
        reached = {
            _place(row)[:2]
            for row in pairs
            if (row["controller"], row["disturbance"]) == every[0]
            and row["median_abs_error_m"] <= REACHED
        }
        for row in pairs:
            row["reached"] = _place(row)[:2] in reached
        summary, places = summarize(pairs), len(sources) * len(self.commands)
        show_rows(
            summary, "controller", "disturbance", "hops_within_10mm", "within_5mm", "within_10mm",
            "closer_than_tuned", "median_abs_error_m", "median_std_m", "skipped_hops",
            "body_contacts", "would_be_stopped",
        )  # fmt: skip
        say(
            f"{len(reached)} of {places} pairs of leg and command are within reach of"
            f" {registry.MPC_TRUE_STATE}, undisturbed; shares are of all."
        )
        return {
            "legs": len(sources),
            "reached": len(reached) / places,
            "summary": summary,
            "pairs": pairs,
            "versions": runner.software_versions(),
        }

    def _trial(self, source: str, name: str, noise: Noise) -> tuple[Any, ...]:
        believed = believed_of(source)
        asked = {
            "controller": fingerprint(registry.load_controller(name, believed, simulated=True)),
            "robot": load_robot(source).digest,
            "believed": believed.digest,
            "commands": self.commands,
            "seconds": self.seconds,
            "disturbance": noise,
        }
        words = f"{Path(source).stem}-{io.safe_file_name(name)}-{noise}"
        file = self.out / "trials" / f"{words}.json"
        return file, asked, try_out, source, name, self.commands, self.seconds, noise

    def _sources(self) -> list[str]:
        if self.folder is None:
            seeds = range(self.seed, self.seed + self.twins)
            hard = self.out / "twins", self.friction, self.hip_gain
            return [drawn_twin(seed, *hard).source for seed in seeds]
        files = sorted(map(str, self.folder.glob("*.toml")))
        if not files:
            raise UsageError(
                f"There is no robot file in {self.folder}; make some with `hop robots draw twins"
                f" --out {self.folder}`."
            )
        return files
