import pytest

from hopping_leg.robot import load_robot
from studies.physics_step.run import (
    ConvergenceStudy,
    _sufficient,
    bench_convergence,
    stiff,
)

ROBOT = load_robot("legv2-paper")


def test_errors_shrink_with_the_step():
    study = ConvergenceStudy(
        [ROBOT], commands=(0.3,), seeds=1, duration=1, steps=(5e-3, 1e-3), reference=5e-4, threads=1
    )
    rows = bench_convergence(study)["rows"]
    assert [row["timestep_s"] for row in rows] == [5e-3, 1e-3]
    for name in ("drop_height_error_m", "stance_height_error_m"):
        assert rows[1][name] < rows[0][name] / 2
        assert rows[1][name] < 0.003


def test_a_step_suffices_only_if_all_finer_ones_do():
    def row(step, shift):
        return {"timestep_s": step, "noisy_largest_median_shift_m": shift}

    rows = [row(4e-3, 0.001), row(2e-3, 0.004), row(1e-3, 0.001), row(5e-4, 0.0)]
    assert _sufficient(rows, 0.002) == 1e-3
    assert _sufficient(rows, 0.01) == 4e-3
    assert _sufficient([*rows, row(5e-4, None)], 0.01) is None


def test_the_stiff_floor_is_mujocos_default():
    contact = stiff(ROBOT).contact
    assert (contact.time_constant, contact.damping_ratio) == (0.02, 1.0)
    assert contact.friction == pytest.approx(ROBOT.contact.friction)
