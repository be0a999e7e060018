"""Laws of friction of rising detail, and a small network, on recordings that no fit has seen.

Judged is, on the rig that was commanded in torques, how far the torque that the motion needs is
from what was commanded less what a law takes of it, mean over 0.1 s. What the motion needs is the
balance of momentum as it was fitted with friction that is Coulomb's, viscous and grows with load,
which is what ``hop identify`` fits: were inertias fitted together with a network that sees torques,
it would give back the command, and any inertia would do. The network's hidden weights are drawn;
its readout is fitted, with a ridge that the fitted recordings choose, each held out in turn; an
infinite one leaves it out. Zeros and offsets are each recording's own.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from hopping_leg.arrays import Array
from hopping_leg.errors import UsageError
from hopping_leg.identify.identifiability import correlation_time
from hopping_leg.identify.initial_states import start_states
from hopping_leg.identify.recording import Recording, load_recording
from hopping_leg.identify.recording_format import PAIRS
from hopping_leg.identify.torque_balance import Balance
from studies.identification.real import RIGS

TODAY = "Coulomb, viscous, load"
"""What ``hop identify`` fits on this rig."""
LAWS = ("Stribeck", "direction", "angle", "network")
"""What is tried on top of it, each by itself."""
SMOOTHED = "smoothed"
"""How states are judged that simulations start from."""
_ZEROS = (6, 7, 16, 17)  # columns of a balance that are each recording's own
_PLACES, _UNITS, _LATE = 6, 32, (2, 10)  # angles, hidden units, rows
_RIDGES = (1e-5, 1e-3, 1e-2, 1e-1, 1e6)
_DRAG = 0.05  # rad/s
_EVERY = 10  # rows


@dataclass(frozen=True)
class Equations:
    """A recording's balance, in (N m), of rows of joint 1 and then of joint 2."""

    plain: Array
    """Columns of today's law, (n, k)."""
    columns: dict[str, Array]
    """Those of each further law, (n, m), half of them of each joint."""
    target: Array
    """(n,)"""

    def error(self, values: Array, law: str = "", factors: Array | None = None) -> Array:
        """Return what today's law, and a further one on top, leave of both joints, rms, (2,)."""
        left = self.target - self.plain @ values
        if factors is not None:
            left = left - self.columns[law] @ factors
        return np.asarray(np.sqrt(np.mean(np.square(left.reshape(2, -1)), axis=1)))


def _further(recording: Recording, seed: int) -> dict[str, list[tuple[int, Array]]]:
    """Return what laws add to a balance, by law."""
    q, w = recording.array("position"), recording.array("velocity")
    torque, rng = recording.array("torque_command"), np.random.default_rng(seed)
    late = [np.roll(torque, rows, axis=0) for rows in (0, *_LATE)]
    inputs = np.concatenate([np.sin(q), np.cos(q), w / 5, *(x / 2 for x in late)], axis=1)
    found: dict[str, list[tuple[int, Array]]] = {law: [] for law in LAWS}
    for joint in range(2):
        angle, speed, asked = q[:, joint], w[:, joint], torque[:, joint]
        drag = np.tanh(speed / _DRAG)
        places = np.linspace(float(angle.min()), float(angle.max()), _PLACES)
        weights, shifts = rng.normal(size=(inputs.shape[1], _UNITS)), rng.normal(size=_UNITS)
        values = (
            [drag * np.exp(-np.square(speed / limit)) for limit in (0.2, 1.0)],
            [np.abs(speed), np.abs(asked), np.abs(speed) * speed],
            [drag * np.interp(angle, places, here) for here in np.eye(_PLACES)],
            list(np.tanh(inputs @ weights + shifts).T),
        )
        for law, columns in zip(LAWS, values, strict=True):
            found[law] += [(joint, column) for column in columns]
    return found


