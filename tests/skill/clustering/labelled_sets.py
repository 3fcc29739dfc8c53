"""Labelled data sets for judging clusterings; every generator takes a seed and returns samples X (N, d), labels y (N,).

Seeds 0 to 4 are for development; seeds from 100 on are for evaluation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skill.arrays import Array

Samples = Array
Labels = NDArray[np.intp]


def gaussian_mixture(
    rng: np.random.Generator, counts: ArrayLike, means: ArrayLike, covariances: ArrayLike
) -> tuple[Samples, Labels]:
    """Shuffled samples of Gaussians.

    Args:
        rng: source of the random numbers.
        counts: (K,), number of samples of each Gaussian.
        means: (K, d), means of the Gaussians.
        covariances: (K, d, d), their covariances.
    """
    sizes, m, C = np.asarray(counts, dtype=int), np.asarray(means, dtype=float), np.asarray(covariances, dtype=float)
    X = np.vstack(
        [rng.multivariate_normal(mean, covariance, n) for n, mean, covariance in zip(sizes, m, C, strict=True)]
    )
    y = np.repeat(np.arange(len(sizes)), sizes)
    order = rng.permutation(len(X))
    return X[order], y[order]


def ellipse(major: float, minor: float, degrees: float) -> Array:
    """Covariance (2, 2) of an ellipse with the given standard deviations and direction of the major axis."""
    t = np.deg2rad(degrees)
    R = np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]])
    covariance: Array = R @ np.diag([major**2, minor**2]) @ R.T
    return covariance


def spheres(seed: int) -> tuple[Samples, Labels]:
    """Four spherical clusters of different size and density, after Frigui and Krishnapuram 1997, figure 1."""
    return gaussian_mixture(
        np.random.default_rng(seed),
        [60, 220, 250, 45],
        [(25, 78), (74, 74), (25, 24), (78, 24)],
        [np.eye(2) * variance for variance in (16, 100, 81, 7)],
    )


def ellipses(seed: int) -> tuple[Samples, Labels]:
    """Six ellipsoids, 1,100 points, after Frigui and Krishnapuram 1997, figure 2."""
    shapes = [(8.5, 4, 35), (9, 4, -40), (7, 6.5, 0), (11.5, 3.5, 72), (2.6, 2.6, 0), (5, 5, 0)]
    return gaussian_mixture(
        np.random.default_rng(seed),
        [220, 180, 180, 280, 70, 170],
        [(25, 75), (74, 76), (49, 50), (25, 30), (48, 14), (78, 20)],
        [ellipse(*shape) for shape in shapes],
    )


def separated(seed: int, c: float = 2.0, N: int = 3000, d: int = 14, K: int = 6) -> tuple[Samples, Labels]:
    """K Gaussians with full covariances and log-uniform spectra, with c-separated centres.

    Two Gaussians are c-separated if their means are at least c sqrt(max(trace C_1, trace C_2)) apart (Dasgupta,
    "Learning mixtures of Gaussians", FOCS 1999).
    """
    rng = np.random.default_rng(seed)
    covariances = []
    for _ in range(K):
        Q, _ = np.linalg.qr(rng.normal(size=(d, d)))
        covariances.append(Q @ np.diag(np.exp(rng.uniform(np.log(0.05), 0, d))) @ Q.T)
    traces = [np.trace(F) for F in covariances]
    means: list[Samples] = []
    spread = 1.0
    while len(means) < K:
        mean = rng.normal(size=d) * spread * np.sqrt(max(traces)) * c / np.sqrt(2 * d)
        new = len(means)
        if all(
            np.linalg.norm(mean - other) >= c * np.sqrt(max(traces[i], traces[new])) for i, other in enumerate(means)
        ):
            means.append(mean)
        else:
            spread *= 1.02
    shares = np.maximum(rng.dirichlet(np.full(K, 3.0)), 0.04)
    return gaussian_mixture(rng, rng.multinomial(N, shares / shares.sum()), means, covariances)


def insertion(seed: int, N: int = 3000, T: int = 30) -> tuple[Samples, Labels]:
    """T demonstrations of an insertion in 14 channels, with six contact states that are not Gaussian.

    The channels are position (mm), force (N), moment (N mm), axis, angle and change of angle (rad). Within a
    demonstration the offset, the axis and the initial angle are nearly constant, the moment is r x F, and the force is
    nearly zero in free motion. A larger N means a higher sampling rate, not more demonstrations.
    """
    rng = np.random.default_rng(seed)
    X, y = [], []
    for _ in range(T):
        counts = np.maximum(4, np.round(N // T * SHARES * rng.uniform(0.7, 1.3, 6))).astype(int)
        offset = rng.normal(0, 1.0, 2)
        axis = rng.normal(size=3) * [1, 1, 0.15]
        axis /= np.linalg.norm(axis)
        tilt = abs(rng.normal(0.10, 0.02))
        for state, n in enumerate(counts):
            begin, end = VISITS[state]
            across, z, pushed, fz, turned = (begin + np.linspace(0, 1, n)[:, None] * np.subtract(end, begin)).T
            position = np.column_stack([np.outer(across, offset), z]) + rng.normal(0, 0.03, (n, 3))
            force = np.column_stack([np.outer(pushed, offset), fz]) + rng.normal(0, 0.15 if state else 0.01, (n, 3))
            moment = np.cross(np.array([0, 0, 15.0]) + rng.normal(0, 0.2, (n, 3)), force)
            axes = axis + rng.normal(0, 0.02, (n, 3))
            axes /= np.linalg.norm(axes, axis=1, keepdims=True)
            angle = tilt * turned + rng.normal(0, 0.002, n)
            change = np.diff(angle, prepend=angle[0] + rng.normal(0, 0.003))
            X.append(np.column_stack([position, force, moment, axes, angle, change]))
            y.append(np.full(n, state))
    return np.vstack(X), np.concatenate(y)


SHARES = np.array([0.22, 0.16, 0.18, 0.12, 0.26, 0.06])
"""Of the time of a demonstration, of each state."""

VISITS = np.array(
    [
        [[1.00, 30.0, 0.0, 0.0, 1.00], [0.80, 2.0, 0.0, 0.0, 1.00]],  # free approach
        [[0.80, 2.0, 0.3, 4.0, 1.00], [0.50, 2.0, 0.3, 5.5, 0.90]],  # sliding on the face
        [[0.50, 2.0, 1.6, 2.0, 0.90], [0.10, 1.0, 1.1, 2.3, 0.50]],  # on the chamfer
        [[0.10, 1.0, 2.5, 7.0, 0.50], [0.10, 0.5, 2.5, 8.0, 0.40]],  # two-point contact
        [[0.03, 0.5, 0.5, 1.2, 0.40], [0.03, -19.5, 0.5, 2.0, 0.02]],  # insertion
        [[0.03, -19.5, 0.1, 12.0, 0.02], [0.03, -19.5, 0.1, 12.0, 0.02]],  # on the bottom
    ]
)
"""At the begin and the end of each state: position (mm) and force (N) across, in units of the offset, and along; and
the angle in units of the initial one."""


def demonstrations_and_phase(y: Labels) -> tuple[Labels, Samples]:
    """Number of the demonstration (N,) and normalised time in [0, 1) (N,) of each sample of `insertion`."""
    starts = np.r_[0, np.flatnonzero((y[:-1] == 5) & (y[1:] == 0)) + 1, len(y)]
    groups = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    phase = np.concatenate([np.arange(n) / n for n in np.diff(starts)])
    return groups, phase


def with_outliers(seed: int) -> tuple[Samples, Labels]:
    """The ellipses with 5 % of uniform outliers, which belong to no cluster (label -1)."""
    X, y = ellipses(seed)
    rng = np.random.default_rng(seed + 1)
    n = len(X) // 20
    return np.vstack([X, rng.uniform(-20, 120, (n, 2))]), np.r_[y, np.full(n, -1)]
