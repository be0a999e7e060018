import contextlib
import gc
import os
import sys

from hopping_leg.deploy import realtime


def test_garbage_collection_is_held_off_and_comes_back():
    interval = sys.getswitchinterval()
    with contextlib.suppress(RuntimeError), realtime.uninterrupted():
        assert not gc.isenabled()
        raise RuntimeError
    assert gc.isenabled()
    assert sys.getswitchinterval() == interval


def test_what_is_not_permitted_is_a_notice(monkeypatch):
    def refuse(*_):
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    assert "SCHED_FIFO" in realtime.prefer_this_process()
    with realtime.keeping_time(realtime=False) as notices:
        assert notices == ()
