"""Someone else's controller: a Python class, named ``path/to/file.py:Class`` or ``module:Class``.

The class is made as ``Class(robot, rate=rate)``. It implements ``Controller``, of which ``name``
and ``internals`` may be left out, or controls one leg, as RealAIGym's users write it, by

    get_control_output(meas_pos, meas_vel, meas_tau, meas_time)   # (2,), (2,), (2,), s

which returns the torques of hip and knee, N m, (2,); its attribute ``desired_height`` is the
commanded apex height, m. Whatever it does, the caller gets torques or a sentence that names it.
"""

import contextlib
import hashlib
import importlib
import importlib.util
import sys
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import ControllerError, HoppingLegError, unknown_name
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim.channel import Measurement


class SingleLeg:
    """Gives every leg a controller of its own, made at every reset, at a period in s."""

    def __init__(self, make: Callable[[], Any], period: float) -> None:
        self._make, self._period = make, period

    def reset(self, count: int) -> None:
        """Make new controllers; time begins at zero."""
        self._legs = [self._make() for _ in range(count)]
        self._torque, self._tick = np.zeros((count, 2)), 0

    def act(self, measurement: Measurement) -> list[Any]:
        """Return what each leg's controller answers; the torque shown is the last answer."""
        time, answers = self._tick * self._period, []
        for i, leg in enumerate(self._legs):
            leg.desired_height = float(measurement.command[i, 0])
            q, qd = measurement.q[i, 0].copy(), measurement.qd[i, 0].copy()
            answers.append(leg.get_control_output(q, qd, self._torque[i].copy(), time))
        self._torque, self._tick = np.array(answers, np.float64), self._tick + 1
        return answers


class UserController:
    """Guards a controller, ``origin``, told from others by a digest; a ``Controller``."""

    def __init__(self, controller: Any, origin: str, name: object, digest: str) -> None:  # noqa: ANN401
        self.controller, self.origin, self.digest, self._count = controller, origin, digest, 0
        self.name = (name if isinstance(name, str) else origin).rpartition(":")[2]

    def reset(self, count: int) -> None:
        """Forget everything; the next measurement has ``count`` rows."""
        self._count = count
        with guarded(self.origin):
            self.controller.reset(count)

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2); ControllerError for a failure or another answer."""
        with guarded(self.origin):
            torque = np.array(self.controller.act(measurement), np.float64)
        if torque.shape != (self._count, 2) or not np.isfinite(torque).all():
            raise ControllerError(
                f"Controller '{self.origin}' must answer finite torques of hip and knee, in N m and"
                f" in the shape ({self._count}, 2), not {torque.tolist()!r:.60} in"
                f" {torque.shape}."
            )
        return torque

    def internals(self) -> dict[str, Array]:
        """Return what the controller wants recorded of the last ``act``, each (n,)."""
        with guarded(self.origin):
            found: dict[str, Any] = getattr(self.controller, "internals", dict)()
            return {
                name: np.broadcast_to(np.asarray(values, np.float64), self._count)
                for name, values in found.items()
            }


def is_user_controller(name: str) -> bool:
    """Return whether a name means a Python class (or a Python file whose class was forgotten)."""
    source, _, wanted = name.rpartition(":")
    dotted = all(part.isidentifier() for part in source.split("."))
    return name.endswith(".py") or (wanted.isidentifier() and (source.endswith(".py") or dotted))


def load_user_controller(name: str, robot: Robot, rate: float) -> UserController:
    """Make a controller from ``FILE.py:CLASS`` or ``module:CLASS``, or raise ControllerError."""
    module, kind = find_user_object(name)
    with guarded(name, f"could not be made as {name.rpartition(':')[2]}(robot, rate={rate:g})"):
        controller = kind(robot, rate=rate)
    named = getattr(controller, "name", None)
    if hasattr(controller, "get_control_output") and not hasattr(controller, "act"):
        controller = SingleLeg(lambda: kind(robot, rate=rate), 1 / rate)
    if not (hasattr(controller, "reset") and hasattr(controller, "act")):
        raise ControllerError(
            f"'{name}' is no controller, which has the methods 'reset' and 'act', or"
            " 'get_control_output' for a single leg."
        )
    content = Path(module.__file__).read_bytes() if module.__file__ else b""
    return UserController(controller, name, named, hashlib.sha256(content).hexdigest()[:16])


def find_user_object(name: str) -> tuple[ModuleType, Any]:
    """Return the module of ``path/to/file.py:NAME`` or ``module:NAME``, and what NAME is in it.

    ControllerError lists the classes that the module defines.
    """
    source, _, wanted = name.rpartition(":")
    if name.endswith(".py"):
        source, wanted = name, ""
    with guarded(source, "could not be imported"):
        if source.endswith(".py"):
            # A name of its own keeps files of equal names apart; dataclasses look it up.
            digest = hashlib.sha256(Path(source).read_bytes()).hexdigest()[:16]
            spec = importlib.util.spec_from_file_location(f"hopping_leg_user_file_{digest}", source)
            assert spec is not None
            assert spec.loader is not None
            sys.modules[spec.name] = module = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(module)
        else:
            module = importlib.import_module(source)
    if not hasattr(module, wanted):
        kinds = [kind for kind in vars(module).values() if isinstance(kind, type)]
        known = [kind.__name__ for kind in kinds if kind.__module__ == module.__name__]
        hint = "" if wanted else f" Write {source}:CLASS."
        raise ControllerError(f"In {source}: {unknown_name('class', wanted, known)}{hint}")
    return module, getattr(module, wanted)


@contextlib.contextmanager
def guarded(origin: str, failure: str = "failed") -> Iterator[None]:
    """Let someone else's code run; a ControllerError names it, what it raises, and the line."""
    try:
        yield
    except HoppingLegError:
        raise
    except (Exception, SystemExit) as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(last.filename).name}, line {last.lineno}"
        raise ControllerError(
            f"Controller '{origin}' {failure}: {type(error).__name__}: {error} ({where})."
        ) from error
