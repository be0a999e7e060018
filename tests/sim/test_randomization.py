"""Each leg of a batch gets its own numbers, drawn from stated ranges."""

import dataclasses
import functools
from operator import attrgetter, getitem

import numpy as np
import pytest

from hopping_leg.errors import RobotError, UsageError
from hopping_leg.robot import Latency, load_robot
from hopping_leg.sim.randomization import (
    IDENTIFIABLE_RANGES,
    TWIN_RANGES,
    WIDE_RANGES,
    Range,
    draw_twin,
    normalized,
    sample,
)  # fmt: skip
from tests.sim.legs import POSTURE, make_legs, states, with_reality

LEG = load_robot("legv2")


def late(delay):
    return with_reality(latency=Latency(command=delay))


@pytest.mark.parametrize("spread", IDENTIFIABLE_RANGES, ids=lambda spread: spread.path)
def test_every_range_of_the_twins_reaches_the_physics(spread):
    low, high = (dataclasses.replace(spread, low=v, high=v) for v in (spread.low, spread.high))
    robots = [sample(LEG, [end], 1, np.random.default_rng(0))[0] for end in (low, high)]
    one, other = np.moveaxis(states(make_legs(LEG, 2, robots=robots)), 1, 0)
    assert np.abs(one - other).max() > 1e-6


@pytest.mark.parametrize(
    ("spread", "low", "high", "position"),
    [
        (
            Range("base.mass", "1", 0.5, 2.0, "test", "logarithmic", "factors"),
            0.5 * LEG.base.mass,
            2.0 * LEG.base.mass,
            lambda mass: np.log2(mass / LEG.base.mass),
        ),
        (
            Range("reality.latency.command", "s", 0.0, 1e-2, "test", bounds="additions"),
            3e-3,
            1.3e-2,
            lambda delay: (delay - 8e-3) / 5e-3,
        ),
        (Range("rail.friction", "N", 0.5, 1.5, "test"), 0.5, 1.5, lambda force: 2 * (force - 1)),
    ],
    ids=["factors", "additions", "values"],
)
def test_a_range_holds_values_or_is_relative_to_what_the_robot_has(spread, low, high, position):
    leg = late(3e-3)
    robots = sample(leg, [spread], 200, np.random.default_rng(0))
    values = np.array([attrgetter(spread.path)(robot) for robot in robots])
    assert low <= values.min() < low + 0.05 * (high - low)
    assert high - 0.1 * (high - low) < values.max() <= high
    found = normalized(leg, robots, [spread])[:, 0]
    np.testing.assert_allclose(found, position(values), atol=1e-9)


@pytest.mark.parametrize("delay", [0.0, 4.56e-3])
@pytest.mark.parametrize("rubs", [0.0, 0.1])
def test_whatever_a_leg_is_like_it_can_be_surprised(delay, rubs):
    """An identified one is late by parts of a tick, and its gears rub; the CAD's rail does not."""
    robot = dataclasses.replace(
        late(delay),
        rail=dataclasses.replace(LEG.rail, friction=rubs),
        knee=dataclasses.replace(LEG.knee, load_friction=rubs),
    )
    robots = sample(robot, WIDE_RANGES, 60, np.random.default_rng(0))
    found = normalized(robot, robots, WIDE_RANGES)
    assert np.isfinite(found).all()
    assert (np.abs(found).max(axis=0) > 0.5).sum() >= len(WIDE_RANGES) - 2
    legs = make_legs(robot, 60)
    legs.stand(slice(None), POSTURE, 0.05)
    legs.step(np.full((60, 2), 3.0))
    legs.set_robots(robots)
    ticks = legs.table["command_latency"] / legs.period + 1e-9
    assert set(ticks.astype(int)) == {0, 1, 2, 3}
    for _ in range(20):
        legs.step(np.full((60, 2), 3.0))
    assert np.ptp(legs.height) > 1e-3


def test_what_controllers_believe_may_not_vary():
    for path, error in (("thigh.length", UsageError), ("contact.time_constant", RobotError)):
        with pytest.raises(error, match=path):
            sample(LEG, [Range(path, "m", 1e-4, 1e-4, "test")], 2, np.random.default_rng(0))


@pytest.mark.parametrize("seed", [0, 1, 17])
def test_a_twin_is_the_same_after_its_file(tmp_path, seed):
    twin, file = draw_twin(seed), tmp_path / "twin.toml"
    twin.save(file)
    assert load_robot(file) == twin.robot
    assert draw_twin(seed) == twin
    assert draw_twin(seed + 1).robot != twin.robot


def test_every_number_lies_in_its_range_and_fills_it():
    twins = [draw_twin(seed) for seed in range(60)]
    for spread in TWIN_RANGES:
        path = spread.path.split(".")
        values = [functools.reduce(getitem, path, twin.tree)["value"] for twin in twins]
        slack = 1e-5 * abs(spread.high)
        assert min(values) >= spread.low - slack
        assert max(values) <= spread.high + slack
        assert max(values) - min(values) >= 0.7 * (spread.high - spread.low)


@pytest.mark.parametrize(("low", "high", "scale"), [(2, 1, "uniform"), (0, 1, "logarithmic")])
def test_what_cannot_be_drawn_is_refused(low, high, scale):
    with pytest.raises(UsageError, match=r"hip\.friction"):
        Range("hip.friction", "N m", low, high, "[C]", scale)
