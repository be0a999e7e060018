"""From a commanded to the joint's torque as ``[reality]`` has it, once per physics step.

    command -> latency, jitter -> software and battery limit -> gain -> lag  = motor torque
    motor torque -> ripple -> gear loss                                      = torque at the joint

All of it is a handful of array operations. MuJoCo's actuator delay and filter would do for latency
and lag alone, but jitter draws each command's delay anew, and gain, ripple and loss come after the
lag and need the motor's angle and speed.
"""

from collections.abc import Sequence

import numpy as np

from hopping_leg.arrays import Array, IntArray
from hopping_leg.robot import MotorLimit, Robot
from hopping_leg.sim.mismatch_model import true_parameters

_REST = 0.1
"""Joint speed below which the gear's loss fades, as power has no direction at rest, rad/s."""


class MotorEffects:
    """Both drives of n legs, whose ``reality`` holds.

    Latency and jitter are rounded to the physics step ``timestep``, s; ``substeps`` of them make a
    control period.
    """

    def __init__(self, robots: Sequence[Robot], timestep: float, substeps: int) -> None:
        count = len(robots)
        self._timestep, self._substeps = timestep, substeps
        self._line = np.zeros((substeps, count, 2))
        self._number = np.zeros((substeps, count))
        self._taken, self._wanted = np.zeros(count), np.zeros((count, 2))
        self.motor_torque = np.zeros((count, 2))
        """What the motors give, N m at the joint, (n, 2); their current shows it."""
        self._command = 0.0
        self.set_robots(robots)

    def set_robots(self, robots: Sequence[Robot]) -> None:
        """Go on as the drives of other robots; commands under way stay under way."""
        realities = [robot.reality for robot in robots]
        self._limit = MotorLimit([true_parameters(robot) for robot in robots])
        latencies = [(r.latency.command, r.latency.jitter) for r in realities]
        self._late, self._jitter = np.round(np.array(latencies).T / self._timestep)
        self._look_ahead(self._substeps + int((self._late + self._jitter).max()))

        def of_drives(attribute: str) -> Array:
            return np.array([reality.of_drives(attribute) for reality in realities])

        self._gain = of_drives("torque_gain")
        lag = of_drives("torque_lag")
        self._lagging = bool(lag.any())
        self._follow = -np.expm1(-self._timestep / np.maximum(lag, 1e-12))
        self._ripple, self._periods = of_drives("ripple"), of_drives("ripple_periods")
        self._efficiency = of_drives("efficiency")

    def _look_ahead(self, steps: int) -> None:
        """Make room for commands that arrive so many physics steps from now."""
        more = max(0, steps - len(self._line))
        self._line = np.concatenate([self._line, np.repeat(self._line[-1:], more, axis=0)])
        self._number = np.concatenate([self._number, np.repeat(self._number[-1:], more, axis=0)])
        self._offset = np.arange(len(self._line))[:, None]

    def forget(self, rows: IntArray) -> None:
        """Drop the commands under way of some legs; their motors give nothing."""
        self._line[:, rows] = self._number[:, rows] = 0
        self._taken[rows] = self._wanted[rows] = self.motor_torque[rows] = 0

    def take(self, torque: Array, jitter: Array) -> None:
        """Take the controller's command, N m, (n, 2), at the start of a control period.

        It replaces all that would arrive after it, so that none overtakes another. ``jitter`` is
        the share of the jitter by which it is late, [0, 1), (n,).
        """
        keep, rest = self._line[self._substeps :], self._line[-1:]
        numbers, last = self._number[self._substeps :], self._number[-1:]
        self._line = np.concatenate([keep, np.repeat(rest, self._substeps, axis=0)])
        self._number = np.concatenate([numbers, np.repeat(last, self._substeps, axis=0)])
        arrival = self._late + np.floor(jitter * (self._jitter + 1))
        after = self._offset >= arrival
        self._command += 1
        np.copyto(self._line, torque, where=after[..., None])
        np.copyto(self._number, self._command, where=after)

    def torque(self, substep: int, q: Array, qd: Array) -> Array:
        """Return the torque at the joints during a physics step of a control period, N m, (n, 2).

        ``q``, rad, and ``qd``, rad/s, are the motors' at the joints' side, (n, 2). As in the
        simulator for training, the limit holds for the speed at which a command arrives.
        """
        arrived = self._number[substep] != self._taken
        if arrived.any():
            self._taken = self._number[substep].copy()
            limited = self._limit.give(self._line[substep], qd)
            self._wanted = np.where(arrived[:, None], limited, self._wanted)
        target = self._gain * self._wanted
        if self._lagging:
            target = self.motor_torque + self._follow * (target - self.motor_torque)
        self.motor_torque[:] = target
        torque = target
        if self._ripple.any():
            torque = torque + self._ripple * np.sin(self._periods * q)
        if (self._efficiency < 1).any():
            torque = torque * self._efficiency ** np.tanh(np.sign(torque) * qd / _REST)
        return torque

    def memory(self) -> dict[str, Array]:
        """Return everything needed to go on exactly from here."""
        return {
            "line": self._line.copy(),
            "number": self._number.copy(),
            "taken": self._taken.copy(),
            "wanted": self._wanted.copy(),
            "motor_torque": self.motor_torque.copy(),
            "command": np.array(self._command),
        }

    def restore(self, memory: dict[str, Array]) -> None:
        """Go on from a ``memory``."""
        self._line, self._number = memory["line"].copy(), memory["number"].copy()
        self._taken, self._wanted = memory["taken"].copy(), memory["wanted"].copy()
        self.motor_torque[:] = memory["motor_torque"]
        self._command = float(memory["command"])
