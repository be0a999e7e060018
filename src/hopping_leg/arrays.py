"""Array types shared by all rooms."""

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]  # Floats; docstrings give shape and unit

Array32 = npt.NDArray[np.float32]  # Single precision: what policies see and answer

BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]

Records = npt.NDArray[np.void]  # A structured array: a record per leg

Record = Any  # One of them; in compiled code its fields are attributes
