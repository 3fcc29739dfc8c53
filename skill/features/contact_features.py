"""Features by which contact states are told apart: where the peg may touch, and whether it does."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skill.arrays import Array
from skill.features.wrench_features import CanonicalFeatures

MIN_LEVER = 0.1
"""Of the peg's radius: at less depth than this nothing tells the mouth from the tip."""

SATURATION = 2.0
"""Offsets enter as tanh(offset / (2 play)): 0.46 at the play, and never more than 1 where the peg is tilted aside."""


class ContactFeatures(CanonicalFeatures):
    """The lateral forces at the two places where a peg in a hole can touch.

    In the canonical frame a wall pushes the peg at its tip with f_tip along x, the mouth at depth l with f_mouth. Both
    contacts hold the net force, and the moment about the rim of the tip is that of the mouth alone:

        f_tip + f_mouth = f_lateral,      l f_mouth = my - r fz.

    The frame is turned by half a turn where f_tip < f_mouth: the x axis of two-point contact is that of the force at
    the tip, whichever of the two happens to be the greater. One point at the tip is then (1, 0) whatever its depth, one
    at the mouth (0, -1), both on opposite sides (1, -1), both on the same side (1, 1) or (-1, -1), and free motion
    (0, 0). A partition by these two numbers does not follow the depth, as one by the wrench's direction does, whose
    moment grows with it. Friction at the mouth is neglected.

    How *much* force a contact bears does not make it another contact, so each force saturates,

        f_i / sqrt(f_i^2 + floor^2 + (floor r / l)^2 + (share |(f_tip, f_mouth)|)^2),

    above the noise of forces, above that of moments (of which r floor is noise), which a short lever makes large, and
    above what the neglected friction makes one contact borrow from the other. The lever l is at least a tenth of r.
    log(1 + s / floor), with s the size of the whole wrench, tells touches below the noise from free motion.

    Hidden, known of demonstrations only, are how far tip and mouth have used the play up: the offsets along x of
    the tip's centre and of the point of the peg's axis at the mouth from the axis of the hole, saturated.

    Args:
        peg_radius: r, m.
        force_floor: N; see `NormalisedFeatures`.
        force_share: of the two contact forces, below which one of them may be an error of the other.
        play: radial clearance of peg and hole, m.
    """

    def __init__(
        self,
        *,
        peg_radius: float = 0.01,
        force_floor: float = 0.5,
        force_share: float = 0.1,
        play: float = 5e-5,
    ) -> None:
        self.peg_radius = peg_radius
        self.force_floor = force_floor
        self.force_share = force_share
        self.play = play

    def get_feature_names_out(self, input_features: object = None) -> NDArray[np.object_]:
        """Names of the three features."""
        return np.array(["tip_force", "mouth_force", "log_magnitude"], dtype=object)

    def hidden_names(self) -> NDArray[np.object_]:
        """Names of the two features that only demonstrations have."""
        return np.array(["tip_offset", "mouth_offset"], dtype=object)

    def rotation_angle(self, X: ArrayLike) -> Array:
        """Angle phi from P to the frame of the contact forces about the peg axis, rad, in (-pi, pi], (n,)."""
        measured = self._measurements(X)
        phi, (tip, mouth) = self._angle(measured), self._contact_forces(measured)
        return np.where(tip < mouth, np.where(phi > 0.0, phi - np.pi, phi + np.pi), phi)

    def _contact_forces(self, measured: Array) -> tuple[Array, Array]:
        """f_tip and f_mouth (n,), N, along the net lateral force."""
        turned = self._turned(measured)
        mouth = (turned[:, 4] - self.peg_radius * turned[:, 2]) / self._lever(measured)
        return turned[:, 0] - mouth, mouth

    def _lever(self, measured: Array) -> Array:
        return np.maximum(-measured[:, 6], MIN_LEVER * self.peg_radius)

    def _features(self, measured: Array) -> Array:
        tip, mouth = self._contact_forces(measured)
        forces = np.where(tip < mouth, -1.0, 1.0)[:, None] * np.column_stack([tip, mouth])
        r = self.peg_radius
        borrowed = self.force_share * np.hypot(tip, mouth)
        unclear = self.force_floor**2 * (1.0 + (r / self._lever(measured)) ** 2) + borrowed**2
        size = np.linalg.norm(measured[:, 0:6] / np.repeat([1.0, r], 3), axis=1)
        return np.column_stack([forces / np.sqrt(forces**2 + unclear[:, None]), np.log1p(size / self.force_floor)])

    def _hidden(self, z: Array, lateral: Array, rotation: Array, step: Array) -> Array:
        # The axis leaves the tip along rotation x z, to first order in the tilt.
        at_mouth = lateral[:, 0] + np.maximum(-z, 0.0) * rotation[:, 1]
        return np.tanh(np.column_stack([lateral[:, 0], at_mouth]) / (SATURATION * self.play))
