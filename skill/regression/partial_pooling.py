"""Partial pooling: how far the context matters at a query.

Near the mouth the demonstrations of two contexts act in opposite ways; deep in the hole they act alike. Where they act
alike, a regression should use all of them: half of the samples is half of the evidence. Whether they do is a comparison
of two means. With the kernel weights w_i of the samples near the query, and their sums over each demonstration,

    W_g = sum_{i in g} w_i,   S_g = sum_{i in g} w_i y_i,

the demonstrations with the probabilities r_g of the context have

    mean                   m = sum_g r_g S_g / W,   W = sum_g r_g W_g,
    number                 n = W^2 / sum_g (r_g W_g)^2,
    variance of the mean   V = n / (n - 1) sum_g (r_g (S_g - W_g m))^2 / W^2,

and the others, with 1 - r_g, likewise m', n', V'. The samples of a demonstration repeat each other, so that V counts
demonstrations, not samples (the cluster-robust variance). The difference d = m - m' of the means overestimates that of
the contexts by its own variance. The share of it that is not chance is the positive-part James-Stein factor

    B = max(0, 1 - trace(V + V') / |d|^2).

The query then is in the context with B times the probability that was believed, and in any context with the rest.

Sources: James, Stein, "Estimation with quadratic loss", 4th Berkeley Symposium, 1961. Liang, Zeger, "Longitudinal data
analysis using generalized linear models", Biometrika 73, 1986. Gelman, Hill, "Data analysis using regression and
multilevel/hierarchical models", 2007, chapter 12.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from skill.arrays import Array

ROUND_OFF = 1e-20
"""Largest square of a difference, relative to that of the greatest output, that counts as round-off."""


def relevance(weights: Array, outputs: Array, groups: ArrayLike, memberships: Array) -> float:
    """Returns B, from 0 if the samples of a context act like the others, to 1 if they certainly do not.

    Args:
        weights: (k,), kernel weights of the samples, not negative.
        outputs: (k, p), outputs in which a difference counts.
        groups: (k,), name of the demonstration of each sample.
        memberships: (k,), probability of the context of each sample, the same within a demonstration.

    Returns:
        B; 0 if the context or the others have a single demonstration near the query.
    """
    _, first, group = np.unique(groups, return_index=True, return_inverse=True)
    W = np.bincount(group, weights)
    S = np.column_stack([np.bincount(group, weights * y) for y in outputs.T])
    difference, variance = np.zeros(outputs.shape[1]), 0.0
    for sign, r in ((1.0, memberships[first]), (-1.0, 1.0 - memberships[first])):
        total, squares = r @ W, ((r * W) ** 2).sum()
        if total**2 <= squares:
            return 0.0
        mean = r @ S / total
        n = total**2 / squares
        spread = r[:, None] * (S - W[:, None] * mean) / total
        difference += sign * mean
        variance += n / (n - 1.0) * float((spread**2).sum())
    squared = float(difference @ difference)
    if squared <= ROUND_OFF * float((outputs**2).max()):
        return 0.0
    return max(0.0, 1.0 - variance / squared)
