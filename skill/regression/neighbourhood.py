"""The neighbourhood of a query: the samples of its local model, and their kernel weights.

Each state has its own index of the samples that may be in it. A query searches the indices of the states that it may be
in. Usually this is one index, which is smaller than the whole and contains no samples that would get no weight.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compiled import compiled
from skill.arrays import Array

Rows = NDArray[np.intp]

BLOCK = 1 << 17
"""Numbers in one block of a batch (queries times neighbours times features); a block fits into the cache."""

SEARCH_BLOCK = 1 << 18
"""Number of distances that are computed, or of candidates that are found, for many queries together."""

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


class NeighbourIndex:
    """Search for the k nearest of n points in Euclidean distance, by all distances.

    Args:
        points: (n, d), scaled.
        rows: (n,), row numbers that the search returns for the points; 0..n-1 if None.
    """

    def __init__(self, points: Array, rows: Rows | None = None) -> None:
        self.rows = np.arange(len(points)) if rows is None else rows
        self.size = len(points)
        # |x - q|^2 is |x|^2 - 2 x.q up to a constant; centring limits the cancellation.
        self.centre = points.mean(axis=0)
        centred = points - self.centre
        norms = np.einsum("ij,ij->i", centred, centred)
        self.augmented = np.ascontiguousarray(np.column_stack([-2.0 * centred, norms]).T)

    def nearest_many(self, queries: Array, k: int) -> Rows:
        """Rows (m, k') of the k' = min(k, n) nearest to each query (m, d), in no particular order."""
        m = len(queries)
        if k >= self.size:
            return np.broadcast_to(self.rows, (m, self.size))
        extended = np.column_stack([queries - self.centre, np.ones(m)])
        found = np.empty((m, k), dtype=np.intp)
        step = max(1, SEARCH_BLOCK // self.size)
        for start in range(0, m, step):
            relative = extended[start : start + step] @ self.augmented
            found[start : start + step] = np.argpartition(relative, k - 1, axis=1)[:, :k]
        return self.rows[found]


class MembershipIndex:
    """Finds candidates for the neighbourhood of a query, and the probabilities that they share its state.

    Args:
        points: (n, d), scaled.
        memberships: (n, K), contact-state probabilities of the points, or None.
    """

    def __init__(self, points: Array, memberships: Array | None) -> None:
        self.whole = NeighbourIndex(points)
        self._memberships = memberships
        self.states: list[NeighbourIndex | None] = []
        if memberships is None:
            return
        for state in range(memberships.shape[1]):
            rows = np.flatnonzero(memberships[:, state] > NEGLIGIBLE)
            self.states.append(NeighbourIndex(points[rows], rows) if rows.size else None)

    def candidates(self, queries: Array, Q: Array | None, k: int) -> tuple[Rows, Array | None]:
        """Candidates of many queries.

        Args:
            queries: (m, d), scaled.
            Q: (m, K), contact-state probabilities of the queries; None ignores the states.
            k: number of nearest samples to find in each state.

        Returns:
            Rows (m, c) of the candidates, c >= min(k, n), and the logarithms (m, c) of the probabilities
            sum_k Q_qk P_ik that query and candidate share their state. Queries with fewer than c candidates are padded
            with repeated rows of log probability -inf. The second value is None if Q is None.
        """
        if Q is None:
            return self.whole.nearest_many(queries, k), None
        active = Q > NEGLIGIBLE
        patterns, which = np.unique(active, axis=0, return_inverse=True)
        if len(patterns) == 1:
            return self._of_states(queries, Q, np.flatnonzero(patterns[0]), k)
        parts = []
        for i, pattern in enumerate(patterns):
            members = np.flatnonzero(which.ravel() == i)
            found, log_share = self._of_states(queries[members], Q[members], np.flatnonzero(pattern), k)
            parts.append((members, found, log_share))
        width = max(found.shape[1] for _, found, _ in parts)
        rows = np.zeros((len(queries), width), dtype=np.intp)
        log_shares = np.full((len(queries), width), -np.inf)
        for members, found, log_share in parts:
            rows[members, : found.shape[1]] = found
            log_shares[members, : found.shape[1]] = log_share
        return rows, log_shares

    def _of_states(self, queries: Array, Q: Array, states: Rows, k: int) -> tuple[Rows, Array]:
        indices = [index for state in states if (index := self.states[state]) is not None]
        if not indices:  # no sample is in the state of the query: search all samples
            indices = [self.whole]
        found = np.hstack([index.nearest_many(queries, k) for index in indices])
        if len(indices) == 1:
            return found, self._log_share(found, Q)
        # A sample that may be in two states is found twice but counts once.
        found = np.sort(found, axis=1)
        log_share = self._log_share(found, Q)
        log_share[:, 1:][found[:, 1:] == found[:, :-1]] = -np.inf
        return found, log_share

    def _log_share(self, found: Rows, q: Array) -> Array:
        """Logarithms of the shared-state probabilities of samples (..., c) and queries (..., K)."""
        assert self._memberships is not None
        share = (self._memberships[found] @ q[..., None])[..., 0]
        return np.asarray(np.log(np.maximum(share, MIN_SHARE, out=share), out=share), dtype=np.float64)


@dataclass(frozen=True)
class Kernel:
    """The Gaussian kernel exp(-distance^2 / h^2), limited to the nearest samples.

    Attributes:
        bandwidth: h; if ``adaptive``, h over the distance to the farthest neighbour used.
        adaptive: whether the bandwidth is relative to that distance.
        n_neighbors: maximum number of samples; None for all.
    """

    bandwidth: float
    adaptive: bool = False
    n_neighbors: int | None = None


def kernel_numbers(kernel: Kernel, n: int) -> tuple[float, bool, int]:
    """Returns bandwidth, whether it is adaptive, and the number of neighbours among n samples."""
    k = n if kernel.n_neighbors is None else min(kernel.n_neighbors, n)
    return float(kernel.bandwidth), kernel.adaptive, k


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
    def of(
        cls,
        points: Array,
        memberships: Array | None,
        log_weight: Array,
        indices: Sequence[NeighbourIndex | None],
    ) -> Self:
        """Returns the search of samples (n, d), in the index of each state, then in that of all."""
        P = np.ones((len(points), 1)) if memberships is None else np.ascontiguousarray(memberships)
        used = [index for index in indices if index is not None]
        return cls(
            points,
            np.ascontiguousarray(np.hstack([index.augmented for index in used])),
            np.array([np.zeros(points.shape[1]) if index is None else index.centre for index in indices]),
            np.concatenate([index.rows for index in used]),
            np.cumsum([0, *(0 if index is None else index.size for index in indices)]),
            P,
            log_weight,
        )


@compiled
def neighbourhood_of_one(
    p: SearchNumbers, query: Array, q: Array, bandwidth: float, adaptive: bool, k: int
) -> tuple[Rows, Array]:
    """Returns rows and log weights of the neighbourhood of one query; see `KernelNeighbourhood.of_one`.

    Args:
        p: the samples.
        query: (d,), scaled.
        q: (K,), contact-state probabilities of the query.
        bandwidth: see `Kernel`.
        adaptive: see `Kernel`.
        k: largest number of neighbours.
    """
    K, n = len(q), len(p.log_weight)
    found, squares = np.empty(n, np.int64), np.empty(n)
    taken = np.zeros(n, np.bool_)
    count = 0
    for state in range(K):
        if q[state] > NEGLIGIBLE:
            count = _add_nearest(p, query, state, k, taken, found, squares, count)
    if count == 0:  # no sample is in a state of the query: search all of them
        count = _add_nearest(p, query, K, k, taken, found, squares, count)
    found, squares = found[:count], squares[:count]
    h2 = bandwidth**2
    if adaptive:
        farthest = np.partition(squares, min(k, count) - 1)[min(k, count) - 1]
        # If all neighbours coincide with the query, their weights are equal for any bandwidth.
        h2 *= farthest if farthest > 0.0 else 1.0
    log_w = np.empty(count)
    for i in range(count):
        row, share = found[i], 0.0
        for state in range(K):
            share += p.memberships[row, state] * q[state]
        log_w[i] = max(-squares[i] / h2, MIN_LOG) + math.log(max(share, MIN_SHARE)) + p.log_weight[row]
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
        limit = np.partition(some, rank)[rank]
        for j in range(n):
            places[count] = j
            count += values[j] <= limit
    if count < k:
        places, count = np.arange(n), n
    places = places[:count]
    near = values[places]
    limit = np.partition(near, k - 1)[k - 1]
    found, number = np.empty(k, np.int64), 0
    for i in range(count):
        if near[i] < limit:
            found[number] = places[i]
            number += 1
    for i in range(count):
        if number < k and near[i] == limit:
            found[number] = places[i]
            number += 1
    return found


class KernelNeighbourhood:
    """Finds neighbourhoods among n samples.

    Args:
        points: (n, d), scaled features.
        memberships: (n, K), contact-state probabilities, or None.
        sample_weight: (n,), positive.
    """

    def __init__(self, points: Array, memberships: Array | None, sample_weight: Array) -> None:
        self._points, self._samples = points, (points, memberships, sample_weight)
        self._index = MembershipIndex(points, memberships)
        uniform = bool((sample_weight == 1.0).all())
        self._log_sample_weight = None if uniform else np.log(sample_weight)
        log_weight, states, whole = np.log(sample_weight), self._index.states, self._index.whole
        self.stateless = SearchNumbers.of(points, None, log_weight, [whole, whole])
        self.numbers = self.stateless
        if memberships is not None:
            self.numbers = SearchNumbers.of(points, memberships, log_weight, [*states, whole])

    def __reduce__(self) -> tuple[Any, ...]:
        """Leaves the indices out, which are ten times as large as the samples: a copy computes them again."""
        return KernelNeighbourhood, self._samples

    def of_one(self, query: Array, q: Array | None, kernel: Kernel) -> tuple[Rows, Array]:
        """The neighbourhood of one query.

        Args:
            query: (d,), scaled.
            q: (K,), contact-state probabilities of the query; None ignores the states.
            kernel: the kernel.

        Returns:
            Rows (k,) and log weights (k,).
        """
        numbers, shares = (self.stateless, np.ones(1)) if q is None else (self.numbers, np.array(q))
        return neighbourhood_of_one(numbers, query, shares, *kernel_numbers(kernel, len(self._points)))

    def blocks(
        self, queries: Array, Q: Array | None, kernel: Kernel, extra: int = 0
    ) -> Iterator[tuple[slice, Rows, Array, Array]]:
        """The neighbourhoods of many queries, block by block.

        Args:
            queries: (m, d), scaled.
            Q: (m, K), contact-state probabilities of the queries; None ignores the states.
            kernel: the kernel.
            extra: number of additional neighbours, for callers that leave some out.

        Yields:
            A slice of b queries, with rows (b, k), samples (b, k, d) and log weights (b, k).
        """
        for _, block, found, x, log_w in self.blocks_of_kernels(queries, Q, [kernel], extra):
            yield block, found, x, log_w

    def blocks_of_kernels(
        self, queries: Array, Q: Array | None, kernels: Sequence[Kernel], extra: int = 0
    ) -> Iterator[tuple[int, slice, Rows, Array, Array]]:
        """The same for several kernels that differ in their bandwidths only; the neighbours are searched once.

        Yields:
            The number of the kernel, then the values of `blocks`.
        """
        k = self._count(kernels[0], extra)
        step = max(1, BLOCK // (k * self._points.shape[1]))
        stride = step * max(1, SEARCH_BLOCK // (k * step))
        for first in range(0, len(queries), stride):
            many = slice(first, min(first + stride, len(queries)))
            found, log_share = self._index.candidates(queries[many], None if Q is None else Q[many], k)
            for start in range(first, many.stop, step):
                block = slice(start, min(start + step, many.stop))
                part = slice(block.start - first, block.stop - first)
                for number, kernel in enumerate(kernels):
                    share = None if log_share is None else log_share[part]
                    yield number, block, *self._weighted(queries[block], found[part], share, kernel, k)

    def _weighted(
        self, queries: Array, found: Rows, log_share: Array | None, kernel: Kernel, k: int
    ) -> tuple[Rows, Array, Array]:
        """Rows, samples and log weights of the k candidates with the greatest weights, among (b, c)."""
        x = self._points[found]
        offset = x - queries[:, None, :]
        log_w = self._log_weights(np.einsum("mkd,mkd->mk", offset, offset), found, log_share, kernel, k)
        if found.shape[1] > k:
            keep = np.argpartition(-log_w, k - 1, axis=1)[:, :k]
            found, log_w = np.take_along_axis(found, keep, 1), np.take_along_axis(log_w, keep, 1)
            x = self._points[found]
        return found, x, log_w

    def _count(self, kernel: Kernel, extra: int = 0) -> int:
        """Number of neighbours of each query."""
        n = len(self._points)
        return n if kernel.n_neighbors is None else min(kernel.n_neighbors + extra, n)

    def _log_weights(self, squared: Array, found: Rows, log_share: Array | None, kernel: Kernel, k: int) -> Array:
        """Logarithms of the weights (..., c) of candidates at the given squared distances (..., c)."""
        if kernel.adaptive:
            valid = np.isfinite(log_share) if log_share is not None else np.ones(squared.shape, dtype=bool)
            ranked = np.sort(np.where(valid, squared, np.inf), axis=-1)
            last = np.minimum(k, valid.sum(axis=-1)) - 1
            farthest = np.take_along_axis(ranked, last[..., None], axis=-1)
            # If all neighbours coincide with the query, their weights are equal for any bandwidth.
            h2 = kernel.bandwidth**2 * np.where(farthest > 0, farthest, 1.0)
            log_w: Array = squared / -h2
        else:
            log_w = squared / -(kernel.bandwidth**2)
        np.maximum(log_w, MIN_LOG, out=log_w)
        if log_share is not None:
            log_w += log_share
        if self._log_sample_weight is not None:
            log_w += self._log_sample_weight[found]
        return log_w


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
