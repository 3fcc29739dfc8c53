"""Partial pooling: how far the context matters at a query.

Near the mouth the demonstrations of two contexts act in opposite ways; deep in the hole they act alike. Where they act
alike, a regression should use all of them: half of the samples is half of the evidence. Whether they do is a comparison
of two means. With the kernel weights w_i of the samples near the query, a demonstration g has the weight and the mean

    W_g = sum_{i in g} w_i,   m_g = sum_{i in g} w_i y_i / W_g,

and the demonstrations together, with the probabilities r_g of the context and a_g = r_g W_g / sum_h r_h W_h, have

    mean                   m = sum_g a_g m_g,
    number                 n = 1 / sum_g a_g^2,
    variance of the mean   V = sum_g a_g (m_g - m)^2 / (n - 1).

The others, with 1 - r_g, have m', n', V' likewise. The samples of a demonstration repeat each other, so that V counts
demonstrations, not samples. The square of the difference d = m - m' of the means overestimates that of the contexts by
the variance of d. The share of it that is not chance is (by moments, as in an empirical Bayes estimate)

    B = max(0, 1 - trace(V + V') / |d|^2).

The query then is in the context with B times the probability that was believed, and in any context with the rest.

Source: Gelman, Hill, "Data analysis using regression and multilevel/hierarchical models", 2007, chapter 12.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from skill.arrays import Array

ROUND_OFF = 1e-10
"""Largest difference, relative to the greatest output, and largest excess over one demonstration, that count as
round-off."""

MIN_WEIGHT = float(np.finfo(float).tiny)
"""Of a demonstration, so that one whose kernel weights underflow has a mean."""


def relevance(weights: Array, outputs: Array, groups: ArrayLike, memberships: Array) -> float:
    """Returns B, from 0 if the samples of a context act like the others, to 1 if they certainly do not.

    Args:
        weights: (k,), kernel weights of the samples, not negative; the greatest is of the order of 1.
        outputs: (k, p), outputs in which a difference counts.
        groups: (k,), name of the demonstration of each sample.
        memberships: (k,), probability of the context of each sample, the same within a demonstration.

    Returns:
        B; 0 if the context or the others have a single demonstration near the query.
    """
    _, first, group = np.unique(groups, return_index=True, return_inverse=True)
    W = np.maximum(np.bincount(group, weights), MIN_WEIGHT)
    means = np.column_stack([np.bincount(group, weights * y) for y in outputs.T]) / W[:, None]
    difference: Array = np.zeros(outputs.shape[1])
    variance = 0.0
    for sign, r in ((1.0, memberships[first]), (-1.0, 1.0 - memberships[first])):
        total = r @ W
        if total <= 0.0:
            return 0.0
        share = r * W / total
        mean = share @ means
        more_than_one = 1.0 / float(share @ share) - 1.0
        if more_than_one <= ROUND_OFF:
            return 0.0
        difference += sign * mean
        variance += float(share @ ((means - mean) ** 2).sum(axis=1)) / more_than_one
    squared = float(difference @ difference)
    if squared <= ROUND_OFF**2 * float((outputs**2).max()):
        return 0.0
    return max(0.0, 1.0 - variance / squared)
