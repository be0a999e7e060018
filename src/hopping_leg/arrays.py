"""Array types shared by all rooms."""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
"""Floats; docstrings give shape and unit."""

BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]
