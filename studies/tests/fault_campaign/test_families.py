import numpy as np
import pytest

from hopping_leg.deploy.stop_reasons import Reason
from hopping_leg.emulator.faults import KINDS
from studies.fault_campaign.families import FAMILIES, HOP_SECONDS
from studies.fault_campaign.live import LIVE

RNG = np.random.default_rng


@pytest.mark.parametrize("name", FAMILIES)
def test_a_family_draws_the_same_from_the_same_seed_and_much_else_from_others(name):
    family = FAMILIES[name]
    mishaps = [family.draw(RNG(seed)) for seed in range(40)]
    assert family.draw(RNG(0)) == mishaps[0]
    assert len({str(mishap) for mishap in mishaps}) > 10
    assert all(0 <= mishap.at <= HOP_SECONDS for mishap in mishaps)
    struck = [m.fault is not None or m.start is not None or m.stall or m.dies for m in mishaps]
    assert all(struck)
    at_start = family.refused or family.grounded
    assert all((mishap.start is not None) == at_start for mishap in mishaps)


def test_every_kind_of_the_emulators_faults_is_in_a_family():
    kinds = set()
    for family in FAMILIES.values():
        for seed in range(20):
            mishap = family.draw(RNG(seed))
            faults = [mishap.fault] if mishap.fault else mishap.start.faults if mishap.start else []
            kinds |= {fault.kind for fault in faults}
    assert kinds == set(KINDS)


def test_a_family_that_stops_the_leg_names_why():
    for name, family in FAMILIES.items():
        if not family.refused and name != "killed host":
            assert family.reasons
            assert Reason.NONE not in family.reasons
    assert set(LIVE) <= set(FAMILIES)
