"""Features of the measured wrench and depth, and the frame in which actions are learnt.

The rig measures seven numbers (``MEASURED``). Each transformer turns them into features of order one:

* `RawFeatures`: the measurements over fixed physical scales; no invariance.
* `NormalisedFeatures`: the direction of the wrench, separate from its magnitude. A contact of a given geometry has the
  same direction for any stiffness of the walls and any pushing force.
* `CanonicalFeatures`: the normalised features, turned about the peg axis so that the lateral force points along +x.
  Peg and hole are bodies of revolution. A contact that is turned about the axis therefore needs the same action, turned
  likewise. Both become one sample, which multiplies the demonstrations.
* `skill.features.contact_features.ContactFeatures`: the forces at the tip and at the mouth.

Planar actions are learnt in the frame of the features: ``actions_to_frame`` turns demonstrated actions into this frame,
and ``actions_from_frame`` turns learnt actions back.
"""

from __future__ import annotations

import math
from abc import ABCMeta, abstractmethod
from typing import ClassVar, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator

from compiled import compiled
from skill.arrays import Array
from skill.data.geometry import PegHoleGeometry
from skill.features.canonical_frame import canonical_angle, canonical_angles, turned, turned_rows
from skill.features.measurement import MEASURED

HIDDEN = ("x", "y", "rotation_x", "rotation_y", "rotation_z", "dangle")
"""What only demonstrations contain: the lateral position of the tip, the rotation vector of R_HP, the rotation step."""

POSE = ("x", "y", "ax", "ay", "az", "angle", "dangle")
"""The channels from which the hidden features are computed."""

STEPPER_STEP = float(np.deg2rad(0.18))
"""One full step of the motors of the rig, rad; the unit of the rotation from one sample to the next."""


class WrenchFeatures(BaseEstimator, metaclass=ABCMeta):
    """Base class of the transformers of the measured wrench and depth.

    The transformers are stateless: there is nothing to fit. All parameters are positive numbers in SI units.
    """

    names: ClassVar[tuple[str, ...]]
    """Names of the k features."""

    hidden_names: ClassVar[tuple[str, ...]]
    """Names of the h features that only demonstrations contain."""

    def transform(self, X: ArrayLike) -> Array:
        """Features of measurements.

        Args:
            X: (n, 7), the channels ``MEASURED`` in this order, SI units; or a DataFrame with these columns in any
                order.

        Returns:
            (n, k), of order one; `names` are those of the columns.

        Raises:
            ValueError: if the shape is wrong or a number is not finite.
        """
        return self._features(self._measurements(X))

    def transform_demonstration(self, samples: pd.DataFrame) -> Array:
        """The measured features, followed by the hidden ones.

        The orientation enters as a rotation vector, axis times angle. It is continuous at angle 0, where the axis is
        undefined.

        Args:
            samples: DataFrame with the fourteen channels, one row a sample.

        Returns:
            (n, k + h): the columns of ``transform``, then `hidden_names`.

        Raises:
            ValueError: if a channel is missing or a number is not finite.
        """
        measured = self._measurements(_columns(samples, MEASURED))
        pose = _columns(samples, POSE)  # its first two columns are the lateral position
        _require_finite(pose, POSE, type(self).__name__)
        phi = self._angle(measured)
        rotation = pose[:, 2:5] * pose[:, 5:6]
        # Turning P and H together about their z axes by phi turns both of these vectors by -phi.
        lateral, tilt = turned_rows(pose, -phi), turned_rows(rotation, -phi)
        hidden = self._hidden(measured[:, 6], lateral, np.hstack([tilt, rotation[:, 2:3]]), pose[:, 6])
        return np.hstack([self._features(measured), hidden])

    def rotation_angle(self, X: ArrayLike) -> Array:
        """Angle phi from P to the frame of the features about the peg axis, rad, (n,), of measurements (n, 7)."""
        return self._angle(self._measurements(X))

    def actions_to_frame(self, X: ArrayLike, A: ArrayLike) -> Array:
        """Turns planar actions from P into the frame of the features, by -phi about z.

        Args:
            X: (n, 7) measurements, which define the frame.
            A: (n, 3) actions (omega_x, omega_y, feed), or (n, 4) with omega_z: the rotation vector of the peg relative
                to the hole, expressed in P (rad), and the axial feed (m). Feed and omega_z are not changed.

        Returns:
            (n, 3) or (n, 4), the actions in the frame of the features.

        Raises:
            ValueError: if a shape is wrong or a number is not finite.
        """
        return self._turned_actions(X, A, -1.0)

    def actions_from_frame(self, X: ArrayLike, A: ArrayLike) -> Array:
        """Turns planar actions from the frame of the features into P; the inverse of ``actions_to_frame``."""
        return self._turned_actions(X, A, 1.0)

    @abstractmethod
    def _features(self, measured: Array) -> Array:
        """Features (n, k) of valid measurements (n, 7)."""

    @abstractmethod
    def _hidden(self, z: Array, lateral: Array, rotation: Array, step: Array) -> Array:
        """Hidden features (n, h), from the pose in the frame of the features.

        Args:
            z: (n,), height of the tip above the mouth, m.
            lateral: (n, 2), lateral position of the tip, m.
            rotation: (n, 3), rotation vector of R_HP, rad.
            step: (n,), angle of the rotation since the previous sample, rad.
        """

    def _angle(self, measured: Array) -> Array:
        """Angle of the frame (n,), rad, of valid measurements (n, 7); zero without a canonical frame."""
        return np.zeros(len(measured))

    def _turned_actions(self, X: ArrayLike, A: ArrayLike, sign: float) -> Array:
        actions = np.asarray(A, dtype=float)
        phi = self.rotation_angle(X)
        if actions.shape not in ((len(phi), 3), (len(phi), 4)):
            raise ValueError(
                f"{type(self).__name__}: actions have shape {actions.shape}, expected ({len(phi)}, 3 or 4):"
                " one row (omega_x, omega_y, feed[, omega_z]) for each row of measurements"
            )
        _require_finite(actions, ("omega_x", "omega_y", "feed", "omega_z"), type(self).__name__)
        return np.hstack([turned_rows(actions, sign * phi), actions[:, 2:]])

    def _measurements(self, X: ArrayLike) -> Array:
        """Measurements as an array (n, 7); raises a ValueError if they are not valid."""
        if isinstance(X, pd.DataFrame):
            X = _columns(X, MEASURED)
        values = np.asarray(X, dtype=float)
        if values.ndim != 2 or values.shape[1] != len(MEASURED):
            raise ValueError(
                f"{type(self).__name__}: measurements have shape {values.shape},"
                f" expected (n, {len(MEASURED)}): the columns {', '.join(MEASURED)};"
                " reshape a single sample with X.reshape(1, -1)"
            )
        _require_finite(values, MEASURED, type(self).__name__)
        return values


