import json

import numpy as np
import polars as pl
import pytest

from hopping_leg.deploy.motion_sequence import Part
from hopping_leg.trace import Trace
from studies.shared import main
from studies.speed.deploy import Deploy, Truth, apexes_of


def test_apexes_are_matched_with_what_was_commanded():
    time = np.arange(0, 12, 0.005)
    part = np.where(time < 1, Part.RISE, np.where(time < 11, Part.HOP, Part.SINK))
    command = np.where(time < 6, 0.25, 0.35)
    trace = Trace(pl.DataFrame({"time_s": time, "part": part, "command_m": command}))
    watched = np.arange(0, 12, 0.01)
    tops = np.where(watched < 6, 0.25, 0.35)
    height = tops - 0.1 * (1 - np.cos(2 * np.pi * (watched - 0.25) / 0.5)) / 2
    truth = Truth((watched + 7.0).tolist(), height.tolist(), (height - 0.2).tolist())
    found = apexes_of(trace, truth)
    for low, high, wanted in ((0.25, 0.25, 6), (0.35, 0.35, 6)):
        apexes = [apex for asked, apex in found if asked == low]
        assert len(apexes) == pytest.approx(wanted, abs=1)
        np.testing.assert_allclose(apexes, high, atol=1e-3)
    assert apexes_of(trace, Truth()) == []


@pytest.mark.slow
def test_the_benchmark_hops_through_the_wire_as_in_process(tmp_path):
    file = tmp_path / "deploy.json"
    words = ["--controller", "energy-shaping", "--minutes", "0.05", "--seconds", "4"]
    assert main("speed", Deploy, [*words, "--json", str(file)]) == 0
    result = json.loads(file.read_text())
    assert 0 <= result["share_on_time"] <= 1
    for name in ("tick_us", "wake_late_us"):
        assert list(result[name]) == ["p50", "p99", "p99.9", "max"]
    for row in result["heights"]:
        assert abs(row["relative_difference"]) < 0.05
