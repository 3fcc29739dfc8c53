"""Competitive Agglomeration as published, where the competition acts on squared distances to prototypes.

The algorithm is that of Frigui and Krishnapuram, "Clustering by competitive agglomeration", Pattern Recognition 30(7),
1997. The squared distance d^2 of a sample z to a prototype with centre v, covariance F and weight P is one of:

- ``euclid``: |z - v|^2;
- ``gk``: |F|^(1/d) (z - v)' F^-1 (z - v) (Gustafson and Kessel, 1979);
- ``fmle``: |F|^(1/2) / P exp((z - v)' F^-1 (z - v) / 2) (Gath and Geva, 1989).

The competition with ``fmle`` is dominated by the few samples of lowest density and leaves one or two clusters. It is
evaluated in the log domain, so this collapse is a property of the equations and not of floating-point overflow.

The memberships of all samples are stored, N x M numbers.
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
    LOG_2PI,
    GaussianComponents,
    log_densities,
    precision_factors,
    squared_mahalanobis,
)

MIN_SQUARED_DISTANCE = 1e-6
"""Minimum squared distance in units of Z, so that a sample at a prototype has a finite weight."""

FUZZY_ITERATIONS = 3
"""Iterations of Euclidean fuzzy c-means before the competition starts."""

MAX_EXPONENT = 690.0
"""Maximum argument of the exponential function; larger ones would overflow."""


@dataclass(frozen=True)
class Competition:
    """Result of the competition between prototypes.

    Attributes:
        components: surviving prototypes as Gaussians.
        labels: shape (N,), nearest prototype of each sample.
        history: course of the competition.
        converged: whether the centres stopped moving.
    """

    components: GaussianComponents
    labels: NDArray[np.intp]
    history: History
    converged: bool


def log_squared_distances(Z: Array, components: GaussianComponents, distance: str) -> Array:
    """Returns log d^2 of each sample to each prototype, shape (n, M).

    Args:
        Z: samples, shape (n, d).
        components: M prototypes.
        distance: "euclid", "gk" or "fmle".

    Raises:
        ValueError: if ``distance`` has another value.
    """
    if distance == "fmle":
        factors = precision_factors(components.covariances)
        constant: float = 0.5 * Z.shape[1] * LOG_2PI
        return -constant - log_densities(Z, components.weights, components.means, factors)
    if distance == "euclid":
        factors = np.broadcast_to(np.eye(Z.shape[1]), components.covariances.shape)
        log_volumes = np.zeros(len(components))
    elif distance == "gk":
        factors = precision_factors(components.covariances)
        log_volumes = -2.0 * np.log(np.einsum("mdd->md", factors)).mean(axis=1)
    else:
        raise ValueError(f"distance is {distance!r}, expected 'fmle', 'gk' or 'euclid'")
    squared = squared_mahalanobis(Z, components.means, factors)
    return log_volumes + np.log(np.maximum(squared, MIN_SQUARED_DISTANCE))


def competitive_memberships(log_d2: Array, previous: Array | None, eta: float) -> Array:
    """Returns the memberships u, shape (n, M); each row sums to one.

    With S_j = sum_k 1/d^2_kj, Nbar_j = sum_k (N_k / d^2_kj) / S_j and alpha = eta sum u^2 d^2 / sum_i N_i^2, where u
    and N_i are those of the previous iteration,

        u_ij = (1 / d^2_ij) / S_j + (alpha / d^2_ij) (N_i - Nbar_j),

    clipped to [0, 1] and normalised, as in the authors' program.

    Args:
        log_d2: shape (n, M), log squared distances.
        previous: shape (n, M), previous memberships; None for fuzzy c-means (fuzzifier 2) without competition.
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
    weight = np.exp(np.minimum(log_alpha + log_S, MAX_EXPONENT))
    U = np.clip(H + H * weight * (N_i - H @ N_i[:, None]), 0.0, 1.0)
    total = U.sum(axis=1, keepdims=True)
    return np.where(total > 0.0, U / np.where(total > 0.0, total, 1.0), H)


def fuzzy_prototypes(Z: Array, U: Array, prior: CovariancePrior, *, literal: bool) -> GaussianComponents:
    """Returns prototypes with means and covariances weighted by u^2 / sum u^2.

    Args:
        Z: samples, shape (N, d).
        U: shape (N, M), memberships.
        prior: regularisation of the covariances.
        literal: whether to divide the covariances by sum u, as printed, instead of sum u^2.
    """
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
    death_rule: str,
    min_count: float,
    max_iter: int,
    tol: float,
) -> Competition:
    """Runs the published algorithm.

    The first `FUZZY_ITERATIONS` iterations are Euclidean fuzzy c-means without competition and without deaths. The
    algorithm has converged when no cluster died and the absolute changes of all centre coordinates sum to less than
    ``tol``.

    Args:
        Z: samples, shape (N, d).
        components: initial prototypes.
        prior: regularisation of the covariances; ``euclid`` ignores covariances.
        schedule: strength of the competition in each iteration.
        distance: "euclid", "gk" or "fmle".
        death_rule: which clusters die. "cardinality", as published: those with N_i below ``min_count``. "nearest", as
            in the authors' later program: those that are the nearest cluster of fewer than ``min_count`` samples, or
            of no sample in the first half of the iterations.
        min_count: minimum cardinality, or minimum number of nearest samples, of a cluster.
        max_iter: maximum number of iterations.
        tol: limit of the sum of absolute changes, in units of Z.
    """
    history = History()
    U: Array | None = None
    converged = False
    for k in range(max_iter):
        competing = k >= FUZZY_ITERATIONS
        eta = schedule(k)
        log_d2 = log_squared_distances(Z, components, distance if competing else "euclid")
        history.append(len(components), eta, float("nan"))
        U = competitive_memberships(log_d2, U if competing else None, eta)
        keep = np.ones(len(components), dtype=bool)
        if competing and death_rule == "cardinality":
            keep = _large_enough(U.sum(axis=0), min_count)
        elif competing:
            nearest = np.bincount(np.argmin(log_d2, axis=1), minlength=len(components)).astype(float)
            keep = _large_enough(nearest, 1.0 if k < max_iter / 2 else min_count)
        U = U[:, keep]
        before = components.means[keep]
        components = fuzzy_prototypes(Z, U, prior, literal=distance == "fmle")
        if keep.all() and float(np.abs(components.means - before).sum()) < tol:
            converged = True
            break
    labels = np.argmin(log_squared_distances(Z, components, distance), axis=1)
    return Competition(components, labels, history, converged)


def _large_enough(counts: Array, min_count: float) -> NDArray[np.bool_]:
    """Returns the mask of the clusters with at least ``min_count`` samples, or of the largest cluster alone."""
    keep = counts >= min_count
    if not keep.any():
        keep[int(np.argmax(counts))] = True
    return keep
