"""Emulated drives in virtual time behind every transport of the command line."""

import contextlib
import functools

import numpy as np

from hopping_leg.deploy import hardware_trials, moteus_link, motion_sequence, transport
from hopping_leg.emulator.server import EmulatorConfig
from hopping_leg.emulator.virtual_time import Lockstep
from hopping_leg.identify.excitation import Excitation


def put_behind(monkeypatch, *, clamped=False, **start):
    """Put drives behind every transport that is opened from now on; return them and their clock.

    The base of a clamped leg stays where it is.
    """
    lockstep = Lockstep(EmulatorConfig(**{"robot": "legv2-paper", **start}).build())
    if clamped:
        legs = lockstep.robot.leg._legs
        legs.fixed_base = True
        legs.set_robots(legs.robots)

    def link(robot, _transport):
        lockstep.link.robot = robot  # as the host believes
        return lockstep.link

    monkeypatch.setattr(transport, "open_transport", lambda name: None)
    monkeypatch.setattr(moteus_link, "MoteusLink", link)
    monkeypatch.setattr(hardware_trials, "RealClock", lambda: lockstep)
    quick = functools.partial(motion_sequence.SequenceTiming, rise=0.4, settle=0.1, sink=0.5)
    monkeypatch.setattr(motion_sequence, "SequenceTiming", quick)
    quiet = contextlib.nullcontext(())
    monkeypatch.setattr(hardware_trials, "keeping_time", lambda: quiet)
    return lockstep


def write_sine(folder, rig, count):
    """Write an excitation in which hip and knee are bent and stretched; return file and content."""
    time = np.arange(count) / 200
    bend = 0.2 * np.sin(2 * np.pi * time / 0.75)
    position = np.stack([0.8 + bend, -1.6 - 2 * bend], axis=1)
    excitation = Excitation(time, position, 0 * position, rig, 200.0, "legv2", "a sine")
    excitation.save(folder / "sine.parquet")
    return folder / "sine.parquet", excitation
