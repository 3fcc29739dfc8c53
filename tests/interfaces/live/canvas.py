"""A stand-in for Meshcat that keeps what is drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from scipy.spatial.transform import Rotation


class Canvas:
    """Keeps objects, transforms and properties by path."""

    def __init__(self) -> None:
        self.objects: dict[str, tuple[Any, ...]] = {}
        self.transforms: dict[str, RigidTransform] = {}
        self.properties: dict[tuple[str, str], Any] = {}

    def SetObject(self, path, *thing):
        self.objects[path] = thing

    def SetTransform(self, path, X):
        self.transforms[path] = X

    def SetProperty(self, path, name, value):
        self.properties[path, name] = value

    def arrow(self, path: str) -> tuple[np.ndarray, np.ndarray]:
        """Start and end of an `Arrow`, (3,) each, m, as the viewer places its shaft and the point of its head."""
        X, shaft = self.transforms[path], np.array(self.properties[f"{path}/shaft", "scale"])
        head, scale = (np.array(self.properties[f"{path}/head", name]) for name in ("position", "scale"))
        cone = self.transforms[f"{path}/head/cone"]
        point = head + scale * cone.translation()  # the point of Meshcat's cone is at its origin
        rod = self.transforms[f"{path}/shaft/rod"].translation()
        length = self.objects[f"{path}/shaft/rod"][0].length()
        ends = [shaft * (rod + np.array([0, 0, sign * length / 2])) for sign in (-1, 1)]
        np.testing.assert_allclose([end[:2] for end in ends], 0.0, atol=1e-12)
        np.testing.assert_allclose([ends[0][2], ends[1][2]], [0.0, head[2]], atol=1e-12)  # the head is on the shaft
        X_W = Rotation.from_matrix(X.rotation().matrix())
        return X.translation(), X.translation() + X_W.apply(point)