class PoseFeatures(WrenchFeatures):
    """Base class of the transformers whose hidden features are the pose, scaled to order one.

    Attributes:
        depth_scale: scale of (p_HP)_z, m.
        tilt_scale: typical misalignment, rad. It is the scale of the hidden rotation vector. Times ``depth_scale`` it
            is the scale of the hidden lateral position: a peg that is held at the mouth moves its tip by depth times
            tilt.
    """

    hidden_names = HIDDEN
    depth_scale: float
    tilt_scale: float

    def _hidden(self, z: Array, lateral: Array, rotation: Array, step: Array) -> Array:
        lateral_scale = self.depth_scale * self.tilt_scale
        return np.column_stack([lateral / lateral_scale, rotation / self.tilt_scale, step / STEPPER_STEP])


class RawFeatures(PoseFeatures):
    """The measurements, scaled to order one.

    Args:
        peg_radius: r, m. Moments M enter as M / r, in the unit of forces.
        force_scale: scale of forces, N.
        depth_scale: m; see `PoseFeatures`; of the measured depth too.
        tilt_scale: rad; see `PoseFeatures`.
    """

    names = MEASURED

    def __init__(
        self,
        *,
        peg_radius: float = 0.01,
        force_scale: float = 10.0,
        depth_scale: float = 0.02,
        tilt_scale: float = 0.05,
    ) -> None:
        self.peg_radius = peg_radius
        self.force_scale = force_scale
        self.depth_scale = depth_scale
        self.tilt_scale = tilt_scale

    def _features(self, measured: Array) -> Array:
        force, moment = self.force_scale, self.force_scale * self.peg_radius
        scale: Array = np.array([force, force, force, moment, moment, moment, self.depth_scale])
        return measured / scale


