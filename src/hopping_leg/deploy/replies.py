"""From a frame of a drive to a dated reply at the joint."""

import math
import threading
from typing import Any

from moteus.protocol import Register, parse_reply

from hopping_leg.deploy.drive_clock import DriveClock
from hopping_leg.deploy.drive_link import Exchange, Reply
from hopping_leg.deploy.joint_transform import JointTransform


class Question:
    """One tick's question to both drives; frames are judged the moment they arrive.

    Lives between two threads: the client's puts frames in, the loop's waits for ``done``.

    Args:
        transforms: Of both joints.
        clocks: Of both drives; shared from tick to tick.
        asked: When it leaves, s.
    """

    def __init__(
        self,
        transforms: tuple[JointTransform, JointTransform],
        clocks: tuple[DriveClock, ...],
        asked: float,
    ) -> None:
        self._transforms, self._clocks, self._asked = transforms, clocks, asked
        self._fresh: list[Reply | None] = [None, None]
        self._late: list[tuple[int, Reply]] = []
        self.done = threading.Event()

    def take(self, joint: int, frame: Any, now: float) -> bool:  # noqa: ANN401
        """Judge a frame; return whether it answers this question.

        Args:
            joint: 0 for the hip, 1 for the knee.
            frame: Of the client library.
            now: When it arrived, s.
        """
        if self._fresh[joint] is not None:
            return False
        reply = read_reply(frame.data, self._transforms[joint], self._clocks[joint], now)
        if reply is None:
            return False
        if not DriveClock.fresh(reply.taken, self._asked):
            self._late.append((joint, reply))
            return False
        self._fresh[joint] = reply
        if None not in self._fresh:
            self.done.set()
        return True

    def result(self) -> Exchange:
        """Return what has come so far."""
        hip, knee = self._fresh
        return Exchange((hip, knee), tuple(self._late))


def read_reply(
    data: bytes, transform: JointTransform, clock: DriveClock, now: float
) -> Reply | None:
    """Return the state that a frame reports.

    Args:
        data: The frame's payload.
        transform: Of the joint.
        clock: Of the drive.
        now: When the frame arrived, s.

    Returns:
        None for a frame that lacks something, makes no sense, or was seen before.
    """
    try:
        values = parse_reply(data)
        counter = values[Register.MILLISECOND_COUNTER]
        mode, fault = int(values[Register.MODE]), int(values[Register.FAULT])
        position, velocity = values[Register.POSITION], values[Register.VELOCITY]
        torque, voltage = values[Register.TORQUE], values[Register.VOLTAGE]
        temperature = values[Register.TEMPERATURE]
    except Exception:
        # The client's parser raises many types on damaged frames, all derived from Exception only.
        return None
    taken = clock.date(int(counter), now)
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
    )
