"""The local model of the contact: what the simulation tells the servo after each of its steps.

It is an intermediate representation (Adachi et al. 1995, Mark et al. 1996): the motion of the peg, and one-sided
springs that stand for the contacts of rigid bodies or for the faces of contact surfaces. Between two messages the servo
simulates the peg against it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from models.exact_geometry import MAX_CONTACTS
from skill.arrays import Array
from systems.math.rotation import from_rotation_vector, rotation_vector
from systems.plant.contact_forces import FACE_NORMAL

SECTORS, LAYERS = 8, 2
"""Faces are joined that push in the same of eight directions, in the same of two halves of the contact's height."""

QUADRANTS = 4
"""Faces that push along the axis are joined in each quadrant."""

MAX_JOINED = SECTORS * LAYERS + 2 * QUADRANTS
"""Springs at most that stand for faces."""

MAX_SPRINGS = max(MAX_JOINED, MAX_CONTACTS)
"""Springs of a model at most."""

HEADER = 14  # numbers before the springs: number of springs, time, pose, velocity
SPRING = 8  # numbers of a spring


@dataclass(frozen=True)
class Springs:
    """One-sided springs between the peg and the block, n of them; friction acts at each.

    Attributes:
        points: (n, 3), in H, m.
        normals: (n, 3), unit vectors in H, in which the block pushes the peg.
        stiffnesses: (n,), N/m.
        forces: (n,), elastic forces at the pose of the model, N; a negative one is a gap times the stiffness.
    """

    points: Array
    normals: Array
    stiffnesses: Array
    forces: Array

    @classmethod
    def none(cls) -> Springs:
        """Returns no springs."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0))

    def joined(self) -> Springs:
        """Returns at most `MAX_JOINED` springs, which stand for groups of these.

        A group has the sum of the stiffnesses and forces, and the means of the points and normals by stiffness.
        """
        if not len(self.forces):
            return self
        x, y, z = self.points.T
        layer = np.minimum(LAYERS * (z - z.min()) / (np.ptp(z) + 1e-9), LAYERS - 1).astype(int)
        sector = _part(self.normals[:, 0], self.normals[:, 1], SECTORS)
        quadrant = _part(x, y, QUADRANTS)
        axial = np.abs(self.normals[:, 2]) > FACE_NORMAL
        upward = (self.normals[:, 2] > 0).astype(int)
        keys = np.where(axial, SECTORS * LAYERS + upward * QUADRANTS + quadrant, layer * SECTORS + sector)
        _, group = np.unique(keys, return_inverse=True)
        weights = np.zeros((group.max() + 1, len(keys)))
        weights[group, np.arange(len(keys))] = 1.0
        stiffnesses, weighted = weights @ self.stiffnesses, weights * self.stiffnesses
        normals = weighted @ self.normals
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        return Springs(weighted @ self.points / stiffnesses[:, None], normals, stiffnesses, weights @ self.forces)


@dataclass(frozen=True)
class LocalContact:
    """The local model of the contact.

    Attributes:
        time: of the servo, to which the motion belongs, s.
        X_HP: pose of the peg.
        V_HP: (6,), [angular velocity; velocity] of the peg in H, rad/s and m/s.
        springs: at most `MAX_SPRINGS`.
    """

    time: float
    X_HP: RigidTransform
    V_HP: Array
    springs: Springs

    SIZE = HEADER + SPRING * MAX_SPRINGS
    """Length of `as_vector`."""

    def as_vector(self) -> Array:
        """Returns (SIZE,), the numbers of the model; `from_vector` inverts it."""
        found = np.zeros(self.SIZE)
        s, n = self.springs, len(self.springs.forces)
        pose = [*self.X_HP.translation(), *rotation_vector(self.X_HP.rotation())]
        found[:HEADER] = [n, self.time, *pose, *self.V_HP]
        rows = np.column_stack([s.points, s.normals, s.stiffnesses, s.forces])
        found[HEADER : HEADER + SPRING * n] = rows.ravel()
        return found

    @classmethod
    def from_vector(cls, values: Array) -> LocalContact:
        """Returns the model of a vector that `as_vector` has returned."""
        n = int(values[0])
        rows = values[HEADER : HEADER + SPRING * n].reshape(n, SPRING)
        X_HP = RigidTransform(from_rotation_vector(values[5:8]), values[2:5])
        springs = Springs(rows[:, :3].copy(), rows[:, 3:6].copy(), rows[:, 6].copy(), rows[:, 7].copy())
        return cls(float(values[1]), X_HP, values[8:14].copy(), springs)


def _part(x: Array, y: Array, number: int) -> Array:
    """Which of ``number`` equal parts of the circle the directions (x, y) are in."""
    found: Array = (np.arctan2(y, x) / (2.0 * math.pi) % 1.0 * number).astype(int) % number
    return found
