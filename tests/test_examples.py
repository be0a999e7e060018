"""The examples run, and the notebooks from top to bottom; those are stored as written."""

import runpy
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient

from hopping_leg.robot import load_robot
from hopping_leg.sim import LegSimulator
from tests.rl.learners import try_briefly

EXAMPLES = Path(__file__).parent.parent / "examples"
NOTEBOOKS = pytest.mark.parametrize(
    "path", sorted((EXAMPLES / "notebooks").glob("*.ipynb")), ids=lambda p: p.stem
)
ARGUMENTS = {"train_your_own": ["16384"], "custom_reward": ["1024"], "tune": ["1", "1024"]}
"""What makes the long ones short."""


def simulated_ros(monkeypatch):
    """Put a leg in the place of ROS 2, silent in the end; return its heights and efforts."""
    did, ends, leg = [], {}, LegSimulator(load_robot("legv2-identified"), 1, threads=1)
    leg.stand(slice(None), np.array([0.7, -1.4]))
    clock = SimpleNamespace(nanoseconds=0)
    node = SimpleNamespace(
        create_subscription=lambda kind, topic, call, depth: ends.update({topic: call}),
        create_publisher=lambda *about: SimpleNamespace(publish=lambda m: ends.update(out=m)),
        create_timer=lambda period, call: ends.update(tick=call),
        get_clock=lambda: SimpleNamespace(now=lambda: clock),
    )

    def spin(node):
        ends["/command_m"](SimpleNamespace(data=0.32))
        for tick in range(620):
            clock.nanoseconds = tick * 5_000_000
            stamp = SimpleNamespace(sec=tick // 200, nanosec=tick % 200 * 5_000_000)
            if tick < 600:
                state = SimpleNamespace(header=SimpleNamespace(stamp=stamp), name=["knee", "hip"])
                state.position, state.velocity = leg.q[0, ::-1].tolist(), leg.qd[0, ::-1].tolist()
                ends["/joint_states"](state)
            ends["tick"]()
            leg.step(np.array([ends["out"].effort]))
            did.append((leg.height[0], *ends["out"].effort))

    ros = SimpleNamespace(init=lambda: None, create_node=lambda name: node, spin=spin)
    kinds = SimpleNamespace(JointState=SimpleNamespace, Float64=SimpleNamespace)
    for name, module in {"rclpy": ros, "sensor_msgs.msg": kinds, "std_msgs.msg": kinds}.items():
        monkeypatch.setitem(sys.modules, name.partition(".")[0], module)
        monkeypatch.setitem(sys.modules, name, module)
    return did


def test_a_leg_hops_through_ros_until_its_samples_are_late(monkeypatch):
    did = simulated_ros(monkeypatch)
    monkeypatch.setattr(sys, "argv", ["ros2_bridge.py"])
    runpy.run_path(str(EXAMPLES / "ros2_bridge.py"), run_name="__main__")
    heights, efforts = np.array(did)[:, 0], np.array(did)[:, 1:]
    assert heights[300:600].max() == pytest.approx(0.32, abs=0.015)
    assert np.abs(efforts[:600]).max() > 1
    assert not efforts[-5:].any()


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda p: p.stem)
def test_every_example_fits_a_screen_and_runs(path, tmp_path, monkeypatch, capsys):
    assert len(path.read_text().splitlines()) <= 60
    if path.stem == "microcontroller" and shutil.which("cc") is None:
        pytest.skip("no C compiler")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    simulated_ros(monkeypatch)
    if path.stem in ARGUMENTS:
        try_briefly(monkeypatch)
    monkeypatch.setattr(sys, "argv", [str(path), *ARGUMENTS.get(path.stem, [])])
    runpy.run_path(str(path), run_name="__main__")
    printed = capsys.readouterr().out
    assert printed
    if path.stem == "microcontroller":
        assert float(printed.split()[-1]) < 1e-6
    if path.stem in ARGUMENTS:  # what is finished is not refused when it is run again
        monkeypatch.setattr("hopping_leg.rl.train.Trainer", None)
        runpy.run_path(str(path), run_name="__main__")
        assert "finished" in capsys.readouterr().out


@NOTEBOOKS
def test_nothing_that_a_run_left_is_stored(path):
    notebook = nbformat.read(path, as_version=4)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert code
    assert all(not cell.outputs and cell.execution_count is None for cell in code)


@pytest.mark.slow
@NOTEBOOKS
def test_every_notebook_runs(path, tmp_path, monkeypatch):
    for name in ("JUPYTER_RUNTIME_DIR", "JUPYTER_CONFIG_DIR", "IPYTHONDIR"):
        monkeypatch.setenv(name, str(tmp_path / name))
    monkeypatch.delenv("MPLBACKEND", raising=False)
    notebook = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources=resources).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert not [o for o in outputs if o.get("name") == "stderr"]
    shown = {kind for o in outputs for kind in o.get("data", {})}
    assert shown & {"image/png", "image/svg+xml"}
    assert "text/html" in shown
