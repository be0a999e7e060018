"""Emulated drives in virtual time behind every transport of the command line."""

import contextlib
import functools

from hopping_leg.cli import deploy, record
from hopping_leg.deploy import hardware_trials, moteus_link, transport
from hopping_leg.deploy.motion_sequence import SequenceTiming
from hopping_leg.emulator.server import EmulatorConfig
from hopping_leg.emulator.virtual_time import Lockstep


def put_behind(monkeypatch, **start):
    """Put drives behind every transport that is opened from now on; return them and their clock."""
    lockstep = Lockstep(EmulatorConfig(**{"robot": "legv2-paper", **start}).build())
    monkeypatch.setattr(transport, "opener", lambda name: None)
    monkeypatch.setattr(moteus_link, "MoteusLink", lambda robot, opener: lockstep.link)
    monkeypatch.setattr(hardware_trials, "RealClock", lambda: lockstep)
    quick = functools.partial(SequenceTiming, rise=0.4, settle=0.1, sink=0.5)
    for verb in (deploy, record):
        monkeypatch.setattr(verb, "SequenceTiming", quick)
    quiet = contextlib.nullcontext(())
    monkeypatch.setattr(hardware_trials, "keeping_time", lambda **_: quiet)
    return lockstep
