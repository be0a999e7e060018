"""Hardware trials: a run from a checked link to a trace on disk, and the legs that make them."""

import atexit
import concurrent.futures
import datetime
import os
import shlex
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any

from polars.exceptions import PanicException

from hopping_leg import flight_recording
from hopping_leg.controllers import protocol
from hopping_leg.controllers.fallback import Fallback
from hopping_leg.controllers.policy import Policy
from hopping_leg.deploy import drive_link, flight_recorder, safety_limits, stop_reasons, supervisor
from hopping_leg.deploy.loop import ControlLoop, LoopOutcome, columns
from hopping_leg.deploy.motion_sequence import MotionSequence, Part
from hopping_leg.deploy.realtime import Clock, RealClock, keeping_time
from hopping_leg.errors import HardwareError, TraceError
from hopping_leg.io import safe_file_name, versions
from hopping_leg.robot import Robot
from hopping_leg.trace import Trace

if TYPE_CHECKING:
    from hopping_leg.deploy.moteus_link import MoteusLink

_PACKAGES = ("hopping-leg", "numpy", "onnxruntime", "moteus", "python-can")
_STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGQUIT, signal.SIGHUP, signal.SIGTSTP)
_LOOK_EVERY = 0.05  # s
_PATIENCE = 0.5  # How long a controller may take before the leg is left to the drives' brakes, s

_BRAKES = 3  # Times that the drives are told to brake then
_LAST_SECONDS = 0.6  # After a second signal, for the record; then the process ends
_FAILED = 2  # Exit code
_FULL_RATE = 0.98  # Share of the ticks below which a run is said to have been slow
_CODES: dict[str, type[Enum]] = {
    "state": supervisor.State,
    "part": Part,
    "action": drive_link.Action,
    "reason": stop_reasons.Reason,
}


@dataclass(frozen=True)
class Performance:
    """A finished run, its trace, and where that lies on disk."""

    outcome: LoopOutcome
    trace: Trace
    path: Path
    notices: tuple[str, ...]
    """What the computer did not permit, and what it did too late."""
    complaint: str
    """Why the record may not be whole, or nothing."""


def perform(
    link: "MoteusLink",
    sequence: MotionSequence,
    limits: safety_limits.SafetyLimits,
    path: Path,
    *,
    facts: dict[str, Any] | None = None,
    clock: Clock | None = None,
    threaded: bool = False,
    beside: Callable[[ControlLoop], AbstractContextManager[None]] = lambda _: nullcontext(),
) -> Performance:
    """Arm, run a sequence, stop; a signal stops it as the operator would, a second one ends it.

    The drives behind the link were found fit. The flight recording lies beside ``path``, the
    trace's, until that is complete; its header holds the facts, too. Without a clock time is the
    computer's, which asks for priority and locked memory and records in a thread, see
    ``FlightRecorder``. ``beside`` makes what is open while the loop runs, e.g. a keyboard that
    stops it.

    Raises:
        TraceError: The flight recording cannot be created, or the trace cannot be written.
        HardwareError: The controller did not return, or a second signal ended the run.
    """
    controller, rate, real = sequence.controller, round(1 / limits.period, 6), clock is None
    recording = path.with_suffix(flight_recording.SUFFIX)
    header = {**_header(link.robot, controller, rate), **(facts or {})}
    recorder = flight_recorder.FlightRecorder(
        recording, columns(controller), header, threaded=threaded or real
    )
    loop = ControlLoop(link, sequence, limits, recorder, clock or RealClock())
    notices: tuple[str, ...] = ()
    try:
        with (
            _stop_signals(loop) as signals,
            beside(loop),
            keeping_time() if real else nullcontext(notices) as notices,
        ):
            outcome = _run(loop, signals, recording)
    finally:
        if link.trouble:
            recorder.event(link_trouble=link.trouble)
        recorder.close()
    share = outcome.ticks / max(outcome.ticks + outcome.skipped, 1)
    if share < _FULL_RATE:
        notices += (
            f"The loop ran at {rate * share:.0f} instead of {rate:g} Hz: this computer was late;"
            " end other programs, or permit real-time priority.",
        )
    return _finish(outcome, recorder, path, notices)


