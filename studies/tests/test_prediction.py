"""How well a simulation foretells hops on the leg."""

import json

import pytest

from studies.sim_to_real import policies
from studies.sim_to_real.twins import simulated

pytest.importorskip("torch")
from studies.sim_to_real.run import foretold, met, prediction_rows
from studies.tests.test_sim_to_real import study


def write(job, *apexes):
    job.file.parent.mkdir(exist_ok=True)
    rows = [{"command_m": 0.3, "median_error_m": apex - 0.3} for apex in apexes]
    job.file.write_text(json.dumps({"rows": rows}))


def test_errors_are_predicted_minus_measured_apexes_of_the_same_twin(tmp_path):
    one = study(tmp_path, ("truth", "cad"))
    true = {"twin-0": (0.25, 0.35), "twin-1": (0.26, 0.36)}
    cad = {"twin-0": (0.27, 0.37), "twin-1": (0.22, 0.42)}
    for job in met(one):
        write(job, *true[job.twin.name])
    for job in foretold(one):
        write(job, *(cad if job.believer.name == "cad" else true)[job.twin.name])
    perfect, other, *_ = prediction_rows(foretold(one), met(one))
    assert perfect["median_abs_error_m"] == pytest.approx(0.0)
    assert other["median_abs_error_m"] == pytest.approx(0.03)
    assert other["worst_abs_error_m"] == pytest.approx(0.06)
    assert other["errors_m"]["twin-1"] == pytest.approx([-0.04, 0.06])


def test_the_controllers_hop_in_the_methods_simulation(tmp_path, monkeypatch):
    one = study(tmp_path, ("truth",))
    legs = []
    monkeypatch.setattr(policies, "hop", lambda _, leg, *trials: legs.append(leg) or [])
    jobs = [*foretold(one), *met(one)]
    for job in jobs:
        assert not job.done
        job.run(quiet=True)
        assert job.done
    twins = one.twins
    believed, real = [simulated(t.source) for t in twins], [t.robot for t in twins]
    assert legs == [*believed, *believed, *real, *real], "once for each controller"
