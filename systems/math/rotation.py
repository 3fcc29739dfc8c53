"""Rotation vectors: the logarithm of a rotation, without a singularity below 180 degrees."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RotationMatrix


def rotation_vector(R: RotationMatrix) -> NDArray[np.float64]:
    """Axis times angle (rad), angle in [0, pi]."""
    q = R.ToQuaternion()
    v, w = np.asarray(q.xyz()), q.w()
    if w < 0:
        v, w = -v, -w
    sine = math.sqrt(v @ v)
    # Near zero 2 atan2(s, w) / s tends to 2/w; the quotient would lose digits.
    factor = 2.0 * math.atan2(sine, w) / sine if sine > 1e-9 else 2.0 / w
    return v * factor


def from_rotation_vector(vector: NDArray[np.float64]) -> RotationMatrix:
    """The inverse of `rotation_vector`."""
    angle = math.sqrt(vector @ vector)
    if angle < 1e-12:
        return RotationMatrix()
    return RotationMatrix(AngleAxis(angle, np.asarray(vector) / angle))


def cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vector product of two 3-vectors; several times faster for these than numpy's, in inner loops."""
    (a0, a1, a2), (b0, b1, b2) = a, b
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def rotation_between(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """The shortest rotation vector that turns unit vector ``a`` onto unit vector ``b``."""
    normal = cross(a, b)
    sine = math.sqrt(normal @ normal)
    if sine < 1e-12:
        return normal
    return normal * (math.atan2(sine, float(a @ b)) / sine)
