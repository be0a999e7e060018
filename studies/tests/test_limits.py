"""What limits accuracy: conditions are what they are called, results are kept."""

from dataclasses import asdict, replace

import pytest

from hopping_leg.errors import UsageError
from hopping_leg.evaluate import Entry
from hopping_leg.evaluate.result_files import ResultCache
from hopping_leg.sim import NO_NOISE, NoiseAndDelay
from studies.limits import run as module
from studies.limits.run import CONDITIONS, LimitsStudy, condense, measure_limits

OF = {"joint noise": "joint_noise", "torque noise": "torque_noise", "delay": "delay_probability"}


def by_name(name):
    (found,) = (c for c in CONDITIONS if c.name == name)
    return found


@pytest.mark.parametrize(("words", "number"), OF.items())
def test_one_disturbance_is_taken_away_or_left_alone(words, number):
    everything, nothing = asdict(NoiseAndDelay()), asdict(NO_NOISE)
    assert asdict(by_name(f"no {words}").disturbance) == {**everything, number: 0.0}
    alone = by_name(f"{words} alone").disturbance
    assert asdict(alone) == {**nothing, number: everything[number]}


def test_a_slow_ground_is_the_robots_own_but_slower(robot, spring, tmp_path, monkeypatch):
    grounds = []

    def stand(_entries, setup, **_options):
        grounds.append((setup.robot.contact.time_constant, setup.robot.contact.damping_ratio))
        raise UsageError("no time for that")

    monkeypatch.setattr(module, "evaluate", stand)
    for words in ("all of it", "all of it, ground twice as slow", "nothing, ground twice as slow"):
        study = LimitsStudy(robot, (0.30,), conditions=(by_name(words),))
        with pytest.raises(UsageError, match="no time"):
            measure_limits([Entry("spring", spring)], study, ResultCache(tmp_path))
    ground = robot.contact
    slow = (2 * ground.time_constant, ground.damping_ratio)
    assert grounds == [(ground.time_constant, ground.damping_ratio), slow, slow]
    assert by_name("nothing, ground twice as slow").disturbance == NO_NOISE


def test_a_leg_that_nothing_disturbs_repeats_its_hops(robot, spring, tmp_path):
    study = LimitsStudy(
        robot, (0.30,), seeds=2, threads=1, conditions=(by_name("all of it"), by_name("nothing"))
    )
    begun, done = [], []
    entries = [Entry("spring", spring)]
    cache = ResultCache(tmp_path, begun.append)
    result = measure_limits(entries, study, cache, lambda *counts: done.append(counts))
    noisy, calm = result["rows"]
    assert (noisy["condition"], calm["condition"]) == ("all of it", "nothing")
    assert calm["mean_std_m"] < noisy["mean_std_m"]
    assert [row["command_m"] for row in result["commands"]] == [0.30, 0.30]
    assert done == [(1, 2), (2, 2)]
    assert len(begun) == 2
    assert measure_limits(entries, study, cache) == result
    assert len(begun) == 2
    measure_limits(entries, replace(study, seed=1001), cache)
    assert len(begun) == 4


def test_a_command_without_hops_counts_as_missed(robot, judged):
    summary = judged.evaluation.summary
    found = condense(summary)
    assert found["worst_std_m"] >= found["mean_std_m"] > 0
    missing = condense([summary[0], replace(summary[1], median_error_m=-0.14, hops=0)])
    assert missing["worst_abs_median_error_m"] == 0.14
    assert missing["mean_std_m"] is None
    assert missing["skipped_hops"] == found["skipped_hops"]


def test_commands_out_of_range_and_names_taken_twice_are_refused(robot, spring, tmp_path):
    study = LimitsStudy(robot, (0.30,), threads=1)
    narrow = Entry("spring", spring, (0.2, 0.25))
    with pytest.raises(UsageError, match="cannot be asked for"):
        measure_limits([narrow], study, ResultCache(tmp_path))
    with pytest.raises(UsageError, match="named twice"):
        measure_limits([narrow, narrow], study, ResultCache(tmp_path))
