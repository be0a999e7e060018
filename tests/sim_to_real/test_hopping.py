"""Policies on the twin, with all its effects or one less."""

import dataclasses
import json

import numpy as np
import pytest
from studies.sim_to_real.effects import EFFECTS, HopWithout

from hopping_leg.robot import load_robot
from hopping_leg.sim import NO_NOISE
from hopping_leg.sim_to_real import hopping
from hopping_leg.sim_to_real.hopping import Hop
from tests.sim_to_real.studies import study


@pytest.mark.parametrize("effect", EFFECTS)
def test_one_effect_is_taken_away_and_the_rest_stays(tmp_path, effect):
    one = study(tmp_path, ("identified",))
    twin, method = one.twins[0], one.methods[0]
    whole, less = Hop(one, twin, method, 0), HopWithout(one, twin, method, 0, effect)
    assert less.leg != whole.leg == twin.robot
    assert not less.leg.reality.only_delays
    assert less.file != whole.file
    for other in set(EFFECTS) - {effect}:
        assert EFFECTS[other](less.leg.reality) != less.leg.reality
    assert EFFECTS[effect](less.leg.reality) == less.leg.reality


def test_without_all_effects_nothing_is_left(tmp_path):
    reality = study(tmp_path).twins[0].robot.reality
    for take_away in EFFECTS.values():
        reality = take_away(reality)
    periods = reality.hip.ripple_periods, reality.knee.ripple_periods
    assert dataclasses.replace(
        reality,
        hip=dataclasses.replace(reality.hip, ripple_periods=1.0),
        knee=dataclasses.replace(reality.knee, ripple_periods=1.0),
    ).neutral
    assert periods != (1.0, 1.0)


def test_a_twin_is_met_with_its_own_effects_alone():
    assert hopping.disturbance_of(load_robot("twin")) == NO_NOISE
    assert hopping.disturbance_of(load_robot("legv2")).torque_noise > 0


def test_a_leg_that_never_hops_errs_by_the_command(tmp_path, monkeypatch):
    rows = [dict.fromkeys(hopping._KEPT, 0.0) | {"command_m": 0.3, "median_error_m": None}]

    class Judged:
        distributions = ({"command_m": 0.3, "apexes_m": []},)

        def to_json(self):
            return {"summary": rows}

    (row,) = hopping._rows(Judged())
    assert row["motionless"]
    assert (row["median_error_m"], row["median_abs_error_m"]) == (-0.3, 0.3)
    assert json.dumps(row)
    assert np.isfinite(row["median_abs_error_m"])
