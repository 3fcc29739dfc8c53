"""Search for the nearest samples of a query among those that may share its contact state.

Each state has its own index of the samples that may be in it. A query searches the indices of the states that it may be
in. Usually this is one index, which is smaller than the whole and contains no samples that would get no weight.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from skill.arrays import Array
from skill.regression.neighbour_index import NeighbourIndex, Rows

NEGLIGIBLE = 1e-3
"""States with at most this probability are not searched, though they count in the weights. This bounds the weight of a
sample that the search leaves out, relative to a sample at the same distance in a certain state."""

MIN_SHARE = 1e-300
"""Minimum probability that a sample shares the state of the query. If all samples have only this share, the distance
alone decides, and the tiny weights turn the local model into a kernel mean and report that support is missing."""


class MembershipIndex:
    """Finds candidates for the neighbourhood of a query, and the probabilities that they share its state.

    Args:
        points: (n, d), scaled.
        memberships: (n, K), contact-state probabilities of the points, or None.
        algorithm: see ``NeighbourIndex``.
    """

    def __init__(self, points: Array, memberships: Array | None, algorithm: str) -> None:
        self._whole = NeighbourIndex(points, None, algorithm)
        self._memberships = memberships
        self._states: list[NeighbourIndex | None] = []
        if memberships is None:
            return
        for state in range(memberships.shape[1]):
            rows = np.flatnonzero(memberships[:, state] > NEGLIGIBLE)
            self._states.append(NeighbourIndex(points[rows], rows, algorithm) if rows.size else None)

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
            return self._whole.nearest_many(queries, k), None
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

    def candidates_of_one(self, query: Array, q: Array | None, k: int) -> tuple[Rows, Array | None]:
        """Candidates of one query (d,) with probabilities (K,); returns arrays (c,) as `candidates` does."""
        if q is None:
            return self._whole.nearest(query, k), None
        states = (q > NEGLIGIBLE).nonzero()[0]
        if len(states) == 1 and (index := self._states[states[0]]) is not None:
            found = index.nearest(query, k)
            return found, self._log_share(found, q)
        rows, log_shares = self._of_states(query[None], q[None], states, k)
        return rows[0], log_shares[0]

    def _of_states(self, queries: Array, Q: Array, states: Rows, k: int) -> tuple[Rows, Array]:
        indices = [index for state in states if (index := self._states[state]) is not None]
        if not indices:  # no sample is in the state of the query: search all samples
            indices = [self._whole]
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
