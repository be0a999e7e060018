"""The soft limits' PD, which simulation, emulator and deployment add to the controller's torque."""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.robot import Robot, SoftLimits
from hopping_leg.sim.compiled import compiled


class SoftLimiter:
    """Adds the soft limits' PD to the joint torques of a robot's controller."""

    def __init__(self, robot: Robot, soft: SoftLimits) -> None:
        self._bounds = np.stack([robot.of_joints("lower"), robot.of_joints("upper")], axis=1)
        self._gains = np.array([soft.stiffness, soft.damping, soft.inset, float(soft.replace)])
        self.added(np.zeros((1, 2)), np.zeros((1, 1, 4)))  # compiled before any control loop

    def added(self, torque: Array, samples: Array) -> Array:
        """Return what to add to a controller's torque, N m, (n, 2).

        Samples are (q1, q2, qd1, qd2, ...), rad and rad/s, newest first, (n, k, 4 or more); the
        newest counts. Nothing is added where a joint is within bounds. The sum is then limited as
        any torque is.
        """
        added = np.zeros((len(samples), 2))
        asked = np.ascontiguousarray(torque, np.float64)
        _add(added, asked, np.ascontiguousarray(samples, np.float64), self._bounds, self._gains)
        return added


@compiled
def _add(added: Array, torque: Array, samples: Array, bounds: Array, gains: Array) -> None:
    stiffness, damping, inset, replace = gains
    for leg in range(len(samples)):
        for joint in range(2):
            angle, speed = samples[leg, 0, joint], samples[leg, 0, 2 + joint]
            back = min(max(angle, bounds[joint, 0]), bounds[joint, 1]) - angle
            if back != 0.0:
                back += inset if back > 0.0 else -inset
                pull = stiffness * back - damping * speed
                added[leg, joint] = pull - replace * torque[leg, joint]
