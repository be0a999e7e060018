"""`hop export traces`: files of other tools, or the sentence that says what to install."""

import pytest

from hopping_leg.cli import main
from tests.extras import run_without
from tests.formats.traces import noise

EXTRAS = {"mcap": "ros", "rerun": "rerun", "lerobot": "lerobot"}


@pytest.fixture
def trace(tmp_path):
    path = tmp_path / "run.parquet"
    noise(robot="legv2").save(path)
    return path


@pytest.mark.parametrize(("form", "name"), [("mcap", "run.mcap"), ("rerun", "run.rrd")])
def test_a_file_lies_beside_its_trace_or_in_a_folder(trace, tmp_path, form, name):
    pytest.importorskip({"mcap": "mcap_ros2", "rerun": "rerun"}[form])
    assert main(["export", "traces", str(trace), "--format", form]) == 0
    assert (tmp_path / name).stat().st_size > 1000
    words = ["export", "traces", str(trace), "--format", form, "--out", str(tmp_path / "out")]
    assert main(words) == 0
    assert (tmp_path / "out" / name).exists()


def test_all_traces_make_one_dataset(trace, tmp_path):
    pytest.importorskip("pyarrow")
    out = tmp_path / "set"
    words = ["export", "traces", str(trace), str(trace), "--format", "lerobot", "--out", str(out)]
    assert main(words) == 0
    assert (out / "meta/info.json").exists()


@pytest.mark.parametrize(("form", "extra"), EXTRAS.items())
def test_a_missing_extra_is_named_with_the_command_that_installs_it(trace, form, extra):
    packages = ("mcap", "mcap_ros2", "rerun", "pyarrow", "huggingface_hub")
    words = ["export", "traces", str(trace), "--format", form]
    found = run_without(packages, f"from hopping_leg.cli import main; sys.exit(main({words}))")
    assert found.returncode == 2
    assert f"pip install 'hopping-leg[{extra}]'" in found.stderr
    assert "Traceback" not in found.stderr
