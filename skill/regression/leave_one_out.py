"""Leave-one-out predictions of a locally weighted regression, and the bandwidth with the smallest error of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array
from skill.regression.local_model import equivalent_kernels, normalised_weights
from skill.regression.neighbourhood import Kernel, KernelNeighbourhood

MAX_LEFT_OUT = 500
"""Number of samples that are left out, one by one, to select a bandwidth. They are evenly spaced among all samples."""


RADII = 100
"""Number, roughly, of the neighbourhoods whose median radius gives the candidate bandwidths."""

MAX_EXTENSIONS, EXTENSION = 8, 3
"""How often the candidates go on beyond the best one, and by how many; in all by a factor of 1,900 on either side."""


@dataclass(frozen=True)
class StoredSamples:
    """The samples of a locally weighted regression.

    Attributes:
        X: (n, d), scaled features.
        y: (n, p), outputs.
        memberships: (n, K), contact-state probabilities, or None.
        sample_weight: (n,), positive.
        neighbourhood: search for neighbours among X.
    """

    X: Array
    y: Array
    memberships: Array | None
    sample_weight: Array
    neighbourhood: KernelNeighbourhood

    def predictions(
        self,
        rows: NDArray[np.intp],
        kernels: Sequence[Kernel],
        *,
        ridge: float,
        degree: int,
    ) -> Array:
        """Predictions (B, r, p) by B kernels at the samples ``rows`` (r,), each without the sample and its copies.

        Copies are samples with the same features; they stay if there are no others.

        Args:
            rows: numbers of the samples.
            kernels: kernels that differ in their bandwidths only.
            ridge: penalty of the squared slope.
            degree: 0 or 1.
        """
        queries = self.X[rows]
        P = None if self.memberships is None else self.memberships[rows]
        out = np.empty((len(kernels), len(rows), self.y.shape[1]))
        blocks = self.neighbourhood.blocks_of_kernels(queries, P, kernels, extra=1)
        for number, block, found, x, log_w in blocks:
            copies = (x == queries[block][:, None, :]).all(axis=2)
            copies &= (~copies & np.isfinite(log_w)).any(axis=1, keepdims=True)
            weights, _, scaled_ridge = normalised_weights(np.where(copies, -np.inf, log_w), ridge)
            influence = equivalent_kernels(queries[block], x, weights, scaled_ridge, degree)
            out[number, block] = (influence[:, None, :] @ self.y[found])[:, 0, :]
        return out

    def best_bandwidth(self, kernel: Kernel, *, ridge: float, degree: int) -> float:
        """The candidate of `candidate_bandwidths` with the minimum error of left-out samples.

        The squared error of each output is divided by its variance. Copies of a sample are left out with it, so that a
        weight counts like repetitions. The bandwidth of ``kernel`` is returned if no output varies: any is then right.

        Args:
            kernel: the kernel; its bandwidth is replaced by that of each candidate.
            ridge: penalty of the squared slope.
            degree: 0 or 1.
        """
        variance = self.y.var(axis=0)
        varies = variance > 0
        if not varies.any():
            return kernel.bandwidth
        rows = np.unique(np.linspace(0, len(self.X) - 1, MAX_LEFT_OUT).astype(np.intp))

        def errors(bandwidths: Array) -> Array:
            kernels = [replace(kernel, bandwidth=float(bandwidth)) for bandwidth in bandwidths]
            predicted = self.predictions(rows, kernels, ridge=ridge, degree=degree)
            squares = np.average((predicted - self.y[rows]) ** 2, axis=1, weights=self.sample_weight[rows])
            return np.asarray((squares[:, varies] / variance[varies]).mean(axis=1))

        candidates, found = searched(candidate_bandwidths(np.unique(self.X, axis=0), kernel), errors)
        return float(candidates[::-1][found[::-1].argmin()])  # the widest of equal ones


def searched(candidates: Array, errors_of: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Returns candidates and their errors; a geometric series goes on while its best one is the first or the last.

    Args:
        candidates: ascending, with one ratio.
        errors_of: function that returns the errors of candidates.
    """
    errors = errors_of(candidates)
    ratio = candidates[1] / candidates[0]
    for _ in range(MAX_EXTENSIONS):
        best = int(errors.argmin())
        if 0 < best < len(errors) - 1:
            break
        more = candidates[best] * ratio ** (np.arange(-EXTENSION, 0) if best == 0 else np.arange(1, EXTENSION + 1))
        order = (more, candidates), (errors_of(more), errors)
        candidates, errors = (np.concatenate(pair if best == 0 else pair[::-1]) for pair in order)
    return candidates, errors


def candidate_bandwidths(X: Array, kernel: Kernel) -> Array:
    """Twelve candidates, from an eighth to four times the median radius of a neighbourhood; `searched` goes on.

    The radius is the distance to the farthest neighbour used. For an adaptive kernel, whose bandwidth is in units of
    this radius, the candidates are the multiples themselves.

    Args:
        X: (n, d), scaled features.
        kernel: the kernel; its bandwidth has no effect.
    """
    multiples = np.geomspace(0.125, 4.0, 12)
    if kernel.adaptive:
        return multiples
    k = len(X) if kernel.n_neighbors is None else min(int(kernel.n_neighbors), len(X))
    queries = X[:: max(1, len(X) // RADII)]
    radii = [np.partition(np.linalg.norm(query - X, axis=1), k - 1)[k - 1] for query in queries]
    radius = float(np.median(radii))
    return multiples * (radius if radius > 0 else 1.0)
