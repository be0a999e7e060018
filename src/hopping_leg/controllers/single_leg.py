"""Controllers of one leg, as RealAIGym's users write them, made to control many.

Two signatures are known; both return the torques of hip and knee, N m, (2,), or a triple
``(None, None, torques)``:

    get_control_output(meas_pos, meas_vel, meas_tau, meas_time)   # (2,), (2,), (2,), s
    get_control_output(x, t)                                      # (q1, q2, qd1, qd2), s
"""

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import ControllerError
from hopping_leg.sim import CONTROL_RATE
from hopping_leg.sim.channel import Measurement

METHOD = "get_control_output"
"""What a controller of one leg is called by."""

COMMAND = "desired_height"
"""Attribute that holds the commanded apex height, m, whenever ``METHOD`` is called."""


class SingleLeg:
    """Gives every leg a controller of its own; implements ``Controller``.

    Args:
        make: Returns a new controller; called once a leg at every reset.
        rate: Control rate, Hz.
        name: For tables and error messages.

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
        """Return joint torques, N m, (n, 2).

        Each leg is shown its newest sample; as measured torque it is given its last answer, since
        a measurement holds none.

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
    """Tell which of the two signatures a controller has."""
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
