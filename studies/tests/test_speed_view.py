import numpy as np
import pytest

pytest.importorskip("viser", reason="the extra 'view' is not installed")
pytest.importorskip("playwright", reason="playwright is not installed")

from PIL import Image

from studies.shared import main
from studies.speed import browser
from studies.speed.view import View, bench_view


@pytest.mark.slow
@pytest.mark.skipif(browser.find_chromium() is None, reason="there is no Chromium here")
def test_everything_is_measured_through_the_real_page(tmp_path):
    picture = tmp_path / "page.png"
    result = bench_view(View(seconds=2.0, commands=3, picture=picture))
    latency = result["latency_ms"]
    assert 0 < latency["median"] <= latency["p95"] <= latency["most"]
    for watched in (result, result["small_window"]):
        assert 0 < watched["frames_per_s"] < 66
        assert min(watched["canvas"]) > 0
    assert result["window"] > result["small_window"]["window"]
    assert 0 < result["pictures_sent_per_s"] < 1.2 * result["setup"]["intended_pictures_per_s"]
    assert 0 < result["real_time"] < 1.1
    assert result["start_s"] > 0
    assert picture.stat().st_size < 150_000
    assert np.asarray(Image.open(picture).convert("L")).std() > 10


def test_without_a_browser_the_benchmark_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setattr(browser.shutil, "which", lambda _: None)
    assert main("speed", View, []) == 2
    assert "install Chromium" in capsys.readouterr().err


def test_a_senseless_benchmark_is_refused(capsys):
    assert main("speed", View, ["--seconds", "0"]) == 2
    assert main("speed", View, ["--commands", "0"]) == 2
    assert capsys.readouterr().err.count("must") == 2
