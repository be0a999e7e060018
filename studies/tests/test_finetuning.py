"""A study pools its runs, judges them on seeds that chose nothing, and is done once."""

import dataclasses

import numpy as np
import pytest
from tests.rl.finetune.trials import OPTIONS, POLICY, ROBOT, Imagined

from hopping_leg.rl.finetune.simulated import Guard
from hopping_leg.robot import load_robot
from studies.finetuning import run as module
from studies.finetuning.run import FIRST_JUDGE, Study, draw_finetuning, measure

WIDE = Guard(np.full(2, -9.0), np.full(2, 9.0), np.full(2, 999.0), np.zeros(2))


@pytest.fixture
def seeds(monkeypatch):
    """Replace simulated legs by imagined ones; return the seeds they were sent out with."""
    used = []

    class Sent(Imagined):
        def __init__(self, robot, guard):
            super().__init__()
            self.name = robot.name

        def hop(self, controller, schedule, seed):
            used.append(seed)
            return super().hop(controller, schedule, seed)

    monkeypatch.setattr(module, "SimulatedTrials", Sent)
    return used


def test_a_study_pools_its_runs_and_is_not_repeated(tmp_path, seeds):
    twin = dataclasses.replace(load_robot("twin"), name="other")
    options = dataclasses.replace(
        OPTIONS, stopping_rules=dataclasses.replace(OPTIONS.stopping_rules, minutes=0.15)
    )
    study = Study(POLICY, ROBOT, (twin,), (0, 1), options, WIDE, tmp_path,
                  eval_commands=(0.26, 0.34), judges=2)  # fmt: skip
    result = measure(study, lambda _: None)
    assert [row["policy"] for row in result["rows"]] == ["start", "continued"]
    assert [row["policies"] for row in result["rows"]] == [1, 2]
    for row in result["rows"]:
        np.testing.assert_allclose(row["median_abs_error_m"], 0.02, atol=1e-9)
    judging = [seed for seed in seeds if FIRST_JUDGE <= seed < FIRST_JUDGE + 2]
    assert len(judging) == 2 * 3
    count = len(seeds)
    assert measure(study, lambda _: None) == result
    assert len(seeds) == count
    figure = draw_finetuning(result)
    lines = figure.axes[0].get_lines()
    assert len(lines) == 6
    np.testing.assert_allclose(lines[0].get_ydata(), 20.0)
    count = len(lines[0].get_xdata())
    result["curves"][0] |= {"ended_early": True, "true_error_m": 1.0}
    line, _, crosses = draw_finetuning(result).axes[0].get_lines()[:3]
    assert len(line.get_xdata()) == count - 1
    assert list(crosses.get_xdata()) == [result["curves"][0]["minutes"]]
