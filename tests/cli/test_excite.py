import json

import pytest

from hopping_leg.cli import main
from hopping_leg.identify.excitation import load_excitation


@pytest.mark.parametrize(
    ("words", "rig", "samples"),
    [
        (["fixed-base"], "fixed-base", 48000),
        (["moving-base", "--duration", "30"], "rail", 6000),
        (["multisine", "--duration", "20", "--rate", "100"], "fixed-base", 2000),
    ],
)
def test_each_template_is_written_and_summed_up(tmp_path, words, rig, samples):
    out, facts = tmp_path / "excitation.parquet", tmp_path / "facts.json"
    assert main(["excite", *words, "--out", str(out), "--json", str(facts)]) == 0
    excitation = load_excitation(out)
    assert (excitation.rig, len(excitation)) == (rig, samples)
    told = json.loads(facts.read_text())
    assert told["digest"] == excitation.digest
    assert told["largest"]["speed_rad_s"][1] < 22


def test_what_the_leg_cannot_do_is_not_written(tmp_path, refused):
    out = tmp_path / "excitation.parquet"
    refused(["excite", "fixed-base", "--no-adapt", "--out", out], "cannot follow the trajectory")
    assert not out.exists()
