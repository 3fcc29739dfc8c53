"""The neighbourhood of a query: the samples of its local model, and their kernel weights.

Each state has its own index of the samples that may be in it. A query searches the indices of the states that it may be
in. Usually this is one index, which is smaller than the whole and contains no samples that would get no weight.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compiled import compiled
from skill.arrays import Array

Rows = NDArray[np.intp]

STRIDE = 16
"""Distance of the values that a selection looks at first."""

MIN_LOG = -1e300
"""Minimum logarithm of the weight of a distance; it avoids infinite values, whose differences are NaN."""

NEGLIGIBLE = 1e-3
"""States with at most this probability are not searched, though they count in the weights. This bounds the weight of a
sample that the search leaves out, relative to a sample at the same distance in a certain state."""

MIN_SHARE = 1e-300
"""Minimum probability that a sample shares the state of the query. If all samples have only this share, the distance
alone decides, and the tiny weights turn the local model into a kernel mean and report that support is missing."""


class SearchNumbers(NamedTuple):
    """The samples, those of one state after the other; the last part holds all of them.

    Attributes:
        points: (n, d), scaled features.
        augmented: (d + 1, m), of each part -2 times the centred features, and their squared norms.
        centres: (K + 1, d), of the parts.
        rows: (m,), row numbers.
        starts: (K + 2,), where each part begins, and the end.
        memberships: (n, K), contact-state probabilities of the samples; (n, 1) without states.
        log_weight: (n,), logarithms of the sample weights.
    """

    points: Array
    augmented: Array
    centres: Array
    rows: Rows
    starts: Rows
    memberships: Array
    log_weight: Array

    @classmethod
    def of(cls, points: Array, memberships: Array | None, sample_weight: Array) -> Self:
        """Returns the search of samples (n, d) with contact-state probabilities (n, K) and positive weights (n,).

        Without probabilities all samples are in one state.
        """
        n, d = points.shape
        P = np.ones((n, 1)) if memberships is None else np.ascontiguousarray(memberships)
        parts = [*(np.flatnonzero(share > NEGLIGIBLE) for share in P.T), np.arange(n)]
        centres, augmented = np.zeros((len(parts), d)), []
        for centre, rows in zip(centres, parts, strict=True):
            if rows.size:
                centre[:] = points[rows].mean(axis=0)
            # |x - q|^2 is |x|^2 - 2 x.q up to a constant; centring limits the cancellation.
            centred = points[rows] - centre
            augmented.append(np.column_stack([-2.0 * centred, np.einsum("ij,ij->i", centred, centred)]))
        starts = np.cumsum([0, *map(len, parts)])
        searched = np.ascontiguousarray(np.vstack(augmented).T)
        return cls(points, searched, centres, np.concatenate(parts), starts, P, np.log(sample_weight))


class RegressionNumbers(NamedTuple):
    """A locally weighted regression for compiled functions.

    Attributes:
        search: the samples.
        feature_scale: (d,).
        y: (n, p), outputs.
        bandwidth: h of the kernel exp(-distance^2 / h^2).
        k: largest number of neighbours, at most n.
        ridge: penalty of the squared slope.
        degree: 0 or 1.
    """

    search: SearchNumbers
    feature_scale: Array
    y: Array
    bandwidth: float
    k: int
    ridge: float
    degree: int


@compiled
def neighbourhood(p: RegressionNumbers, query: Array, q: Array) -> tuple[Rows, Array]:
    """Returns rows (k,) and log weights (k,) of the neighbourhood of one query.

    Args:
        p: the regression.
        query: (d,), scaled.
        q: (K,), contact-state probabilities of the query; one, if the samples have no states.
    """
    s, k = p.search, p.k
    K, n = len(q), len(s.log_weight)
    found, squares = np.empty(n, np.int64), np.empty(n)
    taken = np.zeros(n, np.bool_)
    count = 0
    for state in range(K):
        if q[state] > NEGLIGIBLE:
            count = _add_nearest(s, query, state, k, taken, found, squares, count)
    if count == 0:  # no sample is in a state of the query: search all of them
        count = _add_nearest(s, query, K, k, taken, found, squares, count)
    found, squares = found[:count], squares[:count]
    h2 = p.bandwidth**2
    log_w = np.empty(count)
    for i in range(count):
        row, share = found[i], 0.0
        for state in range(K):
            share += s.memberships[row, state] * q[state]
        log_w[i] = max(-squares[i] / h2, MIN_LOG) + math.log(max(share, MIN_SHARE)) + s.log_weight[row]
    if count > k:
        keep = smallest(-log_w, k)
        return found[keep], log_w[keep]
    return found, log_w


@compiled
def _add_nearest(
    p: SearchNumbers, query: Array, part: int, k: int, taken: NDArray[np.bool_], found: Rows, squares: Array, count: int
) -> int:
    """Adds those of the k nearest samples of a part that are not taken yet; returns the number of all."""
    start, end = p.starts[part], p.starts[part + 1]
    d, size = len(query), end - start
    if size > k:
        relative = p.augmented[d, start:end].copy()
        for i in range(d):
            offset, points = query[i] - p.centres[part, i], p.augmented[i, start:end]
            for j in range(size):
                relative[j] += offset * points[j]
        near = smallest(relative, k)
    else:
        near = np.arange(size)
    for j in near:
        row = p.rows[start + j]
        if not taken[row]:
            taken[row] = True
            square = 0.0
            for i in range(d):
                square += (p.points[row, i] - query[i]) ** 2
            found[count], squares[count] = row, square
            count += 1
    return count


@compiled
def smallest(values: Array, k: int) -> Rows:
    """Returns the places (k,) of the k smallest values; of equal ones the first.

    A limit from every `STRIDE`-th value sorts out most of many values before the selection, which takes much longer.
    """
    n = len(values)
    places, count = np.empty(n, np.int64), 0
    if n > 4 * k:
        some = values[::STRIDE].copy()
        rank = min(len(some) - 1, 4 + 3 * k * len(some) // (2 * n))
        limit = selected(some, rank)
        for j in range(n):
            places[count] = j
            count += values[j] <= limit
    if count < k:
        places, count = np.arange(n), n
    places = places[:count]
    near = values[places]
    limit = selected(near.copy(), k - 1)
    found, number = np.arange(k), 0  # of NaN none is the smallest: places that exist
    for i in range(count):
        if near[i] < limit:
            found[number] = places[i]
            number += 1
    for i in range(count):
        if number < k and near[i] == limit:
            found[number] = places[i]
            number += 1
    return found


@compiled
def selected(values: Array, k: int) -> float:
    """Returns the value that sorting would put at place ``k``; changes the order (Hoare, "Algorithm 65: Find", 1961).

    Numba's ``partition`` does the same; its compilation takes seconds.
    """
    low, high = 0, len(values) - 1
    while low < high:
        pivot, i, j = values[k], low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while pivot < values[j]:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i, j = i + 1, j - 1
        low, high = i if j < k else low, j if k < i else high
    return float(values[k])


def check_memberships(values: ArrayLike, n: int, states: int | None = None, exact: bool = False) -> Array:
    """Checks memberships.

    Args:
        values: (n, K), non-negative, each row with a sum of one; or of at most one, unless ``exact``.
        n: expected number of rows.
        states: expected number K of states, or None if unknown.
        exact: whether the rows must sum to one.

    Returns:
        The memberships as an array (n, K).

    Raises:
        ValueError: if the shape is wrong, or the values are not probabilities.
    """
    P = np.asarray(values, dtype=float)
    if P.ndim != 2 or P.shape[0] != n or P.shape[1] != (states or P.shape[1]) or P.shape[1] == 0:
        expected = "K, one column a contact state" if states is None else f"{states}"
        raise ValueError(f"memberships have shape {P.shape}, expected ({n}, {expected}); one row a sample")
    if n == 0:
        return P
    low, sums = P.min(), P.sum(axis=1)
    if not (low >= 0.0 and sums.max() <= 1.0 + 1e-6 and (not exact or sums.min() >= 1.0 - 1e-6)):
        at_most = "" if exact else "at most "
        raise ValueError(
            f"memberships are not probabilities: minimum {low:.3g}, row sums from {sums.min():.3g} to"
            f" {sums.max():.3g}; expected non-negative rows that sum to {at_most}one: divide each by its sum"
        )
    return P
