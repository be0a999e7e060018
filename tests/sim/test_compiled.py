"""What is compiled is compiled once, before the first step, and kept."""

import os
import subprocess
import sys

import numpy as np
import pytest

from hopping_leg.robot import load_robot
from hopping_leg.sim import LegSimulator, stepper

USE = """
from hopping_leg.robot import load_robot
from hopping_leg.sim import LegSimulator, compiled
import numpy as np
legs = LegSimulator(load_robot("legv2"), 1)
legs.stand(slice(None), np.array([0.7, -1.4]))
legs.step(np.zeros((1, 2)))
print(compiled.FOLDER)
"""


def compiled_versions():
    return [len(entry.signatures) for entry in (stepper.step_legs, stepper.read_sensors)]


def test_no_use_of_the_simulator_compiles_anything_anew():
    robot = load_robot("twin")
    legs = LegSimulator(robot, 2, timestep=np.float64(0.0005), threads=2)
    assert compiled_versions() == [1, 1]
    wide = np.zeros((4, 4))
    fixed = np.zeros((2, 2))
    fixed.flags.writeable = False
    for torque in (wide[::2, ::2], np.asfortranarray(wide[:2, :2]), fixed, [[0, 1], [1, 0]]):
        legs.step(torque)
    for kind in (np.int64, np.float32):
        legs.step(np.zeros((2, 2), kind))
    legs.push(np.arange(2))
    legs.place([1], 0.3, (1, -1))
    legs.restore({**legs.memory(), "past": np.asfortranarray(legs.memory()["past"])})
    legs.set_robots((load_robot("legv2"), robot))
    legs.step(np.zeros((2, 2)))
    LegSimulator(robot, 1, timestep=0.00025, fixed_base=True).step(np.zeros((1, 2)))
    assert compiled_versions() == [1, 1]


@pytest.mark.slow
def test_a_first_use_says_so_once_even_where_no_home_can_be_written(tmp_path):
    nowhere = tmp_path / "file"
    nowhere.touch()
    env = {**os.environ, "XDG_CACHE_HOME": str(nowhere), "TMPDIR": str(tmp_path)}
    words, options = [sys.executable, "-c", USE], {"capture_output": True, "text": True}
    first, again = (
        subprocess.run(words, env=env, check=True, timeout=300, **options) for _ in range(2)
    )
    assert first.stderr.count("Compiling the leg's physics") == 1
    assert again.stderr == ""
    assert first.stdout == again.stdout
    assert first.stdout.startswith(str(tmp_path / "hopping-leg-"))
