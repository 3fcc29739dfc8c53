"""Standardisation of samples and the way back to the units of the channels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skill.arrays import Array
from skill.channel_scale import standard_scale
from skill.clustering.gaussian_components import GaussianComponents


@dataclass(frozen=True)
class StandardisedSamples:
    """Samples with channels of mean zero and variance one, Z = (X - shift) / scale.

    Attributes:
        Z: shape (N, d), standardised samples.
        shift: shape (d,), in the units of X.
        scale: shape (d,), in the units of X; positive.
    """

    Z: Array
    shift: Array
    scale: Array

    @classmethod
    def of(cls, X: Array, *, centred: bool, scaled: bool) -> StandardisedSamples:
        """Standardises samples ``X`` (N, d); a channel that is constant up to round-off keeps its unit.

        Args:
            X: samples, shape (N, d).
            centred: whether to subtract the mean.
            scaled: whether to divide by the standard deviation.
        """
        shift = X.mean(axis=0) if centred else np.zeros(X.shape[1])
        scale = standard_scale(X) if scaled else np.ones(X.shape[1])
        return cls((X - shift) / scale, shift, scale)

    def restored(self, components: GaussianComponents) -> GaussianComponents:
        """Returns the components in the units of X, largest weight first."""
        order = np.argsort(-components.weights, kind="stable")
        return GaussianComponents(
            components.weights[order],
            self.shift + self.scale * components.means[order],
            self.scale[:, None] * components.covariances[order] * self.scale,
            components.degrees,
        )
