"""Fits belong to their recordings."""

import pytest

from hopping_leg.errors import UsageError
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.recording import load_recording
from hopping_leg.robot import load_robot
from hopping_leg.sim_to_real import fitting, tables
from tests.identify.twin import record, swing
from tests.sim_to_real.studies import study

LEG = LegHypothesis(load_robot("legv2"))


@pytest.fixture(scope="module")
def identified():
    run = record(LEG.replace({"hip.friction": 0.12}).robot, swing(8.0))
    options = IdentifyOptions(parameters=("hip.friction", "knee.friction"), threads=1)
    return identify([run], LEG.robot, options=options)


def test_a_fit_belongs_to_its_recordings(identified, tmp_path, monkeypatch):
    asked = []

    def fake(recordings, robot, **options):
        asked.append((recordings, robot.name))
        return identified

    monkeypatch.setattr(fitting, "identify", fake)
    one = study(tmp_path, ("fixed-base-only",))
    job = fitting.Identify(one, one.twins[0], one.methods[0])
    assert not job.done
    file = one.recording(one.twins[0], "fixed-base")
    record(LEG.robot, swing(2.0)).save(file)
    job.run(quiet=True)
    [(recordings, believed)] = asked
    assert believed == "legv2"
    assert [r.digest for r in recordings] == [load_recording(file).digest]
    assert job.done
    row = tables.fit_row(job)
    truth = {p["name"]: p["truth"] for p in row["parameters"]}
    assert truth["hip.friction"] == one.twins[0].robot.hip.friction
    record(LEG.robot, swing(3.0)).save(file)
    with pytest.raises(UsageError, match="other recordings"):
        assert job.done
