"""The stages of one transfer, and what each of its controllers knows."""

from pathlib import Path

import pytest

from hopping_leg.robot import load_robot
from hopping_leg.sim_to_real.transfer import Transfer
from hopping_leg.sim_to_real.twins import (
    drawn_twin,
)


def test_each_controller_knows_what_its_method_says_of_the_twin(tmp_path):
    pytest.importorskip("torch")
    from hopping_leg.rl.recipes.fast import FAST

    twin = drawn_twin(0, tmp_path / "twins")
    run = Transfer(tmp_path, twin, FAST, seed=3)
    assert [record.rig for record in run.records] == ["fixed-base", "rail"]
    assert run.fit.file == Path(run.trainings[0].source) == run.identified
    assert run.trainings[1].source == "legv2"
    assert [hop.method for hop in run.hops] == ["identified", "cad", "energy-shaping"]
    assert [hop.policy and hop.policy.parent.name for hop in run.hops] == [
        "twin-0-identified-seed3", "legv2-seed3", None,
    ]  # fmt: skip
    assert all(hop.leg == twin.robot for hop in run.hops)
    assert run.hops[2].controller.robot == load_robot("legv2"), "it knows the believed leg alone"
