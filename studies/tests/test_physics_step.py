import pytest

from studies.physics_step.run import PhysicsStep, converged


def rows(*medians, error=1e-5):
    told = {"controller": "c", "robot": "r", "std_m": 0.001, "std_m_standard_error": 1e-5}
    return [
        told | {"timestep_s": 1e-3 / 2**k, "median_error_m": m,
                "median_error_m_standard_error": error}
        for k, m in enumerate(medians)
    ]  # fmt: skip


def test_a_step_has_converged_if_all_finer_halvings_move_little():
    assert converged(rows(0.004, 0.002, 0.0018, 0.0017)) == 5e-4
    assert converged(rows(0.004, 0.004, 0.001, 0.0009)) == 2.5e-4
    assert converged(rows(0.004, 0.002, None, 0.0017)) is None
    assert converged(rows(0.004, 0.002)) is None
    assert converged(rows(0.004, 0.002, error=0.001)) == 1e-3


def test_energy_shaping_hops_alike_at_both_steps():
    study = PhysicsStep(
        ("energy-shaping",), ("legv2-paper",), (0.3,), 5e-4, halvings=1, repeats=3, duration=4
    )  # fmt: skip
    coarse, fine = study.measure()["rows"]
    assert coarse["hops"] >= 10
    assert coarse["median_error_m"] == pytest.approx(fine["median_error_m"], abs=0.005)
