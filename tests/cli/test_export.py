"""`hop export traces`: files of other tools, or the sentence that says what to install."""

import pytest

from hopping_leg.cli import main
from tests.extras import run_without
from tests.formats.traces import noise


@pytest.fixture
def trace(tmp_path):
    path = tmp_path / "run.parquet"
    noise(robot="legv2").save(path)
    return path


def test_a_file_lies_beside_its_trace_or_in_a_folder(trace, tmp_path):
    pytest.importorskip("mcap_ros2")
    assert main(["export", "traces", str(trace)]) == 0
    assert (tmp_path / "run.mcap").stat().st_size > 1000
    assert main(["export", "traces", str(trace), "--out", str(tmp_path / "out")]) == 0
    assert (tmp_path / "out/run.mcap").exists()


def test_a_missing_extra_is_named_with_the_command_that_installs_it(trace):
    words = ["export", "traces", str(trace)]
    code = f"from hopping_leg.cli import main; sys.exit(main({words}))"
    found = run_without(("mcap", "mcap_ros2"), code)
    assert found.returncode == 2
    assert "pip install 'hopping-leg[ros]'" in found.stderr
    assert "Traceback" not in found.stderr
