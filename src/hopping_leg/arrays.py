"""Array types shared by all rooms, and what remembers arrays from tick to tick."""

import copy
from operator import attrgetter
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]  # Floats; docstrings give shape and unit

Array32 = npt.NDArray[np.float32]  # Single precision: what policies see and answer

BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]

Records = npt.NDArray[np.void]  # A structured array: a record per leg

Record = Any  # One of them; in compiled code its fields are attributes


class Stateful:
    """What goes on exactly where it was, given the attributes that it names in ``STATE``.

    They are arrays, plain values, random generators, modules and optimisers of torch, or have a
    ``state`` of their own.
    """

    STATE: ClassVar[tuple[str, ...]] = ()

    def state(self) -> dict[str, Any]:
        """Return what is remembered from tick to tick, as arrays and plain values."""
        return {name: _state_of(attrgetter(name)(self)) for name in self.STATE}

    def restore(self, state: dict[str, Any]) -> Any:  # noqa: ANN401
        """Go on from a ``state``."""
        for name in self.STATE:
            value, past = attrgetter(name)(self), state[name]
            if hasattr(value, "load_state_dict"):
                value.load_state_dict(past)
            elif hasattr(value, "set_state"):  # torch's generators
                value.set_state(past)
            elif isinstance(value, np.random.Generator):
                value.bit_generator.state = past
            elif hasattr(value, "restore"):
                value.restore(past)
            elif hasattr(value, "copy_"):  # tensors, which optimisers hold
                value.data.copy_(past)
            else:
                known = np.array(past) if hasattr(past, "__array__") else copy.deepcopy(past)
                setattr(self, name, known)


def _state_of(value: Any) -> Any:  # noqa: ANN401
    if hasattr(value, "state_dict"):
        return value.state_dict()
    if hasattr(value, "get_state"):
        return value.get_state()
    if isinstance(value, np.random.Generator):
        return value.bit_generator.state
    return value.state() if hasattr(value, "state") else copy.deepcopy(value)
