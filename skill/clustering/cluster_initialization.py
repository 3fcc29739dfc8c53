"""Initial components of the competition: partitions of the samples into more clusters than there are states."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sklearn.cluster import kmeans_plusplus

from skill.arrays import Array
from skill.clustering.expectation_maximization import CovariancePrior
from skill.clustering.gaussian_components import GaussianComponents


def seed_centres(Z: Array, M: int, random_state: np.random.RandomState) -> Array:
    """Returns ``M`` k-means++ seeds, shape (M, d).

    They are not improved by k-means, which would split elongated clusters.
    """
    centres, _ = kmeans_plusplus(Z, M, random_state=random_state)
    return np.asarray(centres, dtype=float)


def nearest_centre(Z: Array, centres: Array, block: int = 8192) -> NDArray[np.intp]:
    """Returns the index of the Euclidean-nearest centre of each sample, shape (N,)."""
    labels = np.empty(len(Z), dtype=np.intp)
    half_norms = 0.5 * np.einsum("md,md->m", centres, centres)
    for start in range(0, len(Z), block):
        labels[start : start + block] = np.argmin(half_norms - Z[start : start + block] @ centres.T, axis=1)
    return labels


def phase_slices(phase: Array, slices: int) -> NDArray[np.intp]:
    """Returns the time slice of each sample, floor(slices phase), shape (N,); a phase of 1 is in the last slice."""
    return np.minimum((slices * phase).astype(np.intp), slices - 1)


def components_of_partition(Z: Array, labels: NDArray[np.intp], prior: CovariancePrior) -> GaussianComponents:
    """Returns one Gaussian for each label that occurs: share, mean and regularised covariance of its samples."""
    _, labels = np.unique(labels, return_inverse=True)
    counts = np.bincount(labels).astype(float)
    order = np.argsort(labels, kind="stable")
    members = np.split(order, np.cumsum(counts.astype(np.intp))[:-1])
    means = np.stack([Z[rows].mean(axis=0) for rows in members])
    covariances = np.stack(
        [(Z[rows] - mean).T @ (Z[rows] - mean) / len(rows) for rows, mean in zip(members, means, strict=True)]
    )
    return GaussianComponents(counts / counts.sum(), means, prior.apply(covariances, counts))


def components_at_centres(Z: Array, centres: Array, prior: CovariancePrior) -> GaussianComponents:
    """Returns Gaussians with the given means, shape (M, d).

    The covariance of each is the regularised second moment, about its centre, of the samples nearest to it.
    """
    M, d = centres.shape
    labels = nearest_centre(Z, centres)
    counts = np.bincount(labels, minlength=M).astype(float)
    covariances = np.zeros((M, d, d))
    for i in np.flatnonzero(counts):
        offsets = Z[labels == i] - centres[i]
        covariances[i] = offsets.T @ offsets / counts[i]
    # A centre without samples gets the weight of one sample, so that it can still attract samples.
    weights = np.maximum(counts, 1.0)
    return GaussianComponents(weights / weights.sum(), centres, prior.apply(covariances, counts))
