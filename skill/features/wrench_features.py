"""Features of a contact: what the learner sees of the measured wrench and depth.

The rig measures seven numbers (``MEASURED``). Three transformers turn them into features of order one, each
with more invariance than the one before:

* ``RawFeatures``: the measurements, scaled to order one by fixed physical scales; no invariance.
* ``NormalisedFeatures``: the direction of the wrench apart from its magnitude. A contact of given geometry
  yields the same direction however stiff the walls and however hard one pushes.
* ``CanonicalFeatures``: the same, turned about the peg axis so that the lateral force points along +x. Peg
  and hole are bodies of revolution, so a contact and its copy turned about the axis call for actions that
  are the same but for that turn; seeing both as one point multiplies the demonstrations.

Planar actions live in the same frame as the features: ``actions_to_frame`` turns demonstrated actions into it
before learning, and ``actions_from_frame`` turns learnt ones back before they are performed.
"""

from __future__ import annotations

from typing import Any, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import issparse
from sklearn.base import BaseEstimator, TransformerMixin

from skill.arrays import Array

MEASURED = ("fx", "fy", "fz", "mx", "my", "mz", "z")
"""What the rig can measure: the wrench on the peg about its tip, expressed in P (N, N m), and (p_HP)_z (m),
which is minus the insertion depth."""

HIDDEN = ("x", "y", "rotation_x", "rotation_y", "rotation_z", "dangle")
"""What only demonstrations have: the lateral tip position, the rotation vector of R_HP, the rotation step."""

POSE = ("x", "y", "ax", "ay", "az", "angle", "dangle")
"""The channels that the hidden features come from."""

STEPPER_STEP = float(np.deg2rad(0.18))
"""One step of the rig's motors, rad: the natural unit of the rotation from one sample to the next."""


