"""Why the supervisor changed its state: every transition has one of these."""

from enum import IntEnum


class Reason(IntEnum):
    """A code for the trace and a sentence for people."""

    sentence: str

    def __new__(cls, code: int, sentence: str) -> "Reason":
        """Attach the sentence to the code."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.sentence = sentence
        return member

    NONE = 0, "Nothing has happened yet."
    OPERATOR_ARMED = 1, "The operator armed the drives."
    DRIVES_READY = 2, "Both drives follow torques."
    FINISHED = 3, "The sequence is over."
    CAME_TO_REST = 4, "The joints are at rest."
    DAMPED_LONG_ENOUGH = 5, "The drives braked for the whole time that they are given."
    OPERATOR_STOP = 10, "The operator asked for a stop."
    ARMING_TOOK_TOO_LONG = 11, "A drive did not begin to follow torques in time."
    DRIVE_FAULT = 12, "A drive reports a fault."
    DRIVE_TIMEOUT = 13, "A drive's own watchdog tripped: it had no command in time."
    DRIVE_LEFT_MODE = 14, "A drive left torque control by itself, e.g. because it restarted."
    REPLIES_MISSING = 15, "A drive did not answer in several ticks."
    MEASUREMENT_NOT_FINITE = 16, "A drive reports a position, velocity or torque that is no number."
    ENCODER_JUMP = 17, "A position changed by more than its velocity allows."
    POSITION_LIMIT = 18, "A joint left its range."
    SPEED_LIMIT = 19, "A joint is faster than its motor can turn it."
    TORQUE_LIMIT = 20, "A motor gives more torque than it may."
    TOO_HOT = 21, "A drive is too hot."
    VOLTAGE_LOW = 22, "The bus voltage is too low."
    VOLTAGE_HIGH = 23, "The bus voltage is too high."
    LOOP_OVERRUN = 24, "The control loop missed several ticks in a row."
    LOOP_STALLED = 25, "The control loop stood still for longer than the drives wait."
    CONTROLLER_FAILED = 26, "The controller raised an error."
    TORQUE_NOT_FINITE = 27, "The controller asked for a torque that is no number."


FAULTS: dict[int, str] = {
    32: "calibration fault",
    33: "motor driver fault",
    34: "over-voltage",
    35: "encoder fault",
    36: "motor not configured",
    37: "control cycle overrun",
    38: "over-temperature",
    39: "start outside of its position limits",
    40: "under-voltage",
    41: "configuration changed while running",
    42: "theta invalid",
    43: "position invalid",
    44: "driver not enabled",
    45: "wrong stop position",
    46: "timing violation",
    47: "feedforward without ratio",
    48: "invalid limits",
    49: "position error too large",
    50: "velocity error too large",
}
"""Fault codes of the drives' firmware; 96 to 105 are notices that a limit acts, not faults."""


def fault_text(code: int) -> str:
    """Return a fault code with its meaning."""
    return f"fault {code} ({FAULTS.get(code, 'unknown to this version')})"
