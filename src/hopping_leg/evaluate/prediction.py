"""What the legs that an identification allows do, as 90 % intervals, and later runs beside them.

Hardware may not measure its height: a controller's estimate of its apexes is predicted, too, so
that like is compared with like, and so is what joints alone tell.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import UsageError
from hopping_leg.evaluate import metrics
from hopping_leg.evaluate.trials import Run
from hopping_leg.io import parse_json, read_dataclass
from hopping_leg.robot.parameters import JOINTS
from hopping_leg.trace import Trace

_TAILS = (0.05, 0.95)  # of a 90 % interval
_LEAST_SECONDS = 1.0  # of settled hopping that are worth comparing
_JUDGES = ("median_apex_m", f"median_{metrics.ESTIMATED_APEX}", "hop_rate_hz")
"""What decides whether reality is as predicted: the first that its traces tell."""


@dataclass(frozen=True)
class Prediction:
    """Where 90 % of a quantity that ``observe`` tells lie, over legs and, of apexes, hops."""

    controller: str
    policy_digest: str | None
    robot_digest: str | None
    """Of what the controller believes."""
    command_m: float
    quantity: str
    low: float
    mean: float
    high: float
    measured: float | None = None
    """Median of what later runs told."""
    inside_share: float = 1.0
    values: int = 0
    """How many values later runs told."""

    @property
    def holds(self) -> bool:
        """Whether what was measured lies in the interval."""
        return self.measured is None or self.low <= self.measured <= self.high


def shown(predictions: Sequence[Prediction]) -> tuple[list[str], list[list[str]]]:
    """Return headings and rows: mean or measured median, * beyond its interval, and interval."""
    cells: dict[str, dict[str, str]] = {}
    for p in predictions:
        value = f"{p.mean if p.measured is None else p.measured:.4g}{'' if p.holds else '*'}"
        row = cells.setdefault(p.quantity, {})
        row[f"{p.controller}, {p.command_m:g} m"] = f"{value} [{p.low:.4g}, {p.high:.4g}]"
    columns = list(dict.fromkeys(column for row in cells.values() for column in row))
    rows = [[name, *(row.get(column, "-") for column in columns)] for name, row in cells.items()]
    return ["", *columns], rows


def observe(window: metrics.HopWindow) -> dict[str, Array]:
    """Return what a stretch of a run tells once it has settled: apexes, (hops,), and numbers, (1,).

    What the trace does not tell is left out. The hop rate is that of the knee's pushes, by the
    harmonic product spectrum; ``p99`` are quantiles of magnitudes; power is what the motors put in.
    A row of hardware has the torque before it, one of a simulation that behind it.
    """
    rate = 1 / float(np.median(np.diff(window.part.column("time_s"))))
    settled = Trace(window.part.table.tail(round(window.settled * rate)))
    apexes = {"apex_m": metrics.errors_of([window])[0] + window.command}
    if metrics.ESTIMATED_APEX in settled.table.columns:
        estimate = settled.column(metrics.ESTIMATED_APEX)
        estimate = estimate[np.isfinite(estimate)]
        apexes[metrics.ESTIMATED_APEX] = estimate[1:][np.diff(estimate) != 0]
    known, skips = np.isfinite(window.standing), float(window.skipped > 0)
    found: dict[str, Any] = {"share_of_legs_that_skip": skips} if known else {}
    for name, heights in apexes.items():
        if len(heights) and np.isfinite(heights).all():
            found |= {name: heights, f"median_{name}": np.median(heights)}
            found[name.replace("apex", "std")] = np.std(heights)
    torque, speed = (
        np.nan_to_num([settled.column(f"{joint}_{name}") for joint in JOINTS])
        for name in ("torque_nm", "velocity_rad_s")
    )
    push, size = np.maximum(torque[1], 0), 32 * torque.shape[1]
    spectrum = np.abs(np.fft.rfft(push - push.mean(), size))
    product = np.prod([spectrum[::n][: len(spectrum) // 3] for n in (1, 2, 3)], axis=0)
    found["hop_rate_hz"] = np.argmax(product) * rate / size
    for name, values in (("p99_torque_nm", torque), ("p99_speed_rad_s", speed)):
        p99 = np.quantile(np.abs(values), 0.99, axis=1)
        found |= {f"{joint}_{name}": one for joint, one in zip(JOINTS, p99, strict=True)}
    during = torque[:, 1:] if "part" in settled.table.columns else torque[:, :-1]
    power = during * (speed[:, 1:] + speed[:, :-1]) / 2
    found["mean_power_w"] = np.maximum(power, 0).sum(axis=0).mean()
    return {name: np.atleast_1d(values) for name, values in found.items()}


def _values(runs: Sequence[Run]) -> dict[tuple[Any, ...], Array]:
    """Return all that runs tell, by the first five fields of a ``Prediction``.

    Of a run on hardware only the part counts in which its controller acts.
    """
    found: dict[tuple[Any, ...], list[Array]] = {}
    for run in runs:
        header, acting = run.trace.header, np.isfinite(run.trace.column("hip_command_nm"))
        trace = Trace(run.trace.table.filter(acting), header)
        digests = (header.get("policy_digest"), header.get("robot_digest"))
        who = (header.get("controller", run.controller), *digests)
        for window in metrics.measure(trace) if len(trace.table) > 1 else ():
            if window.settled >= _LEAST_SECONDS:
                for name, values in observe(window).items():
                    found.setdefault((*who, round(window.command, 6), name), []).append(values)
    return {key: np.concatenate(values) for key, values in found.items()}


def predict(runs: Sequence[Run]) -> list[Prediction]:
    """Return what runs on many legs predict.

    In expectation 90 % of what one more leg does lies in the interval of 19 legs or more.
    """
    return [
        Prediction(*who, float(low), float(values.mean()), float(high))  # type: ignore[call-arg]
        for who, values in _values(runs).items()
        for low, high in [np.quantile(values, _TAILS, method="weibull")]
    ]


def compare(file: Path, runs: Sequence[Run]) -> tuple[list[Prediction], list[str]]:
    """Return what an evaluation's JSON predicts, with what later runs measured of it.

    Behind it are sentences: what differs, and whether reality is as predicted. UsageError says that
    the file holds no predictions, or that nothing of the runs was predicted.
    """
    rows = parse_json(file.read_bytes(), str(file)).get("predictions") or None
    if not isinstance(rows, list):
        raise UsageError(f"{file} has no predictions; let `hop evaluate --posterior` write some.")
    predictions = [read_dataclass(Prediction, row, f"{file}: prediction") for row in rows]
    notes, compared = dict[str, None](), []
    for (*who, command, quantity), values in _values(runs).items():
        at = [p for p in predictions if (p.command_m, p.quantity) == (command, quantity)]
        for p in [p for p in at if p.controller == who[0]] or at[:1]:
            for name, own in zip(("controller", "policy_digest", "robot_digest"), who, strict=True):
                if own != (other := getattr(p, name)):
                    notes[f"Warning: {name} of a trace is {own}, of the prediction {other}."] = None
            share = float(((values >= p.low) & (values <= p.high)).mean())
            median, count = float(np.median(values)), len(values)
            compared.append(replace(p, measured=median, inside_share=share, values=count))
    if not any(p.quantity in _JUDGES for p in compared):
        least = metrics.START_SECONDS + _LEAST_SECONDS
        raise UsageError(f"No trace hops for {least:g} s at a height that {file} predicts.")
    judge = next(name for name in _JUDGES if any(name == p.quantity for p in compared))
    inside = [p.holds for p in compared if p.quantity == judge]
    single = [p for p in compared if p.quantity == judge.removeprefix("median_")]
    count = sum(p.values for p in single)
    share = sum(p.inside_share * p.values for p in single) / count
    verdict = (
        f"Reality is {'' if all(inside) else 'not '}within what was predicted: {judge} is in its"
        f" 90 % interval at {sum(inside)} of {len(inside)} commands, and {share:.0%} of {count}"
        f" {'hops' if judge.startswith('median') else 'runs'} are."
    )
    return compared, [*notes, verdict]
