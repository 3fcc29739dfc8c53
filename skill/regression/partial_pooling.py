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

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array
from skill.compiled import compiled

ROUND_OFF = 1e-10
"""Largest difference, relative to the greatest output, and largest excess over one demonstration, that count as
round-off."""

MIN_WEIGHT = float(np.finfo(float).tiny)
"""Of a demonstration, so that one whose kernel weights underflow has a mean."""


@compiled
def relevance(weights: Array, outputs: Array, groups: NDArray[np.int64], memberships: Array) -> float:
    """Returns B, from 0 if the contexts act alike, to 1 if they certainly do not.

    Args:
        weights: (k,), kernel weights of the samples, not negative; the greatest is of the order of 1.
        outputs: (k, p), outputs in which a difference counts.
        groups: (k,), number of the demonstration of each sample, not negative.
        memberships: (k, C), probabilities of the contexts of each sample, the same within a demonstration.

    Returns:
        B; 0 if fewer than two contexts have more than one demonstration near the query.
    """
    G, C, p = groups.max() + 1, memberships.shape[1], outputs.shape[1]
    W, means, r = np.zeros(G), np.zeros((G, p)), np.zeros((G, C))
    present = np.zeros(G, np.bool_)
    largest = 0.0
    for i in range(len(weights)):
        g = groups[i]
        W[g] += weights[i]
        present[g] = True
        r[g] = memberships[i]
        for j in range(p):
            means[g, j] += weights[i] * outputs[i, j]
            largest = max(largest, outputs[i, j] ** 2)
    for g in range(G):
        W[g] = max(W[g], MIN_WEIGHT) if present[g] else 0.0
        if present[g]:
            means[g] /= W[g]
    size, centre, variance = np.zeros(C), np.zeros((C, p)), np.zeros(C)
    for c in range(C):
        total, squares = (r[:, c] * W).sum(), 0.0
        if total <= 0.0:
            continue
        for g in range(G):
            share = r[g, c] * W[g] / total
            squares += share * share
            centre[c] += share * means[g]
        if 1.0 / squares - 1.0 <= ROUND_OFF:  # one demonstration only
            continue
        for g in range(G):
            variance[c] += r[g, c] * W[g] / total * ((means[g] - centre[c]) ** 2).sum()
        variance[c] /= 1.0 / squares - 1.0
        size[c] = total
    chance, squared, pairs = 0.0, 0.0, 0.0
    for c in range(C):
        for other in range(c):
            both = size[c] * size[other]
            pairs += both
            chance += both * (variance[c] + variance[other])
            squared += both * ((centre[c] - centre[other]) ** 2).sum()
    if squared <= ROUND_OFF**2 * largest * pairs:
        return 0.0
    return max(0.0, 1.0 - chance / squared)
