import pytest

from hopping_leg.controllers.registry import robot_of
from hopping_leg.robot import load_robot
from studies.physics_step.run import PhysicsStep, _fits, converged


def rows(*medians, std=0.001, error=1e-5):
    return [
        {
            "controller": "c",
            "robot": "r",
            "timestep_s": 1e-3 / 2**k,
            "median_error_m": m,
            "std_m": std,
            "median_error_m_standard_error": error,
            "std_m_standard_error": 1e-5,
        }
        for k, m in enumerate(medians)
    ]


def test_a_step_has_converged_if_all_finer_halvings_move_little():
    assert converged(rows(0.004, 0.002, 0.0018, 0.0017)) == 5e-4
    assert converged(rows(0.004, 0.004, 0.001, 0.0009)) == 2.5e-4
    assert converged(rows(0.004, 0.002, None, 0.0017)) is None
    assert converged(rows(0.004, 0.002)) is None
    assert converged(rows(0.004, 0.002, error=0.001)) == 1e-3


def test_a_policy_hops_on_its_own_robot_alone():
    assert _fits("precise", load_robot(robot_of(["precise"])))
    assert not _fits("precise", load_robot("legv1"))
    assert _fits("energy-shaping", load_robot("legv1"))


def test_energy_shaping_hops_alike_at_both_steps():
    study = PhysicsStep(
        ("energy-shaping",), ("legv2-paper",), (0.3,), 5e-4, halvings=1, repeats=3, duration=4
    )  # fmt: skip
    result = study.measure()
    coarse, fine = result["rows"]
    assert coarse["hops"] >= 10
    assert coarse["median_error_m"] == pytest.approx(fine["median_error_m"], abs=0.005)