class RawFeatures(TransformerMixin, BaseEstimator):
    """The measurements, scaled to order one.

    Args:
        peg_radius: r, m. Moments are compared with forces as M / r.
        force_scale: N; forces are divided by it.
        depth_scale: m; (p_HP)_z is divided by it.
        tilt_scale: rad; a typical misalignment. Scales the hidden rotation vector, and with ``depth_scale``
            the hidden lateral position, since a peg held at the mouth moves its tip by depth times tilt.

    The transformer is stateless: ``fit`` only checks its input.
    """

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

    def fit(self, X: ArrayLike, y: object = None) -> Self:
        """Checks parameters and measurements, (n, 7); learns nothing."""
        for name, value in self.get_params().items():
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"{type(self).__name__}: {name} = {value}; expected a positive number in SI units")
        self._measurements(X)
        self.n_features_in_ = len(MEASURED)
        self.feature_names_in_ = np.array(MEASURED, dtype=object)
        return self

    def transform(self, X: ArrayLike) -> Array:
        """Features of measurements.

        Args:
            X: (n, 7), the channels ``MEASURED`` in their order, SI units; as a DataFrame, by name in any
                order.

        Returns:
            (n, k), order one, named by ``get_feature_names_out``.

        Raises:
            ValueError: if the shape is wrong or a number is not finite.
        """
        return self._features(self._measurements(X))

    def get_feature_names_out(self, input_features: object = None) -> NDArray[np.object_]:
        """Names of the k features."""
        return np.array(MEASURED, dtype=object)

    def hidden_names(self) -> NDArray[np.object_]:
        """Names of the h features that only demonstrations have."""
        return np.array(HIDDEN, dtype=object)

    def transform_demonstration(self, samples: pd.DataFrame) -> Array:
        """The measured features and, behind them, the hidden ones.

        The orientation enters as its rotation vector, axis times angle, which passes smoothly through angle 0
        where the axis is undefined.

        Args:
            samples: DataFrame with the fourteen channels, one row a sample.

        Returns:
            (n, k + h): the columns of ``transform``, then those of ``hidden_names``.
        """
        measured = self._measurements(_columns(samples, MEASURED))
        pose = _columns(samples, POSE)
        _require_finite(pose, POSE, type(self).__name__)
        phi = self.rotation_angle(measured)
        rotation = pose[:, 2:5] * pose[:, 5:6]
        # Turning P and H together about their z axes by phi turns both of these vectors by -phi.
        lateral, tilt = _turn(pose[:, 0:2], -phi), _turn(rotation[:, 0:2], -phi)
        hidden = self._hidden(measured[:, 6], lateral, np.hstack([tilt, rotation[:, 2:3]]), pose[:, 6])
        return np.hstack([self._features(measured), hidden])

    def _hidden(self, z: Array, lateral: Array, rotation: Array, step: Array) -> Array:
        """The hidden features (n, h) of z (n,) and lateral (n, 2) of p_HP in m, rotation (n, 3), step (n,) in rad."""
        lateral_scale = self.depth_scale * self.tilt_scale
        return np.column_stack([lateral / lateral_scale, rotation / self.tilt_scale, step / STEPPER_STEP])

    def rotation_angle(self, X: ArrayLike) -> Array:
        """Angle phi of the feature frame about the peg axis, rad, (n,): zero without a canonical frame."""
        return np.zeros(len(self._measurements(X)))

    def actions_to_frame(self, X: ArrayLike, A: ArrayLike) -> Array:
        """Turns planar actions from P into the feature frame, by -phi about z.

        Args:
            X: (n, 7) measurements, which define the frame.
            A: (n, 3) actions (omega_x, omega_y, feed): the planar rotation-vector increments of the peg
                relative to the hole, expressed in P (rad), and the axial feed (m). The feed does not turn.

        Returns:
            (n, 3) the actions in the feature frame.
        """
        return self._turned_actions(X, A, -1.0)

    def actions_from_frame(self, X: ArrayLike, A: ArrayLike) -> Array:
        """Turns planar actions from the feature frame into P: the inverse of ``actions_to_frame``."""
        return self._turned_actions(X, A, 1.0)

    def _turned_actions(self, X: ArrayLike, A: ArrayLike, sign: float) -> Array:
        actions = np.asarray(A, dtype=float)
        phi = self.rotation_angle(X)
        if actions.shape != (len(phi), 3):
            raise ValueError(
                f"{type(self).__name__}: actions have shape {actions.shape}, expected ({len(phi)}, 3):"
                " one row (omega_x, omega_y, feed) for each row of measurements"
            )
        _require_finite(actions, ("omega_x", "omega_y", "feed"), type(self).__name__)
        return np.hstack([_turn(actions[:, 0:2], sign * phi), actions[:, 2:3]])

    def _measurements(self, X: ArrayLike) -> Array:
        if isinstance(X, pd.DataFrame):
            X = _columns(X, MEASURED)
        if issparse(X):
            raise TypeError(f"{type(self).__name__}: sparse input is not supported; convert it with X.toarray()")
        measured = np.asarray(X)
        if measured.dtype.kind == "c":
            raise ValueError(
                f"{type(self).__name__}: Complex data not supported; expected real measurements, use X.real"
            )
        measured = measured.astype(float, copy=False)
        if measured.ndim != 2 or measured.shape[1] != len(MEASURED):
            raise ValueError(
                f"{type(self).__name__}: measurements have shape {measured.shape},"
                f" expected (n, {len(MEASURED)}): the columns {', '.join(MEASURED)};"
                " reshape a single sample with X.reshape(1, -1)"
            )
        _require_finite(measured, MEASURED, type(self).__name__)
        return measured

    def _features(self, measured: Array) -> Array:
        scale = np.array([self.force_scale] * 3 + [self.force_scale * self.peg_radius] * 3 + [self.depth_scale])
        return measured / scale

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.requires_fit = False
        return tags


class NormalisedFeatures(RawFeatures):
    """Direction and magnitude of the wrench, and depth.

    With s the norm of (F, M / r), the features are (F, M / r) / sqrt(s^2 + floor^2), the depth as
    sign(z) log(1 + |z| / depth_floor), and log(1 + s / floor). Far above the floor the first six have unit norm; in
    free motion, where s is sensor noise, they vanish instead of becoming a random direction. The depth counts in
    proportions because the tilt that a peg can have, two-point contact, falls as one over it: near the mouth a
    millimetre deeper means another tilt, near the bottom it does not. Heights above depth_floor are all one: z is cut
    there, so that a rig may begin higher than any demonstration did.

    Args:
        peg_radius: r, m.
        force_floor: N; the size of the wrench (F, M / r) below which it is taken for sensor noise. The
            default is about five standard deviations of s for a Mini45-class sensor (0.02, 0.02, 0.05 N and
            0.5 mN m, r = 10 mm).
        depth_floor: m; depths well below it count in metres, those above in proportions.
        depth_scale: m; of the hidden lateral position.
        tilt_scale: rad; see ``RawFeatures``.
    """

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

    def get_feature_names_out(self, input_features: object = None) -> NDArray[np.object_]:
        """Names of the eight features."""
        return np.array([*MEASURED, "log_magnitude"], dtype=object)

    def _features(self, measured: Array) -> Array:
        wrench = measured[:, 0:6] / np.array([1.0, 1.0, 1.0] + [self.peg_radius] * 3)
        magnitude = np.linalg.norm(wrench, axis=1, keepdims=True)
        direction = wrench / np.hypot(magnitude, self.force_floor)
        z = np.minimum(measured[:, 6:7], self.depth_floor)
        depth = np.sign(z) * np.log1p(np.abs(z) / self.depth_floor)
        return np.hstack([direction, depth, np.log1p(magnitude / self.force_floor)])


