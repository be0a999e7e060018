"""Legs of a training for any leg: what the teacher reaches on them is found once."""

import pytest

from hopping_leg.controllers.mpc import HopShape, Planning
from hopping_leg.errors import UsageError
from hopping_leg.rl import training_legs
from hopping_leg.rl.training_legs import Reach, reach_of_legs, task_leg
from hopping_leg.sim.any_leg import draw_any_leg
from hopping_leg.workers import ProcessWorkers

HEIGHTS = (0.21, 0.42)
TEACHER = (HopShape(), Planning(timestep=1.25e-3, elastic_timestep=5e-4, every=2))


class Here:
    """Workers that count what they are asked for."""

    count = 1

    def __init__(self):
        self.asked = []

    def map(self, function, arguments):
        self.asked += [values[0] for values in arguments]
        return [function(*values) for values in arguments]


@pytest.fixture(autouse=True)
def _few(monkeypatch):
    monkeypatch.setattr(training_legs, "_AT_ONCE", 2)
    monkeypatch.setattr(training_legs, "_ROUND", 4)


def find(folder, count, workers, seed=0, heights=HEIGHTS):
    told = []
    found = reach_of_legs(count, seed, heights, TEACHER, workers, folder / "legs.json", told.append)
    assert not told or told[-1] == count
    return found


def test_legs_are_asked_for_heights_of_their_own_size(tmp_path):
    found = find(tmp_path, 5, Here())
    assert len({reach.leg for reach in found}) == 5
    for reach in found:
        scale = draw_any_leg(reach.leg).true.straight_height / 0.30
        assert HEIGHTS[0] <= reach.low / scale + 1e-9
        assert reach.low < reach.high <= scale * HEIGHTS[1] + 1e-9
        leg = task_leg(reach)
        assert leg.command_range == (reach.low, reach.high)
        assert leg.true == draw_any_leg(reach.leg).true


def test_what_was_found_is_not_looked_for_again_and_no_worker_changes_it(tmp_path):
    first = Here()
    found = find(tmp_path, 5, first)
    again = Here()
    assert find(tmp_path, 3, again) == found[:3]
    assert again.asked == []
    more = find(tmp_path, 8, again)
    assert more[:5] == found
    assert not set(map(str, again.asked)) & set(map(str, first.asked))
    with ProcessWorkers(1) as processes:
        assert find(tmp_path / "others", 8, processes) == more
    other = Here()
    assert not {r.leg for r in find(tmp_path, 2, other, seed=1)} & {r.leg for r in found}


def test_a_leg_that_hardly_hops_is_left_out(monkeypatch):
    monkeypatch.setattr(training_legs, "_reached", lambda scale: lambda result: False)
    assert training_legs.find_reach(0, HEIGHTS, *TEACHER) is None


def test_a_damaged_file_is_one_sentence(tmp_path):
    find(tmp_path, 1, Here())
    for content in (b"{", b'{"asked": 1', b"[]"):
        (tmp_path / "legs.json").write_bytes(content)
        with pytest.raises(UsageError):
            find(tmp_path, 1, Here())
    assert isinstance(find(tmp_path / "new", 1, Here())[0], Reach)
