import dataclasses
from functools import cache

import numpy as np
import polars as pl
import pytest

from hopping_leg.cli import main
from hopping_leg.identify import excitation, paper_excitation, play_excitation
from hopping_leg.identify.diagnosis import diagnose
from hopping_leg.robot import SensorMismatch, load_robot
from hopping_leg.sim.randomization import draw_twin
from tests.identify.twin import LEG, STEP, changed, record, swing

BELIEVED, SEED = load_robot("legv2"), 8102
NOISY = SensorMismatch(velocity_noise=1.0)


@cache
def played(*changes):
    """Return a twin's recording; ``changes`` are (path in [reality], name, value)."""
    robot = draw_twin(SEED).robot
    reality = robot.reality
    for part, name, value in changes:
        one = dataclasses.replace(getattr(reality, part), **{name: value})
        reality = dataclasses.replace(reality, **{part: one})
    strokes = paper_excitation.fixed_base(swings=(10.0,), duration=30.0)
    template = paper_excitation.adapt(strokes, BELIEVED)
    targets = excitation.make_excitation(template, BELIEVED)
    twin = dataclasses.replace(robot, reality=reality)
    return play_excitation.play(targets, twin, believed="legv2", seed=SEED)


def shifted(**columns):
    """Return the healthy twin's recording with numbers added to columns."""
    return changed(played(), *(pl.col(name) + by for name, by in columns.items()))


def turned(by):
    """Return the healthy twin's recording with another zero of the hip, rad."""
    return shifted(hip_position_rad=by, hip_position_command_rad=by)


def rubbing(at=None):
    """Return a leg whose knee rubs around an angle, rad, or nowhere."""

    def rubs(q):
        return np.array([0.0, 0.0 if at is None else 0.4 * np.exp(-(((q[1] - at) / 0.3) ** 2))])

    return record(LEG, swing(16.0), rubs=rubs, fine=STEP)


def lossy():
    """Return the healthy twin's recording without every twentieth position."""
    position = pl.when(pl.int_range(pl.len()) % 20 > 0).then(pl.col("hip_position_rad"))
    return changed(played(), position.alias("hip_position_rad"))


@pytest.mark.parametrize(
    ("make", "kind", "joint", "value"),
    [
        (lambda: played(("hip", "torque_gain", 0.78)), "gain", "hip", 0.78),
        (lambda: played(("knee", "torque_gain", 0.78)), "gain", "knee", 0.78),
        (lambda: shifted(hip_torque_nm=0.2), "offset", "hip", 0.2),
        (lambda: shifted(knee_torque_nm=-0.2), "offset", "knee", -0.2),
        (lambda: turned(0.25), "zero", "hip", 0.25),
        (lossy, "dropouts", "", 0.05),
        (lambda: played(("hip", "sensor", NOISY)), "noise", "hip", 1.0),
        (lambda: played(("hip", "backlash", 0.03)), "backlash", "hip", 5.7),
        (lambda: rubbing(-1.0), "rubbing", "knee", 0.35),
    ],
)
def test_what_is_wrong_is_named_with_its_number_and_nothing_else(make, kind, joint, value):
    (found,) = diagnose(make(), BELIEVED)
    assert (found.kind, found.joint) == (kind, joint)
    assert abs(found.value - value) < max(3 * found.deviation, 0.2 * abs(value))
    starts = (f"The {joint}'s", f"The {joint} trembles", "By its gravity", "5 %", "Around")
    assert found.sentence.startswith(starts)


def test_commands_that_act_late_are_named():
    found = diagnose(played(("latency", "command", 0.012)), BELIEVED)
    assert [one.kind for one in found] == ["delay"]
    assert found[0].value == pytest.approx(0.012, abs=0.003)


def test_nothing_is_said_of_a_healthy_leg_or_without_torques(tmp_path, capsys):
    assert diagnose(played(), BELIEVED) == []
    assert diagnose(rubbing(), BELIEVED) == []
    torques = {"hip_torque_nm": pl.lit(np.nan), "knee_torque_nm": pl.lit(np.nan)}
    assert diagnose(changed(shifted(hip_torque_nm=0.2), **torques), BELIEVED) == []
    path, numbers = tmp_path / "run.parquet", tmp_path / "findings.json"
    played().save(path)
    assert main(["diagnose", str(path), "--json", str(numbers)]) == 0
    assert "Nothing is wrong" in capsys.readouterr().out
    assert '"findings": []' in numbers.read_text()