class CanonicalFeatures(NormalisedFeatures):
    """The normalised features in the frame whose x axis follows the lateral force.

    The frame is P turned about z by phi = atan2(fy, fx), so the y component of the force vanishes and is
    dropped. The moment is taken about the point of the tip's rim at -x, where a wall that pushes the tip along
    +x touches it: my - r fz. Contact at the tip alone makes it vanish whatever the friction; contact at the
    mouth, at depth l, makes it l f_lateral. The two call for opposite corrections under the same lateral force.

    A lateral force below the floor has no trustworthy direction, yet it occurs under load: in a wedge the two
    contacts may balance to a pure couple. There the lateral moment tells the direction, and the frame follows

        f + max(0, floor - |f|) e,    e = -z x m / sqrt(|m|^2 + (r floor)^2),

    with f and m the lateral force and moment. The quarter turn makes e agree with f where both are known in
    advance: a single contact at the mouth, above the tip, has m along z x f. The blend is continuous, turns
    with the wrench like f itself, and leaves phi exactly atan2(fy, fx) above the floor. Where the moment is
    lost in the noise too, phi is arbitrary, which is harmless: every component that phi turns is then
    small, and averages over arbitrary phi make learnt lateral actions vanish, as symmetry demands in the
    absence of a lateral wrench.

    Args:
        peg_radius: r, m.
        force_floor: N.
        depth_floor: m.
        depth_scale: m.
        tilt_scale: rad; see ``RawFeatures``.
    """

    def get_feature_names_out(self, input_features: object = None) -> NDArray[np.object_]:
        """Names of the seven features; the force's y component is zero in this frame, hence absent."""
        return np.array(["f_lateral", "fz", "mx", "my", "mz", "z", "log_magnitude"], dtype=object)

    def rotation_angle(self, X: ArrayLike) -> Array:
        """Angle phi from P to the canonical frame about the peg axis, rad, in (-pi, pi], (n,)."""
        return self._angle(self._measurements(X))

    def _angle(self, measured: Array) -> Array:
        force, moment = measured[:, 0:2], measured[:, 3:5]
        missing = np.maximum(0.0, self.force_floor - np.hypot(force[:, 0], force[:, 1]))
        size = np.hypot(np.hypot(moment[:, 0], moment[:, 1]), self.peg_radius * self.force_floor)
        x = force[:, 0] + missing * moment[:, 1] / size
        y = force[:, 1] - missing * moment[:, 0] / size
        return np.arctan2(y, x)

    def _turned(self, measured: Array) -> Array:
        """Measurements (n, 7) in the canonical frame."""
        phi = self._angle(measured)
        turned = measured.copy()
        turned[:, 0:2] = _turn(measured[:, 0:2], -phi)
        turned[:, 3:5] = _turn(measured[:, 3:5], -phi)
        return turned

    def _features(self, measured: Array) -> Array:
        features = super()._features(self._turned(measured))
        features[:, 4] -= features[:, 2]  # (my - r fz) / r, over the same magnitude
        return np.delete(features, 1, axis=1)


def _turn(vectors: Array, angle: Array) -> Array:
    """Plane vectors (n, 2) turned by angles (n,), rad."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = vectors[:, 0], vectors[:, 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=1)


def _columns(samples: pd.DataFrame, names: tuple[str, ...]) -> Array:
    missing = [name for name in names if name not in samples.columns]
    if missing:
        raise ValueError(f"samples lack the columns {missing}; expected at least {list(names)}")
    return samples[list(names)].to_numpy(dtype=float)


def _require_finite(values: Array, names: tuple[str, ...], who: str) -> None:
    if np.isfinite(values).all():
        return
    row, column = np.argwhere(~np.isfinite(values))[0]
    raise ValueError(
        f"{who}: '{names[column]}' is {values[row, column]} in row {row}, expected finite numbers;"
        " drop or repair the samples where the sensor dropped out (NaN or infinite readings)"
    )
