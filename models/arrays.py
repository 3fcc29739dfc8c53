"""Defines the array type of this package."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""An array of 64-bit floats; docstrings give the shape and the unit."""
