"""The neighbourhood of a query: the samples of its local model, and their kernel weights."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from skill.arrays import Array
from skill.regression.membership_index import MembershipIndex
from skill.regression.neighbour_index import Rows

BLOCK = 1 << 17
"""Numbers in one block of a batch (queries times neighbours times features); a block fits into the cache."""

SEARCH_BLOCK = 1 << 18
"""Number of candidates that one search finds for many queries together."""

MIN_LOG = -1e300
"""Minimum logarithm of the weight of a distance; it avoids infinite values, whose differences are NaN."""


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


class KernelNeighbourhood:
    """Finds neighbourhoods among n samples.

    Args:
        points: (n, d), scaled features.
        memberships: (n, K), contact-state probabilities, or None.
        sample_weight: (n,), positive.
        algorithm: see ``NeighbourIndex``.
    """

    def __init__(self, points: Array, memberships: Array | None, sample_weight: Array, algorithm: str) -> None:
        self._points = points
        self._index = MembershipIndex(points, memberships, algorithm)
        uniform = bool((sample_weight == 1.0).all())
        self._log_sample_weight = None if uniform else np.log(sample_weight)

    def of_one(self, query: Array, q: Array | None, kernel: Kernel) -> tuple[Rows, Array, Array]:
        """The neighbourhood of one query.

        Args:
            query: (d,), scaled.
            q: (K,), contact-state probabilities of the query; None ignores the states.
            kernel: the kernel.

        Returns:
            Rows (k,), samples (k, d) and log weights (k,).
        """
        k = self._count(kernel)
        found, log_share = self._index.candidates_of_one(query, q, k)
        x = self._points[found]
        offset = x - query
        log_w = self._log_weights(np.einsum("ij,ij->i", offset, offset), found, log_share, kernel, k)
        if len(found) > k:
            keep = np.argpartition(-log_w, k - 1)[:k]
            found, x, log_w = found[keep], x[keep], log_w[keep]
        return found, x, log_w

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
