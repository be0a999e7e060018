"""A leg without wire, a clock that only moves when told, and controllers that misbehave."""

from dataclasses import replace

import numpy as np

from hopping_leg.controllers.command_schedule import CommandSchedule
from hopping_leg.deploy.drive_link import Action, DriveMode, Exchange, Reply
from hopping_leg.deploy.flight_recorder import FlightRecorder
from hopping_leg.deploy.loop import ControlLoop, columns
from hopping_leg.deploy.motion_sequence import MotionSequence, Poses, SequenceTiming
from hopping_leg.deploy.safety_limits import hopping_limits
from hopping_leg.robot import SoftLimits, load_robot
from hopping_leg.sim import SoftLimiter

LEG = load_robot("legv2")
RATE = 200.0
POSES = Poses(np.array([0.8, -1.6]), np.array([1.0, -2.0]))
MODES = dict(zip(Action, (DriveMode.STOPPED, DriveMode.POSITION, DriveMode.BRAKE), strict=True))
SHORT = SequenceTiming(hop=0.5, rise=0.3, settle=0.1, sink=0.3, fade=0.1)


class FakeClock:
    """Time that passes only by waiting and by what the fake link takes."""

    def __init__(self):
        self.time = 100.0
        self.hiccups = {}

    def now(self):
        return self.time

    def wait_until(self, deadline):
        self.time = max(self.time, deadline) + self.hiccups.pop(round(deadline, 4), 0.0)
        return self.time


class FakeLink:
    """Two noisy joints in honey; ``alter(tick, joint, reply)`` changes or drops a reply."""

    def __init__(self, clock, alter=lambda tick, joint, reply: reply, latency=5e-4):
        self.clock, self.alter, self.latency = clock, alter, latency
        self.q, self.qd = np.array([0.9, -1.8]), np.zeros(2)
        self.told = []
        self.tick = -1
        self.mode = [DriveMode.STOPPED] * 2
        self._command, self._moved = None, clock.now()

    def exchange(self, outgoing, until):
        self.tick += 1
        self.send(outgoing)
        taken = self.clock.time
        self.clock.time += self.latency
        replies = tuple(self.alter(self.tick, n, self._reply(n, taken)) for n in range(2))
        if None in replies:
            self.clock.time = max(self.clock.time, until)
        return Exchange(replies)

    def send(self, outgoing):
        self._move()
        self.told.append(outgoing)
        self._command = outgoing
        self.mode = [MODES[outgoing.action]] * 2

    def _reply(self, joint, taken):
        noise = 1e-5 * (-1) ** self.tick
        position, velocity = float(self.q[joint]) + noise, float(self.qd[joint])
        mode = self.mode[joint]
        given = self._command.torque[joint] if mode is DriveMode.POSITION else 0.0
        return Reply(position, velocity, given, int(mode), 0, 24.0, 30.0, taken)

    def _move(self):
        elapsed, self._moved = self.clock.time - self._moved, self.clock.time
        if self._command is None or elapsed <= 0:
            return
        torque = np.array(self._command.torque)
        steps = max(round(elapsed / 5e-4), 1)
        for _ in range(steps):
            self.qd += elapsed / steps * (torque - 0.3 * self.qd) / 0.02
            self.q += elapsed / steps * self.qd


class Still:
    """Holds a torque; a Controller."""

    name = "still"

    def __init__(self, torque=(0.0, 0.0)):
        self.torque, self.calls = np.array([torque]), 0
        self.ages = []

    def reset(self, count):
        self.calls = 0

    def act(self, measurement):
        self.calls += 1
        self.ages.append(measurement.age[0])
        return self.torque

    def internals(self):
        return {"calls": np.array([float(self.calls)])}


def make_loop(tmp_path, controller=None, *, link=None, timing=SHORT, **limits):
    """Return a loop on a fake link, and both."""
    clock = link.clock if link else FakeClock()
    link = link or FakeLink(clock)
    controller = controller or Still()
    commands, limiter = CommandSchedule(((0.3, 100.0),)), SoftLimiter(LEG, SoftLimits())
    sequence = MotionSequence(controller, commands, POSES, limiter, timing)
    limits = replace(hopping_limits(LEG, RATE), **limits)
    header = {"robot": LEG.name, "controller": controller.name}
    box = FlightRecorder(tmp_path / "run.blackbox", columns(controller), header)
    return ControlLoop(link, sequence, limits, box, clock), link, box
