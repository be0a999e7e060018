"""An outing on emulated drives comes back as the trace of what was hopped."""

import contextlib

import numpy as np
import pytest

from hopping_leg.controllers.command_schedule import CommandSchedule
from hopping_leg.controllers.registry import load_policy
from hopping_leg.deploy.hardware_trials import DeployedRobot
from hopping_leg.emulator.server import EmulatorConfig
from hopping_leg.emulator.virtual_time import Lockstep
from hopping_leg.errors import HardwareError
from hopping_leg.robot import load_robot

ROBOT = load_robot("legv2-paper")
SCHEDULE = CommandSchedule(((0.3, 1.0), (0.25, 0.5)))


def deployed(tmp_path, lockstep, ready=lambda seconds: None):
    return DeployedRobot(
        ROBOT,
        200.0,
        tmp_path,
        lambda: contextlib.nullcontext(lockstep.link),
        lambda link: {},
        ready,
        lockstep,
    )


@pytest.mark.slow
def test_an_outing_holds_the_hops_alone_and_counts_all_of_its_time(tmp_path):
    lockstep = Lockstep(EmulatorConfig(robot="legv2-paper").build())
    asked = []
    outing = deployed(tmp_path, lockstep, asked.append).hop(load_policy("fast"), SCHEDULE, 1)
    lockstep.link.close()
    assert asked == [1.5]
    assert not outing.complaint
    assert len(outing.trace.table) == 300
    assert outing.seconds > 1.5 + 2.0 + 1.5
    assert outing.truth is None
    command = outing.trace.column("command_m")
    np.testing.assert_allclose(command[[0, -1]], [0.3, 0.25])
    torque = [outing.trace.column(f"{joint}_command_nm") for joint in ("hip", "knee")]
    assert np.abs(torque).max() <= 6.0
    assert len(list(tmp_path.glob("*.parquet"))) == 1


class Broken:
    """Fails at once, or after some ticks."""

    name = "broken"

    def __init__(self, ticks):
        self.ticks = ticks

    def reset(self, count):
        self.tick = 0

    def act(self, measurement):
        self.tick += 1
        if self.tick > self.ticks:
            raise ValueError("broken")
        return np.zeros((1, 2))

    def internals(self):
        return {}


@pytest.mark.slow
@pytest.mark.parametrize("ticks", [10, 230])
def test_a_stop_by_the_supervisor_comes_back_as_a_complaint(tmp_path, ticks):
    lockstep = Lockstep(EmulatorConfig(robot="legv2-paper").build())
    robot = deployed(tmp_path, lockstep)
    if ticks < 200:
        with pytest.raises(HardwareError, match="before it hopped"):
            robot.hop(Broken(ticks), SCHEDULE, 1)
    else:
        outing = robot.hop(Broken(ticks), SCHEDULE, 1)
        assert "error" in outing.complaint
        assert len(outing.trace.table) <= ticks + 1
    lockstep.link.close()
