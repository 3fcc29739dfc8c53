"""Geometry, materials, hardware presets and scenarios. Imports no other package of this project."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""An array of 64-bit floats; docstrings give the shape and the unit."""
