"""The neighbourhood of a query: which samples enter its local model, and with what kernel weight."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from skill.arrays import Array
from skill.regression.membership_index import MembershipIndex
from skill.regression.neighbour_index import Rows

# Numbers held at once by one block of a batch, neighbours times features: they stay within a processor's
# cache.
BLOCK = 1 << 17
# Candidates found at once: enough queries share one walk through the indices of their states.
SEARCH_BLOCK = 1 << 18
# The least logarithm of a weight by distance: the farthest samples compare as equal and not as NaN.
MIN_LOG = -1e300


@dataclass(frozen=True)
class Kernel:
    """The Gaussian kernel exp(-distance^2 / h^2), cut off behind the nearest samples.

    Attributes:
        bandwidth: h, or a multiple of the distance to the farthest neighbour that enters.
        adaptive: whether it is such a multiple.
        n_neighbors: how many samples enter at most; None for all.
    """

    bandwidth: float
    adaptive: bool = False
    n_neighbors: int | None = None


class KernelNeighbourhood:
    """Neighbourhoods among n samples.

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
        """Rows (k,), samples (k, d) and log weights (k,) for one query (d,) with memberships (K,)."""
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
        """Blocks of queries (m, d) with rows (b, k), samples (b, k, d) and log weights (b, k).

        ``extra`` neighbours are added, to make up for those that the caller leaves out.
        """
        k = self._count(kernel, extra)
        step = max(1, BLOCK // (k * self._points.shape[1]))
        stride = step * max(1, SEARCH_BLOCK // (k * step))
        for first in range(0, len(queries), stride):
            many = slice(first, min(first + stride, len(queries)))
            found, log_share = self._index.candidates(queries[many], None if Q is None else Q[many], k)
            for start in range(first, many.stop, step):
                block = slice(start, min(start + step, many.stop))
                part = slice(block.start - first, block.stop - first)
                share = None if log_share is None else log_share[part]
                yield block, *self._weighted(queries[block], found[part], share, kernel, k)

    def _weighted(
        self, queries: Array, found: Rows, log_share: Array | None, kernel: Kernel, k: int
    ) -> tuple[Rows, Array, Array]:
        """Rows, samples and log weights of the k candidates of greatest weight, among (b, c)."""
        x = self._points[found]
        offset = x - queries[:, None, :]
        log_w = self._log_weights(np.einsum("mkd,mkd->mk", offset, offset), found, log_share, kernel, k)
        if found.shape[1] > k:
            keep = np.argpartition(-log_w, k - 1, axis=1)[:, :k]
            found, log_w = np.take_along_axis(found, keep, 1), np.take_along_axis(log_w, keep, 1)
            x = self._points[found]
        return found, x, log_w

    def _count(self, kernel: Kernel, extra: int = 0) -> int:
        n = len(self._points)
        return n if kernel.n_neighbors is None else min(kernel.n_neighbors + extra, n)

    def _log_weights(self, squared: Array, found: Rows, log_share: Array | None, kernel: Kernel, k: int) -> Array:
        """Logarithms of the weights (..., c) of candidates at the given squared distances (..., c)."""
        if kernel.adaptive:
            valid = np.isfinite(log_share) if log_share is not None else np.ones(squared.shape, dtype=bool)
            ranked = np.sort(np.where(valid, squared, np.inf), axis=-1)
            last = np.minimum(k, valid.sum(axis=-1)) - 1
            farthest = np.take_along_axis(ranked, last[..., None], axis=-1)
            # Where all neighbours sit on the query their weights are equal, whatever the bandwidth.
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
