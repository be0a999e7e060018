"""Which hops are as accurate as asked."""

import pytest

from hopping_leg.evaluate.acceptance import acceptance_lines, accuracies

GOOD = {
    "controller": "good", "median_error_m": 0.001, "std_m": 0.003, "skipped_hops": 0,
    "body_contacts": 0, "hop_rate_hz": 2.0, "flight_fraction": 0.6,
}  # fmt: skip


@pytest.mark.parametrize(
    ("command", "change", "shortfall"),
    [
        (0.3, {}, None),
        (0.3, {"median_error_m": -0.0051}, "worst error 5.1 mm (asked: at most 5.0 mm)"),
        (0.3, {"median_error_m": None}, "worst error inf mm"),
        (0.3, {"std_m": 0.0051}, "lower std 5.1 mm"),
        (0.38, {"std_m": 0.0069}, None),
        (0.38, {"std_m": 0.0081}, "worst std 8.1 mm"),
        (0.3, {"skipped_hops": 1}, "skipped hops 1 (asked: at most 0)"),
        (0.3, {"body_contacts": 1}, "body contacts 1"),
        (0.3, {"hop_rate_hz": 1.5}, "fewest hops 1.50/s (asked: at least 1.60/s)"),
        (0.3, {"flight_fraction": 0.49}, "least flight 49 % (asked: at least 50 %)"),
        (0.45, {"std_m": 0.1}, None),
    ],
)
def test_every_limit_is_judged_and_named(command, change, shortfall):
    rows = [{**GOOD, "command_m": c} for c in (0.22, 0.26, 0.3, 0.34)]
    rows.append({**GOOD, "command_m": command, **change})
    (line,) = acceptance_lines(rows)
    assert accuracies(rows)["good"].as_asked == (shortfall is None)
    assert (shortfall or "good: as asked.") in line
