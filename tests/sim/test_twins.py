import pytest

from hopping_leg.errors import UsageError
from hopping_leg.robot import load_robot, load_tree, robot_text
from hopping_leg.sim import MujocoSimulator
from hopping_leg.sim.randomization import TWIN_RANGES, Range, draw_twin


def entry(tree, path):
    for key in path.split("."):
        tree = tree[key]
    return tree


@pytest.mark.parametrize("seed", [0, 1, 17])
def test_a_twin_is_the_same_after_its_file(tmp_path, seed):
    twin, file = draw_twin(seed), tmp_path / "twin.toml"
    twin.save(file)
    assert load_robot(file) == twin.robot
    assert load_robot(file).digest == twin.robot.digest
    assert draw_twin(seed) == twin
    assert draw_twin(seed + 1).robot != twin.robot


def test_every_number_lies_in_its_range_and_fills_it():
    twins = [draw_twin(seed) for seed in range(60)]
    for spread in TWIN_RANGES:
        values = [entry(twin.tree, spread.path)["value"] for twin in twins]
        slack = 1e-5 * abs(spread.high)
        assert min(values) >= spread.low - slack
        assert max(values) <= spread.high + slack
        assert max(values) - min(values) >= 0.7 * (spread.high - spread.low)


def test_a_twin_can_extend_a_users_file(tmp_path):
    mine = tmp_path / "mine.toml"
    mine.write_text('name = "mine"\nextends = "legv1"\n')
    twin = draw_twin(3, str(mine))
    twin.save(tmp_path / "elsewhere" / "twin.toml")
    assert load_robot(tmp_path / "elsewhere" / "twin.toml").thigh.length == twin.robot.thigh.length
    assert twin.robot.thigh.length == load_robot("legv1").thigh.length


@pytest.mark.parametrize("seed", range(6))
def test_drawn_twins_are_simulated(seed):
    legs = MujocoSimulator(draw_twin(seed).robot, 1, threads=1)
    legs.stand(slice(None), [0.7, -1.4])
    for _ in range(20):
        legs.step(10 * ([0.7, -1.4] - legs.measured_q) - 0.2 * legs.measured_qd)
    assert abs(legs.q - [0.7, -1.4]).max() < 0.5
    assert legs.height[0] > 0.1


def test_what_is_written_reads_back(tmp_path):
    tree = load_tree("twin")
    file = tmp_path / "again.toml"
    file.write_text(robot_text(tree, "a comment\nof two lines"))
    assert load_tree(file) == tree
    assert file.read_text().startswith("# a comment\n# of two lines\n")


@pytest.mark.parametrize(("low", "high", "scale"), [(2, 1, "uniform"), (0, 1, "logarithmic")])
def test_an_impossible_range_is_refused(low, high, scale):
    with pytest.raises(UsageError, match=r"hip\.friction"):
        Range("hip.friction", "N m", low, high, "[C]", scale)


def test_a_negative_seed_is_refused():
    with pytest.raises(UsageError, match="seed of -1"):
        draw_twin(-1)
