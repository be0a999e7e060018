"""What identification was to reach, and whether it did."""

from typing import Any

from hopping_leg.robot.parameters import JOINTS
from studies.identification.friction import LAWS, SMOOTHED
from studies.identification.synthetic import FIXED, HOPPING, RAIL


def bars(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Return a record per bar that was measured: what, the bar, the number, whether it is reached.

    Args:
        result: Of the benchmark, by part.
    """
    found = [*_synthetic(result), *_speed(result), *_real(result), *_friction(result)]
    return [
        {
            "what": what,
            "bar": bar,
            "unit": unit,
            "measured": value,
            "reached": value is not None and (value >= bar if more else value <= bar),
        }
        for what, bar, unit, value, more in found
    ]


Bar = tuple[str, float, str, float | None, bool]
"""In words, the bar, its unit, the number, whether more is better."""


def _synthetic(result: dict[str, Any]) -> list[Bar]:
    rows = {
        row["case"]: row
        for row in result.get("synthetic", {}).get("rows", [])
        if row["method"] == "least squares"
    }
    if not rows:
        return []
    fixed, rail, hops = rows[FIXED], rows[RAIL], rows[HOPPING]
    error = fixed["worst_identifiable_error_percent"]
    return [
        ("known twin, fixed base: identifiable parameters", 0.5, "%", error, False),
        ("known twin, fixed base: time", 10.0, "s", fixed["wall_s"], False),
        ("known twin: unseen swings", 1.0, "mrad", _mrad(rail["other_swings_rms_rad"]), False),
        ("known twin: unseen squats", 3.0, "mrad", _mrad(rail["other_squats_rms_rad"]), False),
        ("known twin: unseen hops", 10.0, "mrad", _mrad(hops["other_hops_rms_rad"]), False),
    ]


def _speed(result: dict[str, Any]) -> list[Bar]:
    found: list[Bar] = []
    speed = result.get("throughput")
    if speed is not None:
        fixed = speed["fixed_base_candidate_s"] / speed["paper_size_share"]
        loop, cores = speed["replay_one_thread_over_loop"], speed["replay_two_threads_over_one"]
        found = [
            ("a candidate, 240 s, fixed base, one thread", 0.15, "s", fixed, False),
            ("replay on one thread over a loop of mj_step", 25.0, "times", loop, True),
            ("replay: two threads over one", 1.8, "times", cores, True),
        ]
    arms = result.get("coverage")
    if arms is not None:
        share, longest = 100 * arms["share_inside"], arms["fit_longest_s"]
        found += [
            ("independent arms: 95 % intervals that hold the truth", 90.0, "%", share, True),
            ("independent arms, 12 s each: longest fit", 10.0, "s", longest, False),
        ]
    for row in result.get("paper_size", {}).get("rows", []):
        what = f"{row['recorded_s']:g} s of recordings: {row['method']}"
        found.append((what, 90.0, "s", 60 * row["wall_minutes"], False))
    return found


def _friction(result: dict[str, Any]) -> list[Bar]:
    """Return what the best further law leaves of the torques of held-out recordings."""
    rows = result.get("friction", {}).get("rows", [])
    shares = [row["share"] for row in rows if row["states"] == SMOOTHED and row["law"] in LAWS]
    what = "double pendulum, held-out torque: best further law of friction over today's"
    return [(what, 0.6, "times", min(shares), False)] if shares else []


def _real(result: dict[str, Any]) -> list[Bar]:
    """Return bars of real recordings against the worst of all splits."""
    found: list[Bar] = []
    rows = result.get("recordings", {}).get("rows", [])
    pendulum = [row for row in rows if row["rig"] == "double pendulum"]
    for horizon, pair in (("0_2", (12.0, 29.0)), ("0_5", (33.0, 95.0))):
        key, ahead = f"predicted_{horizon}_s_rms_rad", horizon.replace("_", ".")
        for joint, (name, bar) in enumerate(zip(("joint 1", "joint 2"), pair, strict=True)):
            worst = _worst(pendulum, key, joint)
            what = f"double pendulum, {ahead} s ahead, {name}, worst split"
            found += [] if worst is None else [(what, bar, "mrad", _mrad(worst), False)]
    leg = [row for row in rows if row["rig"].startswith("leg V2")]
    for quantity, unit, factor, pair in (
        ("position_rms_rad", "mrad", 1e3, (25.0, 3.0)),
        ("torque_rms_nm", "N m", 1.0, (0.14, 0.4)),
    ):
        for joint, (name, bar) in enumerate(zip(JOINTS, pair, strict=True)):
            worst = _worst(leg, f"closed_loop_{quantity}", joint)
            what = f"leg V2, {quantity.split('_')[0]}, {name}, worst split"
            found += [] if worst is None else [(what, bar, unit, factor * worst, False)]
    return found


def _worst(rows: list[dict[str, Any]], key: str, joint: int) -> float | None:
    values = [row[key][joint] for row in rows if row[key][joint] is not None]
    return max(values, default=None)


def _mrad(radians: float | None) -> float | None:
    return None if radians is None else 1e3 * radians
