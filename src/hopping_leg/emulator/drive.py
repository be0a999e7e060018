"""One drive: registers in, torque out, one step of physics at a time.

Time comes as an argument; between two steps nothing changes but the command registers.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from moteus.multiplex import F32
from moteus.protocol import Register, scale_register

from hopping_leg.deploy.drive_link import DriveMode, FaultCode
from hopping_leg.emulator import mode_machine, rotor_encoder, torque_law
from hopping_leg.emulator.settings import Console, Settings

_AMBIENT = 30.0  # Temperature of the output stage, degrees C
_LOWEST_VOLTAGE = 4.0  # Below it the firmware reports under-voltage, V


@dataclass
class Disturbances:
    """What faults do to a drive; see ``faults``."""

    voltage: float = 0.0
    """Added to the bus voltage, V."""
    temperature: float = 0.0
    """Added to the output stage's temperature, K."""
    notice: int = 0
    """Limit notice shown whatever happens."""
    fault: int = 0
    """FaultCode code that comes up as soon as the drive is powered."""
    clock: float = 1.0
    """Seconds that its clock counts in one."""
    report: Callable[[dict[int, float]], dict[int, float]] = lambda registers: registers
    """What it says of its true registers."""


class EmulatedDrive:
    """A moteus controller on a geared motor.

    ``identity`` are the registers that tell what it was made with. The gear ratio is the true one,
    ``brake`` the output's damping with the phases shorted, N m s/rad, the voltage the bus's, V.
    """

    def __init__(
        self,
        identity: Mapping[int, int],
        settings: Settings,
        *,
        gear_ratio: float,
        brake: float,
        voltage: float,
    ) -> None:
        self.identity, self.settings = identity, settings
        self.encoder = rotor_encoder.RotorEncoder(settings, gear_ratio)
        self.console = Console(settings)
        self.machine = mode_machine.ModeMachine()
        self.law = torque_law.TorqueLaw(settings)
        self.command = dict(torque_law.NEW_COMMAND)
        self.disturbances = Disturbances()
        self.uptime = 0.0
        self.sensed: dict[int, float] = {}  # What its auxiliary ports read, by register
        self._brake, self.nominal_voltage = brake * 2 * math.pi, voltage
        self._asked: DriveMode | None = None  # by a frame that is not yet read to its end
        self._velocity = self._torque = 0.0

    @property
    def id(self) -> int:
        """Address on the bus."""
        return int(self.settings["id.id"])

    @property
    def voltage(self) -> float:
        """Bus voltage, V."""
        return self.nominal_voltage + self.disturbances.voltage

    @property
    def temperature(self) -> float:
        """Temperature of the output stage, degrees C."""
        return _AMBIENT + self.disturbances.temperature

    @property
    def active(self) -> bool:
        """Whether the output stage is powered."""
        return self.machine.mode in mode_machine.CONTROLLING

    def boot(self, output: float) -> None:
        """Power up with the output at a true position, revolutions."""
        self.settings.load()
        self.encoder.boot(output)
        self.machine, self.command = mode_machine.ModeMachine(), dict(torque_law.NEW_COMMAND)
        self.uptime = 0.0

    def write(self, register: int, resolution: int, value: float) -> None:
        """Take one register from the host; one that cannot be written stays as it is."""
        scaled = value if resolution == F32 else scale_register(register, resolution, value)
        if register == Register.MODE and scaled in mode_machine.MODES:
            self.command, self._asked = dict(torque_law.NEW_COMMAND), DriveMode(int(scaled))
        elif register in self.command:
            self.command[register] = float(scaled)
        elif register == Register.SET_OUTPUT_NEAREST and math.isfinite(scaled):
            self.encoder.set_nearest(float(scaled))

    def commit(self, time: float) -> None:
        """Act on a frame's mode write, once all its registers are written."""
        if self._asked is not None:
            timeout = self.command[Register.COMMAND_TIMEOUT]
            timeout = timeout or self.settings["servo.default_timeout_s"]
            self.machine.command(self._asked, time, timeout / self.disturbances.clock)
            self._asked = None

    def update_sensors(self, output: float, velocity: float, torque: float) -> None:
        """Set what the sensors see of the output after a step of physics: rev, rev/s, N m."""
        self.encoder.update(output)
        self._velocity = self.encoder.velocity(velocity)
        self._torque = torque if self.active else 0.0

    def step(self, time: float, dt: float) -> float:
        """Begin one step of physics; return the torque asked of the motor's output, N m, finite."""
        self.uptime += dt * self.disturbances.clock
        position, settings = self.encoder.position, self.settings
        low, high = settings["servopos.position_min"], settings["servopos.position_max"]
        self.machine.advance(time, outside_limits=position < low or position > high)
        self._check()
        self.law.notice = 0
        wanted = self._control(position)
        if self.active:
            self.machine.fault = self.disturbances.notice or self.law.notice
        if math.isnan(wanted):
            self.machine.fault = mode_machine.Notice.MAX_VOLTAGE
            return 0.0
        return self.encoder.torque_to_output(wanted)

    def _control(self, position: float) -> float:
        mode: int = self.machine.mode
        if mode == DriveMode.TIMEOUT:
            mode = int(self.settings["servo.timeout_mode"])
            mode = DriveMode.ZERO_VELOCITY if mode == DriveMode.POSITION else mode
        if mode == DriveMode.POSITION:
            torque = self.law.position(self.command, position, self._velocity)
        elif mode == DriveMode.ZERO_VELOCITY:
            torque = self.law.zero_velocity(self.command[Register.COMMAND_KD_SCALE], self._velocity)
        else:
            return -self._brake * self._velocity if mode == DriveMode.BRAKE else 0.0
        return self.law.limited(torque, position)

    def _check(self) -> None:
        """Go to fault where the firmware would."""
        machine = self.machine
        if self.disturbances.fault:
            machine.trip(self.disturbances.fault)
        if self.voltage > self.settings["servo.max_voltage"]:
            machine.trip(FaultCode.OVER_VOLTAGE)
        if self.voltage < _LOWEST_VOLTAGE:
            machine.trip(FaultCode.UNDER_VOLTAGE)
        if self.temperature > self.settings["servo.fault_temperature"]:
            machine.trip(FaultCode.OVER_TEMPERATURE)

    def state(self) -> dict[int, float]:
        """Return what the drive says of how it is, in its units."""
        return self.disturbances.report(self.true_state())

    def true_state(self) -> dict[int, float]:
        """Return the registers that tell how the drive is, in its units."""
        return {
            Register.MODE: self.machine.mode,
            Register.POSITION: self.encoder.position,
            Register.VELOCITY: self._velocity,
            Register.TORQUE: self.encoder.torque_as_reported(self._torque),
            Register.HOME_STATE: self.encoder.home,
            Register.VOLTAGE: self.voltage,
            Register.TEMPERATURE: self.temperature,
            Register.FAULT: self.machine.fault,
            Register.MILLISECOND_COUNTER: int(self.uptime * 1000),
            Register.MULTIPLEX_ID: self.id,
            **self.sensed,
        }
