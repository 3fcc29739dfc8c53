"""Sets of components that no valley of the density separates.

A contact state is seldom one Gaussian: a force that swings or drifts within a contact needs several components. A
contact is therefore a *set* of components (Baudry and others, "Combining mixture components for clustering", Journal of
Computational and Graphical Statistics 19(2), 2010; Hennig, "Methods for merging Gaussian mixture components", Advances
in Data Analysis and Classification 4, 2010). Two sets are merged if the density of their samples has no valley between
them. It is estimated along the line that separates the two sets best, Fisher's discriminant. Each set has a kernel of
its own, whose width follows from its spread and from its effective number of samples: one width for both would smear
the narrower set over the wider one, and in trajectories, consecutive samples repeat each other, so that the samples
themselves would show valleys between single visits.

No valley separates a narrow set from a wide one that surrounds it, such as free space from light contacts in all
directions. The narrow set then shows by its density alone (`densest_component`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.special import logsumexp
from scipy.stats import entropy

from skill.arrays import Array

DENSEST = 8.0
"""Peak of a component that is a state of its own, relative to that of any other. In free space a sensor shows its noise
only: in six divisions of simulated insertions, the peak of that component is 15 to 40 times as high as the next."""

BINS = 2048
"""Number of bins along the line."""

MARGIN = 4.0
"""What is left free on either side of the samples, in widths of the wider kernel."""

BANDWIDTH = 1.5
"""Width of the kernel of a group for one effective sample, in its standard deviations; Scott, Multivariate Density
Estimation, 1992, has 1.06 for a Gaussian. Half as much again hides the gaps between single visits."""

RIDGE = 1e-6
"""Share of a channel's variance, within and between two groups, that is added, so that channels may depend on each
other."""

SMALLEST_SET = 2
"""Smallest number of samples of a set."""


def density_valley(one: Array, other: Array, n_effective: float) -> float:
    """Returns the lowest density between the peaks of two groups of numbers, relative to the lower of the two peaks.

    The density is that of both groups together. It is 1 where nothing separates them, and 0 for a gap.

    Args:
        one: shape (n,), samples of one group along a line.
        other: shape (m,), samples of the other.
        n_effective: effective number of samples of both together; each group has its share, but at least 2.
    """
    both = np.concatenate([one, other])
    low, high = both.min(), both.max()
    if not high > low:
        return 1.0
    shares = [n_effective * len(x) / len(both) for x in (one, other)]
    widths = [BANDWIDTH * float(x.std()) * max(n, 2.0) ** -0.2 for x, n in zip((one, other), shares, strict=True)]
    widths = [max(width, (high - low) / BINS) for width in widths]  # a group without noise has no spread
    # A margin on either side keeps the kernels inside.
    margin = MARGIN * max(widths)
    edges = np.linspace(low - margin, high + margin, BINS + 1)
    bin_width = edges[1] - edges[0]
    smooth = [
        gaussian_filter1d(np.histogram(x, edges)[0].astype(float), width / bin_width, mode="constant")
        for x, width in zip((one, other), widths, strict=True)
    ]
    density = smooth[0] + smooth[1]
    begin, end = sorted(int(np.argmax(curve)) for curve in smooth)
    peaks = min(density[begin], density[end])
    return float(density[begin : end + 1].min() / peaks)


def discriminant(A: Array, B: Array) -> Array:
    """Returns Fisher's direction (S_A + S_B)^-1 (mean_A - mean_B) of samples (n, d) and (m, d), shape (d,)."""
    scatter = np.atleast_2d(np.cov(A.T)) + np.atleast_2d(np.cov(B.T))
    difference = A.mean(axis=0) - B.mean(axis=0)
    # Without noise, a channel may differ between the groups and not within them.
    scatter += np.diag(RIDGE * (np.diag(scatter) + difference**2) + np.finfo(float).tiny)
    return np.linalg.solve(scatter, difference)


def _without_small(memberships: Array, counts: NDArray[np.intp]) -> NDArray[np.intp]:
    """Returns sets of one component each, but for those with too few samples."""
    sets = np.arange(len(counts))
    enough = counts >= SMALLEST_SET
    if enough.any():
        shared = memberships.T @ memberships
        sets[~enough] = np.flatnonzero(enough)[shared[:, enough].argmax(axis=1)][~enough]
    return sets


