"""The frames of the last ticks, newest first."""

from typing import Generic, TypeVar

import numpy as np
import numpy.typing as npt

_ROOM = 4
"""Length of the buffer over that of the window."""

T = TypeVar("T", bound=np.generic)


class RingBuffer(Generic[T]):
    """A window of frames that moves through a larger buffer, so that a tick moves no frame.

    Args:
        frames: The window at the start, newest first, (length, ...); copied.
    """

    def __init__(self, frames: npt.NDArray[T]) -> None:
        self._length = len(frames)
        shape = (_ROOM * self._length, *frames.shape[1:])
        self._buffer: npt.NDArray[T] = np.empty(shape, frames.dtype)
        self._first = len(self._buffer) - self._length
        self.frames[:] = frames

    @property
    def frames(self) -> npt.NDArray[T]:
        """The window, newest first; to be read and written in place, until the next shift."""
        return self._buffer[self._first : self._first + self._length]

    def shift(self) -> None:
        """Make room for a new frame; it holds anything, and the oldest is forgotten."""
        if self._first == 0:
            kept = self.frames[:-1].copy()
            self._first = len(self._buffer) - self._length
            self.frames[1:] = kept
        else:
            self._first -= 1
