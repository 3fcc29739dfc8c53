"""Converts rotations to rotation vectors (axis times angle) and back; regular below 180 degrees."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydrake.common.eigen_geometry import AngleAxis, Quaternion
from pydrake.math import RigidTransform, RotationMatrix


def rotation_vector(R: RotationMatrix) -> NDArray[np.float64]:
    """Returns the rotation vector (3,) of ``R``: unit axis times angle (rad), with the angle in [0, pi]."""
    q = R.ToQuaternion()
    v, w = np.asarray(q.xyz()), q.w()
    if w < 0:
        v, w = -v, -w
    sine = math.sqrt(v @ v)
    # As s tends to zero, 2 atan2(s, w) / s tends to 2/w; the quotient itself would lose precision.
    factor = 2.0 * math.atan2(sine, w) / sine if sine > 1e-9 else 2.0 / w
    return v * factor


def from_rotation_vector(vector: NDArray[np.float64]) -> RotationMatrix:
    """Returns the rotation of a rotation vector (3,), rad; the inverse of `rotation_vector`."""
    angle = math.sqrt(vector @ vector)
    if angle < 1e-12:
        return RotationMatrix()
    return RotationMatrix(AngleAxis(angle, np.asarray(vector) / angle))


def cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the cross product of two 3-vectors; for single vectors several times faster than ``numpy.cross``."""
    (a0, a1, a2), (b0, b1, b2) = a, b
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def rotation_between(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the shortest rotation vector (3,), rad, that turns the unit vector ``a`` onto the unit vector ``b``.

    For opposite vectors this is half a turn about an axis normal to both, one of many.
    """
    normal, cosine = cross(a, b), float(a @ b)
    sine = math.sqrt(normal @ normal)
    if sine < 1e-12:
        return normal if cosine > 0.0 else _normal_to(a) * math.pi
    if cosine < 0.0:
        # Near half a turn the cross product is mostly rounding error. The axis must stay normal to a - b.
        difference = a - b
        normal = normal - difference * (float(normal @ difference) / float(difference @ difference))
        return normal * (math.atan2(sine, cosine) / math.sqrt(normal @ normal))
    return normal * (math.atan2(sine, cosine) / sine)


def clocking_angle(R: RotationMatrix) -> float:
    """Returns the angle (rad) by which a rotation turns a body about its own z axis, beyond the shortest tilt of z.

    It is that of the parts of the two rotation vectors along z, which are equal up to the third order in the angles.
    """
    axis = R.col(2)
    tilt = rotation_between(np.array([0.0, 0.0, 1.0]), axis)
    return float((rotation_vector(R) - tilt) @ axis)


def _normal_to(a: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns a unit vector (3,) normal to the unit vector ``a``."""
    normal = cross(a, np.eye(3)[int(np.abs(a).argmin())])
    return normal / math.sqrt(normal @ normal)


def free_body_pose(q: NDArray[np.float64]) -> RigidTransform:
    """Returns the pose of a free body.

    Args:
        q: Positions (7,) of a quaternion floating joint: quaternion (w, x, y, z), not necessarily normalised, and
            position (m).
    """
    quaternion, position = q[:4], q[4:]
    norm = math.sqrt(quaternion @ quaternion)
    return RigidTransform(RotationMatrix(Quaternion(quaternion / norm)), position)
