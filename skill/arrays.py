"""The array type of `skill` and of the packages that use it."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""An array of 64-bit floats; docstrings give shape and unit."""
