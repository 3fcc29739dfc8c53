"""Competitive Agglomeration as published: the competition acts on squared distances to prototypes.

Frigui and Krishnapuram, "Clustering by competitive agglomeration", Pattern Recognition 30(7), 1997, with

- ``euclid``: d^2 = |z - v|^2; - ``gk``: d^2 = |F|^(1/d) (z - v)' F^-1 (z - v) (Gustafson and Kessel, 1979); -
``fmle``: d^2 = |F|^(1/2) / P exp((z - v)' F^-1 (z - v) / 2) (Gath and Geva, 1989), the *literal* form, whose
  competition is ruled by the few samples of least density and leaves one or two clusters. It is evaluated in
  the log domain, so that the collapse seen is that of the equations and not of the floating point.

Memberships of all samples are kept, N x M numbers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from skill.arrays import Array
from skill.clustering.cluster_competition import History, Schedule
from skill.clustering.expectation_maximization import CovariancePrior
from skill.clustering.gaussian_components import (
    GaussianComponents,
    log_densities,
    precision_factors,
    squared_mahalanobis,
)

MIN_SQUARED_DISTANCE = 1e-6
"""Least squared distance, so that a sample on a prototype has a finite weight (units of Z)."""

FUZZY_ITERATIONS = 3
"""Iterations of Euclidean fuzzy c-means before the competition starts."""

LARGEST_EXPONENT = 690.0


@dataclass(frozen=True)
class Competition:
    """Prototypes as Gaussians, nearest prototype of each sample (N,), history, whether it came to rest."""

    components: GaussianComponents
    labels: NDArray[np.intp]
    history: History
    converged: bool


def log_squared_distances(Z: Array, components: GaussianComponents, distance: str) -> Array:
    """Log d^2 of every sample to every prototype, shape (n, M).

    Raises:
        ValueError: if ``distance`` is none of euclid, gk, fmle.
    """
    if distance == "fmle":
        factors = precision_factors(components.covariances)
        constant = 0.5 * Z.shape[1] * np.log(2.0 * np.pi)
        return -constant - log_densities(Z, components.weights, components.means, factors)
    if distance == "euclid":
        factors = np.broadcast_to(np.eye(Z.shape[1]), components.covariances.shape)
        volumes = np.zeros(len(components))
    elif distance == "gk":
        factors = precision_factors(components.covariances)
        volumes = -2.0 * np.log(np.einsum("mdd->md", factors)).mean(axis=1)
    else:
        raise ValueError(f"distance is {distance!r}, expected 'fmle', 'gk' or 'euclid'")
    squared = squared_mahalanobis(Z, components.means, factors)
    return volumes + np.log(np.maximum(squared, MIN_SQUARED_DISTANCE))


def competitive_memberships(log_d2: Array, previous: Array | None, eta: float) -> Array:
    """u_ij = (1/d^2_ij) / S_j + (alpha / d^2_ij) (N_i - Nbar_j), shape (n, M), rows summing to one.

    S_j = sum_k 1/d^2_kj, Nbar_j = sum_k (N_k / d^2_kj) / S_j and alpha = eta sum u^2 d^2 / sum N_i^2 with u
    and N of the ``previous`` memberships; clipped to [0, 1] and renormalised, as the author's program does.

    Args:
        log_d2: shape (n, M), log squared distances.
        previous: shape (n, M), or None for fuzzy c-means (fuzzifier 2) without competition.
        eta: strength of the competition.
    """
    log_S = logsumexp(-log_d2, axis=1, keepdims=True)
    H = np.exp(-log_d2 - log_S)
    if previous is None or eta == 0.0:
        return H
    N_i = previous.sum(axis=0)
    with np.errstate(divide="ignore"):
        log_cost = logsumexp(np.where(previous > 0.0, 2.0 * np.log(previous) + log_d2, -np.inf))
    log_alpha = np.log(eta) + log_cost - np.log(np.sum(N_i**2))
    weight = np.exp(np.minimum(log_alpha + log_S, LARGEST_EXPONENT))
    U = np.clip(H + H * weight * (N_i - H @ N_i[:, None]), 0.0, 1.0)
    total = U.sum(axis=1, keepdims=True)
    return np.where(total > 0.0, U / np.where(total > 0.0, total, 1.0), H)


def fuzzy_prototypes(Z: Array, U: Array, prior: CovariancePrior, *, literal: bool) -> GaussianComponents:
    """Centres and covariances weighted by u^2 / sum u^2; ``literal`` divides the covariance by sum u."""
    W = U**2
    sums = W.sum(axis=0)
    N_i = U.sum(axis=0)
    means = (W.T @ Z) / (sums + MIN_SQUARED_DISTANCE)[:, None]
    divisors = N_i if literal else sums
    covariances = np.stack(
        [
            (Z - mean).T @ (W[:, i, None] * (Z - mean)) / max(divisors[i], np.finfo(float).tiny)
            for i, mean in enumerate(means)
        ]
    )
    return GaussianComponents(N_i / N_i.sum(), means, prior.apply(covariances, sums))


def compete_for_prototypes(
    Z: Array,
    components: GaussianComponents,
    prior: CovariancePrior,
    schedule: Schedule,
    *,
    distance: str,
    deaths: str,
    min_count: float,
    max_iter: int,
    tol: float,
) -> Competition:
    """The published algorithm.

    Once the competition has started, clusters die: with ``deaths="cardinality"``, as published, when N_i is below
    ``min_count``; with "nearest", as in the author's later program, when fewer samples than one (in the first
    half of the iterations) or ``min_count`` (in the second) are nearest to them. It rests when the number has
    not changed and the centres moved by less than ``tol`` in all.

    Args:
        Z: samples, shape (N, d).
        components: the first prototypes.
        prior: regularisation of the covariances (not used by ``euclid``).
        schedule: strength of the competition for each iteration.
        distance: ``euclid``, ``gk`` or ``fmle``.
        deaths: ``cardinality`` or ``nearest``.
        min_count: cardinality, or number of nearest samples, that a cluster needs.
        max_iter: largest number of iterations.
        tol: sum of the absolute changes of all centres at which to stop, in units of Z.
    """
    history = History()
    U: Array | None = None
    converged = False
    for k in range(max_iter):
        eta = schedule(k)
        log_d2 = log_squared_distances(Z, components, distance if k >= FUZZY_ITERATIONS else "euclid")
        history.append(len(components), eta, float("nan"))
        U = competitive_memberships(log_d2, U if k >= FUZZY_ITERATIONS else None, eta)
        if deaths == "cardinality":
            counts, least = U.sum(axis=0), min_count
        else:
            counts = np.bincount(np.argmin(log_d2, axis=1), minlength=len(components)).astype(float)
            least = 1.0 if k < max_iter / 2 else min_count
        keep = counts >= least
        if k < FUZZY_ITERATIONS:
            keep[:] = True
        if not keep.any():
            keep[int(np.argmax(counts))] = True
        U = U[:, keep]
        before = components.means[keep]
        components = fuzzy_prototypes(Z, U, prior, literal=distance == "fmle")
        if keep.all() and float(np.abs(components.means - before).sum()) < tol:
            converged = True
            break
    labels = np.argmin(log_squared_distances(Z, components, distance), axis=1)
    return Competition(components, labels, history, converged)
