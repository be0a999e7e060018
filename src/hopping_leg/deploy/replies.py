"""From a frame of a drive to a dated reply at the joint.

The adapter may deliver a reply late, as if it answered the next question. The drive's own
millisecond counter (register 0x070) tells: the smallest difference between arrival and counter seen
so far is that of a reply that was not held up.
"""

import math
from typing import Any

from moteus import multiplex
from moteus.multiplex import SubframeType
from moteus.protocol import Register, scale_register

from hopping_leg.deploy.drive_link import DriveMode, JointTransform, Reply

_WRAP, _HALF = 1 << 32, 1 << 31
_DRIFT = 2e-4  # Most that two clocks drift apart, s/s: both are quartzes
_RESTART = -500
"""A counter that falls back further, ms, began anew, unless its drive ``follows`` torques."""

_ANALOG = range(Register.AUX1_ANALOG_IN1, Register.AUX2_ANALOG_IN5 + 1)
_ENCODERS = {Register.ENCODER_1_POSITION: 0b100, Register.ENCODER_2_POSITION: 0b10000}
"""Positions of a drive's further encoders, and their bits in the validity."""

_FIRST = 20  # replies with which a clock is compared

SLACK = 0.0015
"""A reply may seem this much older than its question, s: the counter's step and drift."""


class DriveClock:
    """Dates the replies of one drive."""

    def __init__(self) -> None:
        self._counter: int | None = None
        self._time = self._offset = self._updated = 0.0
        self._replies, self._least, self._began = 0, math.inf, 0.0
        self.ahead = 0.0
        """What the drive's clock has gained, beyond what quartzes do, s."""

    def date(self, counter: int, arrived: float, *, follows: bool = False) -> float | None:
        """Return when a reply was measured, s on the host's clock; None if it was seen before."""
        step = (counter - (self._counter or 0) + _HALF) % _WRAP - _HALF
        if self._counter is None or (step < _RESTART and not follows):
            self._counter, self._time = counter, counter % _WRAP * 1e-3
            self._offset, self._updated = arrived - self._time, arrived
            self._replies, self._least, self._began, self.ahead = 0, math.inf, arrived, 0.0
            return arrived
        if step == 0:
            return None
        time = self._time + step * 1e-3
        if step > 0:
            self._counter, self._time = counter, time
        self._replies += 1
        if self._replies <= _FIRST:  # of which the least held up tells the clocks' difference
            self._least = min(self._least, arrived - time)
        self.ahead = self._least - (arrived - time) - _DRIFT * (arrived - self._began)
        allowance = _DRIFT * (arrived - self._updated)
        self._offset, self._updated = min(self._offset + allowance, arrived - time), arrived
        return time + self._offset


def read_registers(data: bytes) -> dict[int, Any]:
    """Return the registers that an answer tells; a damaged one raises exceptions of many types."""
    values = {}
    for part in multiplex.parse_frame(data):
        if part.type is SubframeType.READ:  # of which the parser yields as many as it says
            raise ValueError
        if part.type is SubframeType.RESPONSE:
            values[part.register] = scale_register(part.register, part.resolution, part.value)
    return values


def sensor_reading(values: dict[int, Any]) -> float:
    """Return what a drive reads of a height sensor, NaN if nothing.

    An encoder must be valid; an analogue input at zero has no function, or no wire.
    """
    valid = int(values.get(Register.ENCODER_VALIDITY, 0))
    read = [value for register, value in values.items() if register in _ANALOG and value]
    read += [values[r] for r, bit in _ENCODERS.items() if r in values and valid & bit]
    return float(read[0]) if read else math.nan


def read_reply(
    data: bytes, transform: JointTransform, clock: DriveClock, now: float
) -> Reply | None:
    """Return the state that a frame reports; None if it is incomplete, senseless or not new."""
    try:
        values = read_registers(data)
        counter = values[Register.MILLISECOND_COUNTER]
        mode, fault = int(values[Register.MODE]), int(values[Register.FAULT])
        position, velocity = values[Register.POSITION], values[Register.VELOCITY]
        torque, voltage = values[Register.TORQUE], values[Register.VOLTAGE]
        temperature, sensed = values[Register.TEMPERATURE], sensor_reading(values)
    except Exception:
        return None
    taken = clock.date(int(counter), now, follows=mode == DriveMode.POSITION)
    if taken is None or not math.isfinite(taken):
        return None
    return Reply(
        transform.joint_position(position),
        transform.joint_velocity(velocity),
        transform.joint_torque(torque),
        mode,
        fault,
        float(voltage),
        float(temperature),
        taken,
        clock.ahead,
        sensed,
    )
