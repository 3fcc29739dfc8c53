"""Leave-one-out predictions of a locally weighted regression, and the bandwidth with the smallest error of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from compiled import compiled
from skill.arrays import Array
from skill.regression.local_model import equivalent_kernel, scaled_weights, weighted_output
from skill.regression.neighbourhood import RegressionNumbers, neighbourhood

MAX_LEFT_OUT = 500
"""Number of samples that are left out, one by one, to select a bandwidth. They are evenly spaced among all samples."""


RADII = 100
"""Number, roughly, of the neighbourhoods whose median radius gives the candidate bandwidths."""

MAX_EXTENSIONS, EXTENSION = 8, 3
"""How often the candidates go on beyond the best one, and by how many; in all by a factor of 1,900 on either side."""


def best_bandwidth(p: RegressionNumbers) -> float:
    """Returns the candidate of `candidate_bandwidths` with the minimum error of left-out samples.

    The squared error of each output is divided by its variance. Copies of a sample are left out with it, so that a
    weight counts like repetitions. The bandwidth of ``p`` is returned if no output varies: any is then right.
    """
    points, variance = p.search.points, p.y.var(axis=0)
    varies = variance > 0
    if not varies.any():
        return p.bandwidth
    rows = np.unique(np.linspace(0, len(points) - 1, MAX_LEFT_OUT).astype(np.intp))
    weights = np.exp(p.search.log_weight[rows])
    more = p._replace(k=min(p.k + 1, len(points)))

    def errors(bandwidths: Array) -> Array:
        predicted = np.array([left_out_predictions(more._replace(bandwidth=float(h)), rows) for h in bandwidths])
        squares = np.average((predicted - p.y[rows]) ** 2, axis=1, weights=weights)
        return np.asarray((squares[:, varies] / variance[varies]).mean(axis=1))

    candidates, found = searched(candidate_bandwidths(np.unique(points, axis=0), p), errors)
    return float(candidates[::-1][found[::-1].argmin()])  # the widest of equal ones


@compiled
def left_out_predictions(p: RegressionNumbers, rows: NDArray[np.intp]) -> Array:
    """Returns predictions (r, p) at samples (r,), each without the sample and its copies.

    Copies are samples with the same features; they stay if there are no others.
    """
    predicted = np.empty((len(rows), p.y.shape[1]))
    for i in range(len(rows)):
        query = p.search.points[rows[i]]
        found, log_w = neighbourhood(p, query, p.search.memberships[rows[i]])
        x = p.search.points[found]
        others = np.zeros(len(found), np.bool_)
        for feature in range(len(query)):
            others |= x[:, feature] != query[feature]
        if others.any():
            log_w = np.where(others, log_w, -np.inf)
        weights, _, ridge = scaled_weights(log_w, p.ridge)
        predicted[i] = weighted_output(equivalent_kernel(query, x, weights, ridge, p.degree), p.y, found)
    return predicted


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


def candidate_bandwidths(X: Array, p: RegressionNumbers) -> Array:
    """Twelve candidates, from an eighth to four times the median radius of a neighbourhood; `searched` goes on.

    The radius is the distance to the farthest neighbour used.

    Args:
        X: (n, d), scaled features.
        p: the regression; its bandwidth has no effect.
    """
    multiples = np.geomspace(0.125, 4.0, 12)
    k = min(p.k, len(X))
    queries = X[:: max(1, len(X) // RADII)]
    radii = [np.partition(np.linalg.norm(query - X, axis=1), k - 1)[k - 1] for query in queries]
    radius = float(np.median(radii))
    return multiples * (radius if radius > 0 else 1.0)
