"""How the robot's drives are wired and what they may do; a robot file's table ``[hardware]``.

Nothing of it changes the physics, so that it is no part of a robot's digest. Every number may be
left out; the defaults are leg V2's: mjbots qdd100 at 24 V, hip 1, knee 2.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Literal

from hopping_leg.errors import RobotError, unknown_name
from hopping_leg.io import quantity

REGISTER_MAP = 5  # Version of the drives' register map that this package speaks (register 0x102)


@dataclass(frozen=True)
class Servo:
    """One joint's drive; angles are the joint's, behind gear and belt."""

    id: float = quantity("1", math.nan)
    """CAN id; by default 1 at the hip, 2 at the knee."""
    sign: float = quantity("1", 1.0, signed=True)
    """1 where the motor turns with the joint, -1 where it turns against it."""
    zero_offset: float = quantity("rad", 0.0, signed=True)
    """Joint angle at which the motor reads zero."""
    max_current: float = quantity("A", 100.0)
    """Phase current that the drive is configured for (``servo.max_current_A``)."""
    torque_constant: float = quantity("N m/A", 0.0788)
    """Torque at the rotor per ampere of a phase's peak; by default what moteus' formula
    1.5/sqrt(3) 60/(2 pi K_v) gives for the qdd100's 105 rpm/V."""
    winding_resistance: float = quantity("ohm", 0.150)
    """Of one phase; by default what moteus' motor models (``utils/extrapolated_motor_models.py``)
    state as measured of the qdd100's stator wound for 135 rpm/V, 0.091 ohm, with the same copper
    for 105 rpm/V: times (135/105)^2."""
    thermal_time_constant: float = quantity("s", 578.0)
    """Of drive and motor as one lump; by default 2.74 K/W times 210.9 J/K, of the same models."""
    serial: str = ""
    """Serial number of the drive's controller, 24 hex digits; empty accepts any."""


_INPUTS = [f"aux{port}_analog_in{pin}" for port in (1, 2) for pin in range(1, 6)]
SENSOR_REGISTERS = ("encoder_1_position", "encoder_2_position", *_INPUTS)
"""Registers of a drive that a sensor at its auxiliary ports fills, by the client's names."""


@dataclass(frozen=True)
class HeightSensor:
    """What measures the base height, which is recorded; nothing else depends on it.

    height = offset + scale (reading - zero)             beside the rail
    height = offset + radius sin(angle (reading - zero))   in the pivot of a boom
    """

    source: str = ""
    """One of ``SENSOR_REGISTERS``, in turns or shares of the drive's 3.3 V, or the path of a serial
    line on which every line begins with a number; empty without a sensor."""
    drive: Literal["hip", "knee"] = "hip"
    """Whose auxiliary port it is."""
    baud: float = quantity("Bd", 115_200.0)
    """Of a serial line."""
    zero: float = quantity("1", 0.0, signed=True)
    """Reading at the height ``offset``."""
    offset: float = quantity("m", 0.0, signed=True)
    """Height of the hip axis at ``zero``, with a boom that of its pivot."""
    scale: float = quantity("m", 1.0, signed=True)
    """Rise per unit of the reading, without a boom."""
    angle: float = quantity("rad", math.tau, signed=True)
    """Rise of a boom per unit of the reading."""
    radius: float = quantity("m", 0.0, zero=True)
    """Of a boom, from its pivot to the hip axis; zero without one."""

    def __post_init__(self) -> None:
        if self.source and "/" not in self.source and self.source not in SENSOR_REGISTERS:
            known = unknown_name("height sensor", self.source, SENSOR_REGISTERS)
            raise RobotError(f"'hardware.height.source': {known} Or give a serial line's path.")
        if not self.scale * self.angle:
            raise RobotError("'hardware.height.scale' and its 'angle' must not be zero.")

    def height(self, reading: float) -> float:
        """Return the base height, m, of a reading; NaN for one that is no number."""
        above = reading - self.zero if math.isfinite(reading) else math.nan
        if self.source.startswith("encoder"):  # which does not count turns
            above = math.remainder(above, 1.0)
        rise = self.radius * math.sin(self.angle * above) if self.radius else self.scale * above
        return self.offset + rise

    def reading(self, height: float) -> float:
        """Return what it reads at a base height, m."""
        rise, far = height - self.offset, self.radius
        angle = math.asin(max(-1.0, min(1.0, rise / far))) if far else 0.0
        return self.zero + (angle / self.angle if far else rise / self.scale)


@dataclass(frozen=True)
class Hardware:
    """Both drives and what they share."""

    hip: Servo = field(default_factory=Servo)
    knee: Servo = field(default_factory=Servo)
    height: HeightSensor = field(default_factory=HeightSensor)
    watchdog: float = quantity("s", 0.02)
    """Time without a command after which a drive brakes by itself: four ticks at 200 Hz."""
    voltage_low: float = quantity("V", 18.0)
    """Bus voltage below which the leg does not run."""
    voltage_high: float = quantity("V", 42.0)
    """Bus voltage above which the leg does not run; the drives trip at 46 V."""
    bus_voltage: float = quantity("V", 26.0)
    """Usual bus voltage: that at which the qdd100 has its no-load speed in the robot files."""
    bus_capacitance: float = quantity("F", 4e-3)
    """Capacitance of the bus; by default the most that mjbots' power distributor may precharge."""
    temperature_limit: float = quantity("deg C", 65.0)
    """Highest temperature of the drives' electronics; they derate from 50 and trip at 75."""
    fallback: str = "energy-shaping"
    """Controller that takes over where a policy cannot go on; empty lets the drives brake."""

    def __post_init__(self) -> None:
        for name, default_id in (("hip", 1.0), ("knee", 2.0)):
            servo: Servo = getattr(self, name)
            if math.isnan(servo.id):
                object.__setattr__(self, name, replace(servo, id=default_id))

    @property
    def servos(self) -> tuple[Servo, Servo]:
        """Hip and knee."""
        return self.hip, self.knee


def torque_constant(speed_constant: float) -> float:
    """Return the torque constant, N m/A, for a speed constant, rad/(s V), or the other way."""
    return 1.5 / math.sqrt(3) / speed_constant
