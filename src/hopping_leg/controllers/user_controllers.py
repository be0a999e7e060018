"""Someone else's controller: a Python class, named ``path/to/file.py:Class`` or ``module:Class``.

The class is made as ``Class(robot, rate=rate)``. It implements ``Controller``, of which ``name``
and ``internals`` may be left out, or controls one leg as RealAIGym's users write it. Two signatures
are known; both return the torques of hip and knee, N m, (2,), or a triple ``(None, None,
torques)``:

    get_control_output(meas_pos, meas_vel, meas_tau, meas_time)   # (2,), (2,), (2,), s
    get_control_output(x, t)                                      # (q1, q2, qd1, qd2), s

Whatever it does, the caller gets torques or one sentence that names it.
"""

import functools
import hashlib
import importlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Callable
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import ControllerError, HoppingLegError, unknown_name
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import CONTROL_RATE
from hopping_leg.sim.channel import Measurement
from hopping_leg.trace import COLUMNS

METHOD = "get_control_output"  # of a controller of one leg
COMMAND = "desired_height"  # its attribute that holds the commanded apex height, m


class SingleLeg:
    """Gives every leg a controller of its own, made at every reset; implements ``Controller``.

    Raises:
        ControllerError: The method takes other arguments than the known ones.
    """

    def __init__(
        self, make: Callable[[], Any], rate: float = CONTROL_RATE, name: str = "single-leg"
    ) -> None:
        self.name, self._make, self._period = name, make, 1 / rate
        self._takes_state = _takes_state(make(), name)
        self.reset(1)

    def reset(self, count: int) -> None:
        """Make new controllers; time begins at zero."""
        self._legs = [self._make() for _ in range(count)]
        for leg in self._legs:
            if callable(begin := getattr(leg, "init", None)):
                begin()
        self._torque = np.zeros((count, 2))
        self._tick = 0

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2); the measured torque shown is the last answer.

        Raises:
            ControllerError: An answer is no pair of torques.
        """
        time = self._tick * self._period
        torque = np.empty_like(self._torque)
        for i, leg in enumerate(self._legs):
            setattr(leg, COMMAND, float(measurement.command[i, 0]))
            q, qd = measurement.q[i, 0].copy(), measurement.qd[i, 0].copy()
            if self._takes_state:
                answer = leg.get_control_output(np.concatenate([q, qd]), time)
            else:
                answer = leg.get_control_output(q, qd, self._torque[i].copy(), time)
            torque[i] = _torques(answer, self.name)
        self._torque, self._tick = torque, self._tick + 1
        return torque.copy()

    def internals(self) -> dict[str, Array]:
        """Return nothing else worth recording."""
        return {}


def _takes_state(leg: object, name: str) -> bool:
    """Return whether a controller takes (x, t) rather than the four measured values."""
    given = list(inspect.signature(getattr(leg, METHOD)).parameters.values())
    needed = [p.name for p in given if p.default is p.empty and p.kind is p.POSITIONAL_OR_KEYWORD]
    names = [p.name for p in given]
    if names[:1] == ["x"] and len(needed) <= 2 <= len(names):
        return True
    if len(needed) <= 4 <= len(names):
        return False
    raise ControllerError(
        f"'{METHOD}' of '{name}' takes ({', '.join(names)}) but must take (meas_pos, meas_vel,"
        " meas_tau, meas_time) or (x, t)."
    )


def _torques(answer: Any, name: str) -> Array:  # noqa: ANN401
    if isinstance(answer, tuple) and len(answer) == 3:
        position, velocity, answer = answer
        if position is not None or velocity is not None:
            raise ControllerError(
                f"'{METHOD}' of '{name}' asks for positions or velocities; legs take torques alone,"
                " so compute them and return (None, None, torques)."
            )
    try:
        torque = np.asarray(answer, dtype=np.float64)
    except (TypeError, ValueError):
        torque = np.empty(0)
    if torque.shape != (2,):
        raise ControllerError(
            f"'{METHOD}' of '{name}' answered {answer!r:.60} but must return the torques of hip and"
            " knee, (2,)."
        )
    return torque


T = TypeVar("T")


class UserController:
    """Guards a controller of someone else, named ``origin``; implements ``Controller``."""

    def __init__(self, controller: Any, origin: str) -> None:  # noqa: ANN401
        self.controller, self.origin = controller, origin
        named = getattr(controller, "name", None)
        self.name = (named if isinstance(named, str) else origin).rpartition(":")[2]
        self._count = 0

    def reset(self, count: int) -> None:
        """Forget everything; the next measurement has ``count`` rows."""
        self._count = count
        attempt(self.origin, lambda: self.controller.reset(count))

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2).

        Raises:
            ControllerError: The controller failed or answered something else than torques.
        """
        answer = attempt(self.origin, lambda: self.controller.act(measurement))
        torque = self._array(answer, "torques")
        if torque.shape != (self._count, 2):
            raise ControllerError(
                f"Controller '{self.origin}' answered an array of shape {torque.shape}; torques of"
                f" hip and knee are ({self._count}, 2)."
            )
        if not np.isfinite(torque).all():
            leg = int(np.flatnonzero(~np.isfinite(torque).all(axis=1))[0])
            raise ControllerError(
                f"Controller '{self.origin}' answered torques of {torque[leg].tolist()} N m; they"
                " must be finite."
            )
        return torque

    def internals(self) -> dict[str, Array]:
        """Return what the controller wants recorded of the last ``act``, each (n,).

        Raises:
            ControllerError: It is no dictionary of (n,), or would replace a column of the trace.
        """
        method = getattr(self.controller, "internals", None)
        if method is None:
            return {}
        found = attempt(self.origin, method)
        if not isinstance(found, dict) or not all(isinstance(name, str) for name in found):
            raise ControllerError(
                f"'internals' of controller '{self.origin}' must return a dictionary of arrays."
            )
        return {name: self._column(name, values) for name, values in found.items()}

    def _column(self, name: str, values: object) -> Array:
        if name in COLUMNS:
            raise ControllerError(
                f"'internals' of controller '{self.origin}' names '{name}', which every trace has;"
                " choose another name."
            )
        column = self._array(values, f"'{name}'")
        if column.shape not in ((), (self._count,)):
            raise ControllerError(
                f"'{name}' of controller '{self.origin}' has shape {column.shape} but must be"
                f" ({self._count},)."
            )
        return np.broadcast_to(column, self._count)

    def _array(self, values: object, what: str) -> Array:
        try:
            return np.asarray(values, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise ControllerError(
                f"Controller '{self.origin}' answered {what} that are no numbers:"
                f" {type(values).__name__}."
            ) from error


def is_user_controller(name: str) -> bool:
    """Return whether a name means a Python class (or a Python file whose class was forgotten)."""
    source, _, wanted = name.rpartition(":")
    dotted = all(part.isidentifier() for part in source.split("."))
    return name.endswith(".py") or (wanted.isidentifier() and (source.endswith(".py") or dotted))


def load_user_controller(name: str, robot: Robot, rate: float) -> UserController:
    """Make a controller from ``path/to/file.py:Class`` or ``module:Class``; rate is in Hz.

    Raises:
        ControllerError: There is no such file, module or class, it fails, or is no controller.
    """
    module, kind, wanted = _find(name, "class", callable)
    make: Callable[[], Any] = functools.partial(kind, robot, rate=rate)
    controller = attempt(name, make, f"could not be made as {wanted}(robot, rate={rate:g})")
    if hasattr(controller, METHOD) and not hasattr(controller, "act"):
        controller = attempt(name, lambda: SingleLeg(make, rate, name))
    missing = [m for m in ("reset", "act") if not callable(getattr(controller, m, None))]
    if missing:
        raise ControllerError(
            f"'{name}' is no controller: it lacks the method '{missing[0]}'; a controller has"
            f" 'reset' and 'act', or '{METHOD}' for a single leg."
        )
    # Kept results tell controllers apart by class: with the digest in its name, an edited file is
    # judged anew.
    file = getattr(module, "__file__", None)
    content = Path(file).read_bytes() if file else module.__name__.encode()
    digest = hashlib.sha256(content).hexdigest()[:16]
    made: UserController = type(f"UserController_{digest}", (UserController,), {})(controller, name)
    return made


def load_user_object(name: str) -> Any:  # noqa: ANN401
    """Return what is called ``path/to/file.py:NAME`` or ``package.module:NAME``.

    Raises:
        ControllerError: There is no such file, module or name, or importing it fails.
    """
    _, found, _ = _find(name, "name", lambda value: value is not None)
    return found


def _find(name: str, what: str, suits: Callable[[object], bool]) -> tuple[ModuleType, Any, str]:
    """Return module, object and its name; errors list what the module defines."""
    source, _, wanted = name.rpartition(":")
    if name.endswith(".py"):
        source, wanted = name, ""
    module = _load_file(Path(source)) if source.endswith(".py") else _load_module(source)
    found = getattr(module, wanted, None) if wanted else None
    if not suits(found):
        classes = inspect.getmembers(module, inspect.isclass)
        known = [n for n, kind in classes if kind.__module__ == module.__name__]
        if not wanted:
            raise ControllerError(
                f"'{name}' names no {what}; write {source}:{what.upper()}, one of:"
                f" {', '.join(known)}."
            )
        raise ControllerError(f"In {source}: " + unknown_name(what, wanted, known))
    return module, found, wanted


def attempt(origin: str, work: Callable[[], T], failure: str = "failed") -> T:
    """Run code of someone else; what it raises becomes one sentence.

    Raises:
        ControllerError: Naming the controller, the error and its line.
    """
    try:
        return work()
    except HoppingLegError:
        raise
    except (Exception, SystemExit) as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(last.filename).name}, line {last.lineno}"
        raise ControllerError(
            f"Controller '{origin}' {failure}: {type(error).__name__}: {error} ({where})."
        ) from error


def _load_file(path: Path) -> ModuleType:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ControllerError(f"Cannot read {path}: {error.strerror}.") from error
    # A name of its own keeps files of equal names apart; dataclasses look their module up by it.
    name = f"hopping_leg_user_file_{hashlib.sha256(content).hexdigest()[:16]}"
    loader = SourceFileLoader(name, str(path))
    spec = importlib.util.spec_from_loader(name, loader)
    assert spec is not None
    sys.modules[name] = module = importlib.util.module_from_spec(spec)
    attempt(str(path), lambda: loader.exec_module(module), "could not be imported")
    return module


def _load_module(name: str) -> ModuleType:
    try:
        found = importlib.util.find_spec(name)
    except (ImportError, ValueError):
        found = None
    if found is None:
        raise ControllerError(
            f"There is no Python module '{name}'; install it, put its folder on PYTHONPATH, or name"
            " a file as path/to/file.py:CLASS."
        )
    return attempt(name, lambda: importlib.import_module(name), "could not be imported")
