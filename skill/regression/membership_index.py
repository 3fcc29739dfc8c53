"""Nearest samples of a query among those that may share its contact state.

Each state has an index of its own, over the samples that may be in it. A query visits the indices of the
states that it may be in: usually one, smaller than the whole and free of samples that would get no weight
anyhow.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from skill.arrays import Array
from skill.regression.neighbour_index import NeighbourIndex, Rows

# "May be in": a state of less probability is left out of the search, though not of the weights. It bounds by
# as much the weight, relative to a like sample in a certain state, of any sample that the search leaves out.
NEGLIGIBLE = 1e-3
# A sample that shares no state with the query keeps this share: if all do, distance alone decides, and the
# tiny greatest weight makes the model a kernel mean and tells the caller that support is missing.
MIN_SHARE = 1e-300


class MembershipIndex:
    """Candidates for the neighbourhood of a query, and the probability that they share its state.

    Args:
        points: (n, d), scaled.
        memberships: (n, K) contact-state probabilities of the points, or None.
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
        """Rows (m, c), c >= min(k, n), and logarithms of the shares sum_k Q_qk P_ik, (m, c).

        Rows of queries with fewer candidates than c are filled up with repetitions, whose log share is -inf.
        The second value is None where every share is one.
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
        """The same for one query (d,) with memberships (K,): (c,) and (c,)."""
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
        if not indices:  # nobody demonstrated what the query is in: whatever is nearest
            indices = [self._whole]
        found = np.hstack([index.nearest_many(queries, k) for index in indices])
        if len(indices) == 1:
            return found, self._log_share(found, Q)
        # A sample that may be in two states is found twice and counts once.
        found = np.sort(found, axis=1)
        log_share = self._log_share(found, Q)
        log_share[:, 1:][found[:, 1:] == found[:, :-1]] = -np.inf
        return found, log_share

    def _log_share(self, found: Rows, q: Array) -> Array:
        """Logarithms of the shares of samples (..., c) with queries (..., K)."""
        assert self._memberships is not None
        share = (self._memberships[found] @ q[..., None])[..., 0]
        return np.log(np.maximum(share, MIN_SHARE, out=share), out=share)


def check_memberships(values: ArrayLike, n: int, states: int | None = None, exact: bool = False) -> Array:
    """Memberships as an array (n, K), or a ValueError that says what is wrong.

    Args:
        values: non-negative, rows sum to one; or, unless ``exact``, to at most one.
        n: expected number of rows.
        states: expected number K of states, if known.
        exact: whether rows must sum to one.
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
            f"memberships are not probabilities: least value {low:.3g}, sums of rows from {sums.min():.3g} to"
            f" {sums.max():.3g}; expected non-negative rows that sum to {at_most}one: divide each by its sum"
        )
    return P
