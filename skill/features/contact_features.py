"""Features that separate the contact states: the forces at the two places where a peg in a hole can touch."""

from __future__ import annotations

import math
from typing import Self

import numpy as np

from compiled import compiled
from skill.arrays import Array
from skill.data.geometry import PegHoleGeometry
from skill.features.canonical_frame import canonical_angle, turned
from skill.features.wrench_features import WrenchFeatures

MIN_LEVER = 0.1
"""Minimum lever of the force at the mouth, in units of the peg radius: at smaller depths the moment cannot separate
mouth and tip."""

SATURATION = 2.0
"""Offsets enter as tanh(offset / (SATURATION play)): 0.46 at the play, and below 1 however far the peg is tilted."""


class ContactFeatures(WrenchFeatures):
    """The lateral forces at the tip and at the mouth.

    In the canonical frame (`skill.features.canonical_frame`) a wall pushes the peg with f_tip at its tip and with
    f_mouth at depth l, both along x. Together they make the net force, and the moment about the rim of the tip is that
    of the mouth alone:

        f_tip + f_mouth = f_lateral,      l f_mouth = my - r fz.

    Where f_tip < f_mouth the frame is turned by half a turn. The x axis of a two-point contact is then that of the
    force at the tip, whichever force is greater. A contact at the tip is (1, 0) at any depth, one at the mouth (0, -1),
    two contacts on opposite sides (1, -1), two on the same side (1, 1) or (-1, -1), and free motion (0, 0). A partition
    by these numbers does not follow the depth, unlike one by the direction of the wrench, whose moment grows with the
    depth. Friction at the mouth is neglected.

    A greater force is not another contact. Therefore each force f_i saturates,

        f_i / sqrt(f_i^2 + floor^2 + (floor r / l)^2 + (share |(f_tip, f_mouth)|)^2).

    The floor is the noise of forces. The second term is the noise r floor of moments over the lever l, which is at
    least ``MIN_LEVER`` r. The third term is the error that the neglected friction causes. The third feature, log(1 + s
    / floor) with s the norm of (F, M / r), separates touches below the noise from free motion.

    Hidden features, known for demonstrations only, are two lateral offsets from the axis of the hole along x: that of
    the centre of the tip, and that of the peg axis at the mouth. They are saturated too, in units of the play.

    Args:
        peg_radius: r, m.
        force_floor: N; see `NormalisedFeatures`.
        force_share: share of the two contact forces below which one of them may be an error of the other.
        play: radial clearance of peg and hole, m.
    """

    names = ("tip_force", "mouth_force", "log_magnitude")
    hidden_names = ("tip_offset", "mouth_offset")

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

    @classmethod
    def of(cls, geometry: PegHoleGeometry | None) -> Self:
        """Returns the features for a geometry, or for the peg and hole of the paper."""
        return cls() if geometry is None else cls(peg_radius=geometry.peg_radius, play=geometry.clearance)

    def _angle(self, measured: Array) -> Array:
        return self._found(measured)[:, 3]

    def _features(self, measured: Array) -> Array:
        return self._found(measured)[:, :3]

    def _found(self, measured: Array) -> Array:
        rows = np.ascontiguousarray(measured)
        return contact_features(rows, self.peg_radius, self.force_floor, self.force_share)

    def _hidden(self, z: Array, lateral: Array, rotation: Array, step: Array) -> Array:
        # The peg axis leaves the tip along rotation x z, to first order in the tilt.
        at_mouth = lateral[:, 0] + np.maximum(-z, 0.0) * rotation[:, 1]
        return np.tanh(np.column_stack([lateral[:, 0], at_mouth]) / (SATURATION * self.play))


@compiled
def contact_features(measured: Array, peg_radius: float, force_floor: float, force_share: float) -> Array:
    """Returns the features of `ContactFeatures`, and the angle of their frame (rad), (n, 4), of measurements (n, 7).

    The parameters are those of the class.
    """
    found = np.empty((len(measured), 4))
    for i in range(len(measured)):
        row, out = measured[i], found[i]
        phi = canonical_angle(row, peg_radius, force_floor)
        fx, _ = turned(row[0], row[1], -phi)
        _, my = turned(row[3], row[4], -phi)
        lever = max(-row[6], MIN_LEVER * peg_radius)
        mouth = (my - peg_radius * row[2]) / lever
        tip = fx - mouth
        friction_error = force_share * math.hypot(tip, mouth)
        noise = force_floor**2 * (1.0 + (peg_radius / lever) ** 2) + friction_error**2
        sign = -1.0 if tip < mouth else 1.0
        out[0] = sign * tip / math.sqrt(tip**2 + noise)
        out[1] = sign * mouth / math.sqrt(mouth**2 + noise)
        size = 0.0
        for j in range(3):
            size += row[j] ** 2 + (row[3 + j] / peg_radius) ** 2
        out[2] = math.log1p(math.sqrt(size) / force_floor)
        out[3] = phi
        if sign < 0.0:
            out[3] = phi - math.pi if phi > 0.0 else phi + math.pi
    return found