class NormalisedFeatures(PoseFeatures):
    """Direction and magnitude of the wrench, and depth.

    With s the norm of (F, M / r), the features are (F, M / r) / sqrt(s^2 + floor^2), the depth as
    sign(z) log(1 + |z| / depth_floor), and log(1 + s / floor). Far above the floor the first six have unit norm. In
    free motion, where s is sensor noise, they approach zero instead of a random direction. The depth is logarithmic
    because the greatest tilt of the peg, that of two-point contact, is proportional to 1 / depth: one millimetre
    changes it much near the mouth and little near the bottom. Heights above depth_floor are cut to depth_floor, so that
    a rig may start higher than any demonstration.

    Args:
        peg_radius: r, m.
        force_floor: N; a wrench with a smaller size s counts as sensor noise. The default is about five standard
            deviations of s for a Mini45-class sensor (0.02, 0.02, 0.05 N and 0.5 mN m, r = 10 mm).
        depth_floor: m; the scale is linear for depths well below it, and logarithmic above.
        depth_scale: m; see `PoseFeatures`.
        tilt_scale: rad; see `PoseFeatures`.
    """

    names: ClassVar[tuple[str, ...]] = (*MEASURED, "log_magnitude")

    def __init__(
        self,
        *,
        peg_radius: float = 0.01,
        force_floor: float = 0.5,
        depth_floor: float = 1e-3,
        depth_scale: float = 0.02,
        tilt_scale: float = 0.05,
    ) -> None:
        self.peg_radius = peg_radius
        self.force_floor = force_floor
        self.depth_floor = depth_floor
        self.depth_scale = depth_scale
        self.tilt_scale = tilt_scale

    def _features(self, measured: Array) -> Array:
        wrench = measured[:, 0:6] / np.array([1.0, 1.0, 1.0] + [self.peg_radius] * 3)
        magnitude = np.linalg.norm(wrench, axis=1, keepdims=True)
        direction = wrench / np.hypot(magnitude, self.force_floor)
        z = np.minimum(measured[:, 6:7], self.depth_floor)
        depth = np.sign(z) * np.log1p(np.abs(z) / self.depth_floor)
        return np.hstack([direction, depth, np.log1p(magnitude / self.force_floor)])


class CanonicalFeatures(NormalisedFeatures):
    """The normalised features in the canonical frame, whose x axis follows the lateral force.

    The frame is that of `skill.features.canonical_frame`. The y component of the force is zero there above the
    floor, and is dropped. The moment is taken about the point of the rim of the tip at -x, where a wall that pushes
    the tip along +x touches it: my - r fz. It is zero for a contact at the tip alone, for any friction. For a
    contact at the mouth, at depth l, it is l f_lateral. The two contacts need opposite corrections under the same
    lateral force.

    The frame turns with the wrench about any angle, so that a skill acts alike under every turn that maps a part onto
    itself. For a part that is not round r is half of the width between the sides that are nearest to its axis.
    """

    names = ("f_lateral", "fz", "mx", "my", "mz", "z", "log_magnitude")

    @classmethod
    def of(cls, geometry: PegHoleGeometry | None) -> Self:
        """Returns the features for a geometry, or for the peg of the paper."""
        return cls() if geometry is None else cls(peg_radius=geometry.peg_radius)

    def _angle(self, measured: Array) -> Array:
        return canonical_angles(np.ascontiguousarray(measured), self.peg_radius, self.force_floor)

    def _features(self, measured: Array) -> Array:
        rows = np.ascontiguousarray(measured)
        return canonical_features(rows, self.peg_radius, self.force_floor, self.depth_floor)


@compiled
def canonical_features(measured: Array, peg_radius: float, force_floor: float, depth_floor: float) -> Array:
    """Returns the features (n, 7) of `CanonicalFeatures` of measurements (n, 7); its parameters are theirs."""
    found = np.empty((len(measured), 7))
    for i in range(len(measured)):
        row, out = measured[i], found[i]
        phi = canonical_angle(row, peg_radius, force_floor)
        fx, _ = turned(row[0], row[1], -phi)
        mx, my = turned(row[3], row[4], -phi)
        size = 0.0
        for j in range(3):
            size += row[j] ** 2 + (row[3 + j] / peg_radius) ** 2
        size = math.sqrt(size)
        scale = math.hypot(size, force_floor)
        z = min(row[6], depth_floor)
        out[0], out[1] = fx / scale, row[2] / scale
        out[2], out[3] = mx / peg_radius / scale, (my / peg_radius - row[2]) / scale
        out[4] = row[5] / peg_radius / scale
        out[5] = math.copysign(math.log1p(abs(z) / depth_floor), z)
        out[6] = math.log1p(size / force_floor)
    return found


def _columns(samples: pd.DataFrame, names: tuple[str, ...]) -> Array:
    missing = [name for name in names if name not in samples.columns]
    if missing:
        raise ValueError(f"samples lack the columns {missing}; expected at least {list(names)}")
    return samples[list(names)].to_numpy(dtype=float)


def _require_finite(values: Array, names: tuple[str, ...], source: str) -> None:
    if np.isfinite(values).all():
        return
    row, column = np.argwhere(~np.isfinite(values))[0]
    raise ValueError(
        f"{source}: '{names[column]}' is {values[row, column]} in row {row}, expected finite numbers;"
        " drop or repair the samples with NaN or infinite readings"
    )
