"""Partial pooling: how far the context matters at a query.

Near the mouth the demonstrations of two contexts act in opposite ways; deep in the hole they act alike. Where they act
alike, a regression should use all of them: half of the samples is half of the evidence. Whether they do is a comparison
of means. With the kernel weights w_i of the samples near the query, a demonstration g has the weight and the mean

    W_g = sum_{i in g} w_i,   m_g = sum_{i in g} w_i y_i / W_g,

and a context with the probabilities r_gc, the weight U_c = sum_g r_gc W_g and a_gc = r_gc W_g / U_c has

    mean                   m_c = sum_g a_gc m_g,
    number                 n_c = 1 / sum_g a_gc^2,
    variance of the mean   V_c = sum_g a_gc |m_g - m_c|^2 / (n_c - 1).

The samples of a demonstration repeat each other, so that V counts demonstrations, not samples. The squared difference
of two means overestimates that of their contexts by V_c + V_c'. The share that is not chance, over all pairs of
contexts with more than one demonstration near the query, is (by moments, as in an empirical Bayes estimate)

    B = max(0, 1 - sum_{c<c'} U_c U_c' (V_c + V_c') / sum_{c<c'} U_c U_c' |m_c - m_c'|^2).

The query then is in the context with B times the probability that was believed, and in any context with the rest.

Source: Gelman, Hill, "Data analysis using regression and multilevel/hierarchical models", 2007, chapter 12.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from skill.arrays import Array

ROUND_OFF = 1e-10
"""Largest difference, relative to the greatest output, and largest excess over one demonstration, that count as
round-off."""

MIN_WEIGHT = float(np.finfo(float).tiny)
"""Of a demonstration, so that one whose kernel weights underflow has a mean."""


def relevance(weights: Array, outputs: Array, groups: ArrayLike, memberships: Array) -> float:
    """Returns B, from 0 if the contexts act alike, to 1 if they certainly do not.

    Args:
        weights: (k,), kernel weights of the samples, not negative; the greatest is of the order of 1.
        outputs: (k, p), outputs in which a difference counts.
        groups: (k,), name of the demonstration of each sample.
        memberships: (k, C), probabilities of the contexts of each sample, the same within a demonstration.

    Returns:
        B; 0 if fewer than two contexts have more than one demonstration near the query.
    """
    _, first, group = np.unique(groups, return_index=True, return_inverse=True)
    W = np.maximum(np.bincount(group, weights), MIN_WEIGHT)
    means = np.column_stack([np.bincount(group, weights * y) for y in outputs.T]) / W[:, None]
    known = [found for r in memberships[first].T if (found := _mean_of_context(r * W, means)) is not None]
    chance = squared = 0.0
    for (size, mean, variance), (other_size, other_mean, other_variance) in combinations(known, 2):
        difference = mean - other_mean
        chance += size * other_size * (variance + other_variance)
        squared += size * other_size * float(difference @ difference)
    total = sum(size * other_size for (size, *_), (other_size, *_) in combinations(known, 2))
    if squared <= ROUND_OFF**2 * float((outputs**2).max()) * total:
        return 0.0
    return max(0.0, 1.0 - chance / squared)


def _mean_of_context(weights: Array, means: Array) -> tuple[float, Array, float] | None:
    """The weight, mean (p,) and variance of the mean of demonstrations (G,); None if there is but one."""
    size = float(weights.sum())
    if size <= 0.0:
        return None
    share = weights / size
    more_than_one = 1.0 / float(share @ share) - 1.0
    if more_than_one <= ROUND_OFF:
        return None
    mean = share @ means
    return size, mean, float(share @ ((means - mean) ** 2).sum(axis=1)) / more_than_one
