"""The one encoder of a drive: absolute within a turn of the rotor, relative beyond.

After power-up the firmware takes the rotor's turn nearest to zero, so the output is known only up
to whole turns of the rotor (1/6 turn of the output behind a gear of 6) until the host tells where
it is (homing).
"""

from hopping_leg.emulator.settings import Settings

_HOMED_ROTOR = 1  # Register 0x00c: known within a turn of the rotor
_HOMED_OUTPUT = 2  # Register 0x00c: the host has told where the output is
_RATIO, _SIGN = "motor_position.rotor_to_output_ratio", "motor_position.output.sign"


class RotorEncoder:
    """Position of a drive's output as its firmware knows it; ``gear_ratio`` is the true one."""

    def __init__(self, settings: Settings, gear_ratio: float) -> None:
        self.gear_ratio, self._settings = gear_ratio, settings
        self.boot(0.0)

    def boot(self, output: float) -> None:
        """Begin anew with the true output at a position, revolutions."""
        self.update(output)
        self._shift = -float(round(self._rotor))
        self.jump = 0.0  # Turns of the rotor by which the encoder errs since a fault
        self.home = _HOMED_ROTOR

    def shift_rotor(self, turns: float) -> None:
        """Err by turns of the rotor, as after power-up in another pose; homing is lost."""
        self._shift += turns
        self.home = _HOMED_ROTOR

    def update(self, output: float) -> None:
        """Set the true position of the output, revolutions."""
        self._rotor = output * self.gear_ratio

    @property
    def position(self) -> float:
        """Output as the firmware reports it, revolutions."""
        rotor, settings = self._rotor + self._shift + self.jump, self._settings
        return settings[_SIGN] * (
            rotor * settings[_RATIO] + settings["motor_position.output.offset"]
        )

    def velocity(self, output: float) -> float:
        """Return the reported velocity for a true one of the output, rev/s."""
        return self._settings[_SIGN] * output * self.gear_ratio * self._settings[_RATIO]

    def set_nearest(self, position: float) -> None:
        """Home: the output is within half a turn of the rotor of a position, revolutions."""
        turns = (position - self.position) * self._settings[_SIGN] / self._settings[_RATIO]
        self._shift += round(turns)
        self.home = _HOMED_OUTPUT

    def torque_to_output(self, torque: float) -> float:
        """Return the output's true torque when the firmware believes to give ``torque``, N m."""
        return self._settings[_SIGN] * torque * self._settings[_RATIO] * self.gear_ratio

    def torque_as_reported(self, torque: float) -> float:
        """Return what the firmware reports for a true torque of the output, N m."""
        return self._settings[_SIGN] * torque / (self._settings[_RATIO] * self.gear_ratio)
