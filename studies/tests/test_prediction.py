"""How well a simulation foretells hops on the leg."""

import json

import pytest
from tests.sim_to_real.studies import study

from hopping_leg.sim_to_real import stages
from studies.sim_to_real.run import HOPPERS, Foretell, Meet, foretold, met, prediction_rows


def write(job, *apexes):
    job.file.parent.mkdir(exist_ok=True)
    rows = [{"command_m": 0.3, "median_error_m": apex - 0.3} for apex in apexes]
    job.file.write_text(json.dumps({"rows": rows}))


def test_errors_are_predicted_minus_measured_apexes_of_the_same_twin(tmp_path):
    one = study(tmp_path, ("truth", "cad"))
    a, b = one.twins
    truth, cad = one.methods
    for twin, method, apexes in (
        (a, None, (0.25, 0.35)), (b, None, (0.26, 0.36)),
        (a, truth, (0.25, 0.35)), (b, truth, (0.26, 0.36)),
        (a, cad, (0.27, 0.37)), (b, cad, (0.22, 0.42)),
    ):  # fmt: skip
        for hopper in HOPPERS:
            job = Foretell(one, twin, hopper, method) if method else Meet(one, twin, hopper)
            write(job, *apexes)
    perfect, other, *_ = prediction_rows(foretold(one), met(one))
    assert perfect["median_abs_error_m"] == pytest.approx(0.0)
    assert other["median_abs_error_m"] == pytest.approx(0.03)
    assert other["worst_abs_error_m"] == pytest.approx(0.06)
    assert other["errors_m"]["twin-1"] == pytest.approx([-0.04, 0.06])


def test_the_controllers_hop_in_the_methods_simulation(tmp_path, monkeypatch):
    one = study(tmp_path, ("truth",))
    legs = []
    monkeypatch.setattr(stages, "hop", lambda content, leg, study: legs.append(leg) or [])
    jobs = [*foretold(one), *met(one)]
    for job in jobs:
        assert not job.done
        job.run(quiet=True)
        assert job.done
    twins = one.twins
    believed, real = [t.without_surprises for t in twins], [t.robot for t in twins]
    assert legs == [*believed, *believed, *real, *real], "once for each controller"