def equations(recording: Recording, seed: int) -> Equations:
    """Return a recording's equations; the seed draws the network's hidden weights."""
    further = _further(recording, seed)
    balance = Balance(recording, biased=True, further=list(chain(*further.values())))
    some = np.arange(0, len(balance.target) // 2, _EVERY)
    rows = np.concatenate([some, len(balance.target) // 2 + some])
    design = balance.design[rows]
    own = np.linalg.qr(design[:, _ZEROS])[0]

    def others(values: Array) -> Array:
        return np.asarray(values - own @ (own.T @ values))

    first, columns = 18, {}
    for law, added in further.items():
        columns[law] = others(design[:, first : first + len(added)])
        first += len(added)
    return Equations(others(np.delete(design[:, :16], _ZEROS[:2], 1)), columns, others(
        balance.target[rows]
    ))  # fmt: skip


def plain_values(some: Sequence[Equations]) -> Array:
    """Return the numbers of today's law that fit recordings best."""
    design = np.concatenate([one.plain for one in some])
    return np.asarray(np.linalg.lstsq(design, np.concatenate([one.target for one in some]))[0])


def law_factors(some: Sequence[Equations], values: Array, law: str) -> Array:
    """Return a further law's factors, with the ridge of each joint that the recordings choose."""
    costs = np.array(
        [
            [
                one.error(values, law, _readout([o for o in some if o is not one], values, law, r))
                for one in some
            ]
            for r in ((ridge, ridge) for ridge in _RIDGES)
        ]
    )
    hip, knee = np.log(costs).mean(axis=1).argmin(axis=0)
    return _readout(some, values, law, (_RIDGES[hip], _RIDGES[knee]))


def _readout(
    some: Sequence[Equations], values: Array, law: str, ridges: tuple[float, float]
) -> Array:
    design = np.concatenate([one.columns[law] for one in some])
    target = np.concatenate([one.target - one.plain @ values for one in some])
    held = np.repeat(ridges, design.shape[1] // 2)
    square = design.T @ design / len(target) + np.diag(held)
    return np.asarray(np.linalg.solve(square, design.T @ target / len(target)))


def smoothed(recording: Recording) -> Recording:
    """Return a recording whose states are smoothed as those that simulations start from."""
    names = PAIRS["position"] + PAIRS["velocity"]
    states = np.concatenate(start_states(recording), axis=1).T
    table = recording.trace.table.with_columns(map(pl.Series, names, states))
    return replace(recording, trace=replace(recording.trace, table=table))


def judge(every: Sequence[Equations]) -> dict[str, Any]:
    """Return errors of each law on each recording while the others are fitted.

    ``rows``: by law the rms over recordings of what is left of joints 1 and 2, N m; its share of
    today's, the geometric mean over recordings and joints, and the worst of these.
    """
    left: dict[str, list[Array]] = {law: [] for law in (TODAY, *LAWS)}
    alone, spans = [], []
    for held in every:
        others = [one for one in every if one is not held]
        values = plain_values(others)
        left[TODAY].append(held.error(values))
        for law in LAWS:
            left[law].append(held.error(values, law, law_factors(others, values, law)))
        alone.append(held.error(plain_values([held])))
        rest = (held.target - held.plain @ values).reshape(2, -1)
        spans.append([correlation_time(joint) for joint in rest])
    left[f"{TODAY}, fitted to the recording itself"] = alone
    today = np.array(left[TODAY])
    rows = []
    for law, errors in left.items():
        shares = np.array(errors) / today
        rms = np.sqrt(np.mean(np.square(errors), axis=0))
        share, worst = float(np.exp(np.log(shares).mean())), float(shares.max())
        rows.append({"law": law, "left_nm": rms.tolist(), "share": share, "worst_share": worst})
    return {"rows": rows, "alike": np.mean(spans, axis=0).tolist()}


def friction(folder: Path, seed: int, report: Callable[[str], None]) -> dict[str, Any]:
    """Judge the laws on the double pendulum, with states as measured and smoothed.

    Args:
        folder: With the folder of ``RIGS``.
        seed: Of the network's hidden weights.
        report: Told what is done.

    Raises:
        UsageError: The folder has no three recordings of the rig.
    """
    paths = sorted((folder / RIGS["double pendulum"]).glob("*.csv.gz"))
    if len(paths) < 3:
        raise UsageError(f"{folder} has no three recordings in {RIGS['double pendulum']}.")
    rows, found = [], {}
    measured = [load_recording(path) for path in paths]
    for states, recordings in (
        ("as measured", measured),
        (SMOOTHED, list(map(smoothed, measured))),
    ):
        report(f"laws of friction, states {states}")
        found = judge([equations(one, seed) for one in recordings])
        rows += [{"states": states, **row} for row in found["rows"]]
    return {"rows": rows, "alike": found["alike"]}
