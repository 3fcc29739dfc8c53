"""Nearest samples of a query: exact, by KD-tree or by brute force, whichever is faster for the size."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from skill.arrays import Array

Rows = NDArray[np.intp]

# Leaves much larger than usual: with some hundred neighbours a query visits thousands of samples anyhow.
LEAF_SIZE = 64
# Distances of one block of brute-force queries stay within a processor's cache (numbers, not bytes).
BLOCK = 1 << 18


class NeighbourIndex:
    """The k nearest of n points in Euclid's distance.

    Args:
        points: (n, d), already scaled.
        rows: (n,) the number each point bears outside; 0..n-1 if None.
        algorithm: "kd_tree", "brute" or "auto", which takes brute force where one matrix product is cheaper
            than walking the tree.
    """

    def __init__(self, points: Array, rows: Rows | None = None, algorithm: str = "auto") -> None:
        self.rows = np.arange(len(points)) if rows is None else rows
        self.size = len(points)
        if algorithm == "auto":
            algorithm = "brute" if self.size <= _brute_limit(points.shape[1]) else "kd_tree"
        self.algorithm = algorithm
        if algorithm == "kd_tree":
            # Distances do not change in the principal axes, but boxes fit the samples better there, and
            # cutting boxes at their middle leaves them rounder than at the median: together a third of the
            # time at d = 14.
            self._axes = _principal_axes(points)
            self._tree = cKDTree(points @ self._axes, leafsize=LEAF_SIZE, balanced_tree=False)
        else:
            # |x - q|^2 is |x|^2 - 2 x.q but for a constant; centring keeps the cancellation harmless.
            self._centre = points.mean(axis=0)
            centred = points - self._centre
            norms = np.einsum("ij,ij->i", centred, centred)
            self._augmented = np.ascontiguousarray(np.column_stack([-2.0 * centred, norms]).T)

    def nearest(self, query: Array, k: int) -> Rows:
        """Rows (k',) of the k' = min(k, n) nearest to one query (d,), in no particular order."""
        if k >= self.size:
            return self.rows
        if self.algorithm == "kd_tree":
            _, found = self._tree.query(query @ self._axes, k)
            return self.rows[np.atleast_1d(found)]
        extended = np.append(query - self._centre, 1.0)
        return self.rows[np.argpartition(extended @ self._augmented, k - 1)[:k]]

    def nearest_many(self, queries: Array, k: int) -> Rows:
        """Rows (m, k') of the k' = min(k, n) nearest to each query (m, d), in no particular order."""
        m = len(queries)
        if k >= self.size:
            return np.broadcast_to(self.rows, (m, self.size))
        if self.algorithm == "kd_tree":
            _, found = self._tree.query(queries @ self._axes, k)
            return self.rows[found.reshape(m, k)]
        extended = np.column_stack([queries - self._centre, np.ones(m)])
        found = np.empty((m, k), dtype=np.intp)
        step = max(1, BLOCK // self.size)
        for start in range(0, m, step):
            relative = extended[start : start + step] @ self._augmented
            found[start : start + step] = np.argpartition(relative, k - 1, axis=1)[:, :k]
        return self.rows[found]


def _principal_axes(points: Array) -> Array:
    """Orthogonal axes (d, d) of the points' covariance."""
    centred = points - points.mean(axis=0)
    return np.linalg.eigh(centred.T @ centred)[1]


def _brute_limit(dimension: int) -> int:
    """Size up to which brute force wins, measured with 200 neighbours: trees lose their grip as d grows."""
    return 10_000 if dimension <= 4 else 12_000 if dimension <= 8 else 25_000
