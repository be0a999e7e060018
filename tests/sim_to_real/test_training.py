"""What policies are trained on."""

from hopping_leg.robot import load_robot
from hopping_leg.sim.randomization import IDENTIFIABLE_RANGES, WIDE_RANGES
from hopping_leg.sim_to_real.run import fits
from hopping_leg.sim_to_real.training import Train
from tests.sim_to_real.studies import study


def test_no_method_trains_on_what_the_twin_alone_knows(tmp_path):
    one = study(tmp_path, ("cad", "table-1", "randomised", "truth"))
    twin = one.twins[0]
    cad, paper, mixed, truth = (Train(one, twin, method, 0) for method in one.methods)
    assert cad.robot == mixed.robot == load_robot("legv2")
    assert paper.robot == load_robot("legv2-paper")
    assert mixed.recipe().task.randomised == IDENTIFIABLE_RANGES
    assert truth.robot.reality.only_delays
    assert truth.robot.rail == twin.robot.rail
    assert truth.robot.reality.latency.command == twin.robot.reality.latency.command


def test_legs_may_surprise_around_whatever_is_believed(tmp_path):
    one = study(tmp_path, ("cad", "cad-surprises", "identified", "identified-surprises"))
    twin = one.twins[0]
    cad, surprising, *_ = trains = [Train(one, twin, method, 0) for method in one.methods]
    assert cad.robot == surprising.robot
    assert cad.recipe().task.randomised == ()
    assert surprising.recipe().task.randomised == WIDE_RANGES
    assert len({one.training(twin, train.method, 0) for train in trains}) == 4
    fit, shared = (one.fitted(twin, method) for method in one.methods[2:])
    assert fit == shared
    assert [job.name for job in fits(one)] == [f"identify {t.name}, identified" for t in one.twins]


def test_a_study_can_change_the_recipe_but_for_its_steps(tmp_path):
    one = study(
        tmp_path, ["cad"], recipe="adaptive", changes=("task.fall_penalty=0.7", "steps=3"), steps=5
    )
    recipe = Train(one, one.twins[0], one.methods[0], 0).recipe()
    assert recipe.task.fall_penalty == 0.7
    assert recipe.schedule.steps == 5


def test_a_training_that_goes_beyond_its_steps_is_done_once(tmp_path):
    one = study(tmp_path, ["cad"], steps=1)
    train = Train(one, one.twins[0], one.methods[0], 0)
    assert train.progress() == (0.0, "begun")
    snapshots = one.training(one.twins[0], one.methods[0], 0) / "snapshots"
    snapshots.mkdir(parents=True)
    (snapshots / "000000032768.onnx").touch()
    assert train.progress()[0] == 1.0