def _run(loop: ControlLoop, signals: list[int], recording: Path) -> LoopOutcome:
    """Run the loop in a thread of its own; this one takes the signals, and brakes if need be."""
    done: concurrent.futures.Future[LoopOutcome] = concurrent.futures.Future()

    def run() -> None:
        try:
            done.set_result(loop.run())
        except BaseException as error:
            done.set_exception(error)

    threading.Thread(target=run, name="control-loop", daemon=True).start()
    while not concurrent.futures.wait([done], _LOOK_EVERY).done:
        why = "A second signal ended the run" if len(signals) > 1 else ""
        if loop.waited > _PATIENCE:
            why = f"The controller did not return within {_PATIENCE:g} s"
        if why:
            for _ in range(_BRAKES):
                loop.abandon()
                time.sleep(_LOOK_EVERY / 2)
            # What never returns must not keep the process.
            atexit.register(lambda: None if done.done() else os._exit(_FAILED))
            if len(signals) > 1:
                ending = threading.Timer(_LAST_SECONDS, os._exit, (_FAILED,))
                ending.daemon = True
                ending.start()
            raise HardwareError(
                f"{why}: the drives were told to brake. `{_draw(recording)}` shows what was"
                " recorded."
            )
    return done.result()


def _draw(recording: Path) -> str:
    """Return the command that writes a recording's trace and draws it."""
    return shlex.join(["hop", "report", str(recording)])


def _finish(
    outcome: LoopOutcome,
    recorder: flight_recorder.FlightRecorder,
    path: Path,
    notices: tuple[str, ...],
) -> Performance:
    """Write the trace; the flight recording goes once the trace on the disk holds all of it."""
    complaint, kept = "", recorder.path
    if recorder.lost:
        complaint = f"{recorder.lost} entries of the record are lost ({recorder.error})."
    try:
        trace = flight_recording.recover(kept)
        if recorder.error is not None:
            notice = f"The flight recorder could not write for a time: {recorder.error}."
            notices += (notice,)
            trace.header["events"].append({"record": complaint or notice})
        trace.save(path)
        whole = Trace.load(path).table.height == recorder.rows
    except (Exception, PanicException) as error:  # polars panics where it can open no more
        raise TraceError(
            f"The run is over: {outcome.supervisor.stop_cause} {complaint} {error} What the disk"
            f" took is in {kept}; once there is room, `{_draw(kept)}` writes the trace."
        ) from error
    if whole and not complaint:
        kept.unlink()
    elif not complaint:
        complaint = f"{path} does not hold all {recorder.rows} ticks."
    if complaint:
        complaint += f" The flight recording {kept} is kept."
    return Performance(outcome, trace, path, notices, complaint)


def _header(robot: Robot, controller: protocol.Controller, rate: float) -> dict[str, Any]:
    """Return a trace's header: what ran on what, and what its codes mean."""
    if isinstance(controller, Fallback):
        controller = controller.policy
    policy = {"policy_digest": controller.digest} if isinstance(controller, Policy) else {}
    return {
        "robot": robot.name,
        "robot_digest": robot.digest,
        "controller": controller.name,
        **policy,
        "rate_hz": rate,
        "height_sensor": robot.hardware.height.source,
        "started": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "versions": versions(*_PACKAGES),
        "codes": {
            name: {str(member.value): member.name.lower() for member in kind}
            for name, kind in _CODES.items()
        },
    }


def new_path(folder: Path, name: str) -> Path:
    """Return a trace's path that no earlier run has."""
    stem = f"{safe_file_name(name)}-{datetime.datetime.now(datetime.UTC):%Y%m%d-%H%M%S}"
    path, count = folder / f"{stem}.parquet", 1
    while path.exists() or path.with_suffix(flight_recording.SUFFIX).exists():
        count += 1
        path = folder / f"{stem}-{count}.parquet"
    return path


@contextmanager
def _stop_signals(loop: ControlLoop) -> Iterator[list[int]]:
    """Let signals stop the leg, and collect them; outside of the main thread there are none."""
    came: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield came
        return

    def stop(number: int, _: object) -> None:
        came.append(number)
        loop.stop()

    before = {number: signal.getsignal(number) for number in _STOP_SIGNALS}
    if before[signal.SIGHUP] is signal.SIG_IGN:  # under nohup no terminal is to be missed
        del before[signal.SIGHUP]
    for number in before:
        signal.signal(number, stop)
    try:
        yield came
    finally:
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)