def densest_component(weights: Array, covariances: Array) -> int | None:
    """Returns the component whose peak is `DENSEST` times as high as any other, or None.

    The peak of a Gaussian is proportional to P_k / sqrt(det Sigma_k).

    Args:
        weights: shape (M,), weights P of the components.
        covariances: shape (M, d, d).
    """
    peaks = np.log(weights) - 0.5 * np.linalg.slogdet(covariances)[1]
    if len(peaks) < 2:
        return None
    second, first = np.sort(peaks)[-2:]
    return int(np.argmax(peaks)) if first - second >= np.log(DENSEST) else None


def component_sets(
    Z: Array, memberships: Array, *, design_effect: float, threshold: float, alone: int | None = None
) -> NDArray[np.intp]:
    """Merges components whose samples no valley separates, those with the shallowest valley first.

    A sample belongs to its most probable component. A component with fewer than two samples lies within others; it
    belongs to the set of the one that it shares most samples with.

    Args:
        Z: samples, shape (N, d).
        memberships: shape (N, M), posterior of each of the M components.
        design_effect: number of samples that carry the information of one independent sample.
        threshold: sets are merged while the valley between two of them is at least this high, between 0 and 1.
        alone: a component that is merged with no other (`densest_component`); None for none.

    Returns:
        The set of each component, shape (M,), counted from 0.
    """
    M = memberships.shape[1]
    labels = memberships.argmax(axis=1)
    sets = _without_small(memberships, np.bincount(labels, minlength=M))
    valleys = np.full((M, M), -1.0)

    def compare(a: int, b: int) -> float:
        of = sets[labels]
        A, B = Z[of == a], Z[of == b]
        if min(len(A), len(B)) < SMALLEST_SET:
            return -1.0
        direction = discriminant(A, B)
        return density_valley(A @ direction, B @ direction, (len(A) + len(B)) / design_effect)

    for a in range(M):
        for b in range(a):
            if alone not in (a, b):
                valleys[a, b] = compare(a, b)
    while valleys.max() >= threshold:
        a, b = (int(k) for k in np.unravel_index(np.argmax(valleys), valleys.shape))
        sets[sets == a] = b
        valleys[a, :] = valleys[:, a] = -1.0
        for c in np.unique(sets):
            if c not in (b, alone):
                valleys[max(b, c), min(b, c)] = compare(b, int(c))
    return np.unique(sets, return_inverse=True)[1]


def recurrence_of_components(labels: NDArray[np.intp], sets: NDArray[np.intp], groups: NDArray[np.intp]) -> float:
    """Returns in how many recordings a component occurs, relative to its set, over the sets of several components.

    The number is that of equal shares with the same entropy, exp H, a mean over the samples. It is near 1 where every
    recording passes through the components of a set, as when a force drifts, and near 0 where each recording has a
    component of its own. It is 1 if all sets are single components.

    Args:
        labels: shape (N,), component of each sample.
        sets: shape (M,), set of each component.
        groups: shape (N,), recording of each sample, counted from 0.
    """
    M = len(sets)
    counts = np.zeros((M, int(groups.max()) + 1))
    np.add.at(counts, (labels, groups), 1.0)
    of_sets = np.stack([counts[sets == s].sum(axis=0) for s in sets])
    samples = counts.sum(axis=1) * (np.bincount(sets)[sets] > 1)
    if not samples.any():
        return 1.0
    return float(samples @ np.exp(entropy(counts, axis=1)) / (samples @ np.exp(entropy(of_sets, axis=1))))


def set_log_likelihoods(densities: Array, weights: Array, sets: NDArray[np.intp]) -> Array:
    """Returns log p(x | s) = log (sum_(k in s) P_k p_k(x) / sum_(k in s) P_k) of each set s, shape (N, number of sets).

    Args:
        densities: shape (N, M), log P_k p_k(x) of each sample and component.
        weights: shape (M,), weights P of the components.
        sets: shape (M,), set of each component, counted from 0.
    """
    columns = [
        logsumexp(densities[:, sets == s], axis=1) - np.log(weights[sets == s].sum()) for s in range(max(sets) + 1)
    ]
    return np.stack(columns, axis=1)
