from dataclasses import replace
from types import SimpleNamespace

import pytest

from hopping_leg.controllers import RolloutConfig
from hopping_leg.controllers.registry import load_controller, robot_of
from hopping_leg.errors import UsageError
from hopping_leg.evaluate import Entry, evaluate
from hopping_leg.evaluate.trials import on_floor
from hopping_leg.robot import load_robot
from studies.engines.run import (
    BAR,
    WORLDS,
    Engines,
    World,
    _judge,
    bench_engines,
)

ROBOT = load_robot("legv2-paper")


def summary(command, error, hops=9):
    return SimpleNamespace(
        command_m=command, median_error_m=error, std_m=0.001, skipped_hops=1, hops=hops
    )


def test_a_controller_passes_if_all_errors_are_small_and_heights_rise():
    good = _judge(WORLDS[0], "x", [summary(0.25, 0.004), summary(0.3, -0.005)])
    assert (good["ordered"], good["within_bar"], good["skipped_hops"]) == (True, True, 2)
    assert good["largest_median_error_m"] == pytest.approx(0.005)
    swapped = _judge(WORLDS[0], "x", [summary(0.25, 0.01), summary(0.26, -0.01)])
    assert (swapped["ordered"], swapped["within_bar"]) == (False, False)
    far = _judge(WORLDS[0], "x", [summary(0.25, 2 * BAR), summary(0.3, 0.0)])
    assert (far["ordered"], far["within_bar"]) == (True, False)


def test_without_hops_there_is_no_order_and_the_miss_counts():
    row = _judge(WORLDS[0], "x", [summary(0.25, -0.04, hops=0), summary(0.3, 0.0)])
    assert (row["largest_median_error_m"], row["mean_std_m"]) == (0.04, None)
    assert not row["ordered"]
    assert not row["within_bar"]


def test_the_stiff_floor_is_the_engines_own():
    mujoco, bullet = RolloutConfig(ROBOT), RolloutConfig(ROBOT, engine="pybullet")
    assert on_floor(mujoco, "stiff").robot.contact.time_constant == 0.02
    assert on_floor(bullet, "stiff") == replace(bullet, ground="rigid")
    assert on_floor(bullet, "soft") == bullet


def test_a_policy_hops_on_its_own_robot_unless_one_is_named():
    for name in ("fast", "paper", "energy-shaping"):
        assert Engines().leg(name).name == robot_of([name])
    assert Engines(robot="legv1").leg("fast").name == "legv1"


def test_a_ground_that_the_engine_lacks_is_refused():
    with pytest.raises(UsageError, match="pybullet"):
        RolloutConfig(ROBOT, ground="rigid")


@pytest.mark.slow
def test_a_controller_hops_in_pybullet_as_it_is():
    """At a coarse step, for speed; the results file has the accuracy."""
    pytest.importorskip("pybullet", reason="needs the extra 'bullet'")
    setup = RolloutConfig(ROBOT, engine="pybullet", ground="rigid", timestep=1e-3)
    judged = evaluate(
        [Entry("energy-shaping", load_controller("energy-shaping", ROBOT))],
        setup,
        commands=[0.3],
        repeats=1,
        kinds=("fixed",),
    ).evaluation
    assert judged.summary[0].hops > 15
    assert abs(judged.summary[0].median_error_m) < 0.03
    assert judged.summary[0].stop_contacts is None, "PyBullet tells nothing of the motors"
    assert judged.conditions["engine"] == "pybullet"
    assert "rigid" in judged.conditions["floor_meaning"]
    assert "pybullet" in judged.versions


@pytest.mark.slow
def test_the_benchmark_has_a_row_for_every_world_and_command():
    pytest.importorskip("pybullet", reason="needs the extra 'bullet'")
    worlds = (World("here", "mujoco"), World("there", "pybullet", "rigid"))
    study = Engines(("fast",), ROBOT.name, (0.3,), seeds=1, timestep=2.5e-3, workers=1)
    result = bench_engines(study, worlds, rates=())
    assert [(row["world"], row["command_m"]) for row in result["rows"]] == [
        ("here", 0.3),
        ("there", 0.3),
    ]
    assert {row["robot"] for row in result["worlds"]} == {ROBOT.name}
    here, there = result["drops"]
    assert here["deepest_sink_m"] > 0.03 > 1e-3 > there["deepest_sink_m"]
