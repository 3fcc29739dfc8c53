"""The frame of a person in front of the cutaway, and the pose of the hand as that person describes it."""

from __future__ import annotations

import math

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from skill.arrays import Array
from systems.math.rotation import from_rotation_vector
from systems.operators.simulated_operator import seen_misalignment

R_HV = RotationMatrix.MakeZRotation(math.radians(135.0))
"""Rotation of frame V of the person: x to the right, y away, z up."""


def hand_pose(coordinates: Array) -> RigidTransform:
    """Returns X_HD of a hand.

    Args:
        coordinates: depth along the axis, tilt to the right, tilt away, offset to the right, offset away (5,), in m
            and rad.
    """
    depth, right, away, *offset = coordinates
    R_HD = from_rotation_vector(R_HV @ np.array([-away, right, 0.0]))
    return RigidTransform(R_HD, R_HV @ np.array([*offset, 0.0]) - depth * R_HD.col(2))


def hand_coordinates(X_HD: RigidTransform) -> Array:
    """Returns the coordinates (5,) of a pose X_HD without spin; the inverse of `hand_pose`."""
    tilt, offset = (R_HV.inverse() @ np.array([*xy, 0.0]) for xy in seen_misalignment(X_HD))
    reach = X_HD.translation() - R_HV @ offset
    return np.array([-(reach @ X_HD.rotation().col(2)), tilt[1], -tilt[0], *offset[:2]])
