"""Competitive Agglomeration as published, where the competition acts on squared distances to prototypes.

The algorithm is that of Frigui and Krishnapuram, "Clustering by competitive agglomeration", Pattern Recognition 30(7),
1997. The squared distance d^2 of a sample z to a prototype with centre v, covariance F and weight P is one of:

- ``euclid``: |z - v|^2;
- ``fmle``: |F|^(1/2) / P exp((z - v)' F^-1 (z - v) / 2) (Gath and Geva, 1989).

The competition with ``fmle``, the printed equations of the paper, is dominated by the few samples of lowest density and
leaves one or two clusters. It is evaluated in the log domain, so this collapse is a property of the equations and not
of floating-point overflow. The memberships of all samples are stored, N x M numbers.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import logsumexp
from sklearn.exceptions import ConvergenceWarning
from sklearn.utils import check_random_state

from skill.arrays import Array, standard_scale
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration, History, nearest_centre
from skill.clustering.expectation_maximization import CovariancePrior
from skill.clustering.gaussian_components import (
    LOG_2PI,
    GaussianComponents,
    log_normalizers,
    precision_factors,
    squared_mahalanobis,
)
from skill.clustering.number_of_states import design_effect

Schedule = Callable[[int], float]
"""Strength of the competition, eta, as a function of the iteration."""

MIN_SQUARED_DISTANCE = 1e-6
"""Minimum squared distance in units of Z, so that a sample at a prototype has a finite weight."""

FUZZY_ITERATIONS = 3
"""Iterations of Euclidean fuzzy c-means before the competition starts."""

MAX_EXPONENT = 690.0
"""Maximum argument of the exponential function; larger ones would overflow."""

MIN_COUNT = 5.0
"""Clusters with a smaller cardinality die; or, in the authors' program, with fewer nearest samples."""


class PublishedCompetition(CompetitiveAgglomeration):
    """The published algorithm: one start, without mergers; the number of states is that of the surviving clusters.

    Its states are Gaussians, whatever the distance; ``labels_`` are those of the distance.

    Args:
        distance: "fmle" or "euclid"; see the module.
        init: initial centres, shape (M, d); None for the partition of `CompetitiveAgglomeration`.
        ramp: first and last iteration of a plateau of the competition, which rises before it and decays after it, with
            the rule of deaths of the authors' program; None for a competition that decays.
        eta0: largest strength of the competition.
        tau: number of iterations in which the strength changes by a factor e.
        max_iter: maximum number of iterations.
        tol: limit of the sum of the absolute changes of all centres.
        standardize: whether to scale the channels to variance one.
        random_state: seed of the start.
    """

    _parameter_constraints: dict[str, list[Any]] = {}

    def __init__(
        self,
        distance: str = "fmle",
        *,
        init: ArrayLike | None = None,
        ramp: tuple[int, int] | None = None,
        eta0: float = 5.0,
        tau: float = 10.0,
        max_iter: int = 100,
        tol: float = 1e-3,
        standardize: bool = True,
        random_state: Any = None,
    ) -> None:
        super().__init__(n_init=1, eta0=eta0, max_iter=max_iter, tol=tol, random_state=random_state)
        self.distance = distance
        self.init = init
        self.ramp = ramp
        self.tau = tau
        self.standardize = standardize

    def _fit(self, X: Array, groups: NDArray[np.intp] | None, phase: Array | None) -> None:
        centred = self.standardize or self.distance == "fmle"
        shift = X.mean(axis=0) if centred else np.zeros(X.shape[1])
        scale = standard_scale(X) if self.standardize else np.ones(X.shape[1])
        Z = (X - shift) / scale
        prior = self._prior(Z, np.zeros(Z.shape[1]))
        if self.init is None:
            components = self._initialize(Z, prior, phase, check_random_state(self.random_state))[0]
        else:
            components = components_at_centres(Z, (np.asarray(self.init) - shift) / scale, prior)
        eta0, tau = float(self.eta0 or 0.0), self.tau
        competition = compete_for_prototypes(
            Z,
            components,
            prior,
            exponential_schedule(eta0, tau) if self.ramp is None else ramp_schedule(eta0, tau, *self.ramp),
            distance=self.distance,
            death_rule="cardinality" if self.ramp is None else "nearest",
            min_count=MIN_COUNT,
            max_iter=self.max_iter,
            tol=self.tol,
        )
        self.history_, self.converged_ = competition.history, competition.converged
        self.n_iter_ = len(competition.history.eta)
        if not self.converged_:
            warnings.warn(f"not converged after max_iter={self.max_iter} iterations", ConvergenceWarning, stacklevel=3)
        found = competition.components
        effect = 1.0 if groups is None else design_effect(Z, found, groups)
        self._set_states(found.rescaled(shift, scale), design_effect=effect)
        rank = np.argsort(np.argsort(-found.weights, kind="stable"))
        self.labels_ = rank[competition.labels]


def exponential_schedule(eta0: float, tau: float) -> Schedule:
    """Returns eta(k) = eta0 exp(-(k - 3) / tau), and eta0 in the iterations before, which are fuzzy c-means."""
    return lambda k: eta0 * float(np.exp(-max(k - FUZZY_ITERATIONS, 0) / tau))


def ramp_schedule(eta0: float, tau: float, rise: int, decay: int) -> Schedule:
    """Returns a schedule that rises to a plateau and falls again.

    eta(k) is eta0 exp((k - rise) / tau) before iteration ``rise``, eta0 exp((decay - k) / tau) from iteration
    ``decay``, and eta0 in between.
    """

    def eta(k: int) -> float:
        exponent = (k - rise) / tau if k < rise else 0.0 if k < decay else (decay - k) / tau
        return eta0 * float(np.exp(exponent))

    return eta


def components_at_centres(Z: Array, centres: Array, prior: CovariancePrior) -> GaussianComponents:
    """Returns Gaussians with the given means, shape (M, d).

    The covariance of each is the regularised second moment, about its centre, of the samples nearest to it.
    """
    M, d = centres.shape
    labels = nearest_centre(Z, centres)
    counts = np.bincount(labels, minlength=M).astype(float)
    covariances = np.zeros((M, d, d))
    for i in np.flatnonzero(counts):
        offsets = Z[labels == i] - centres[i]
        covariances[i] = offsets.T @ offsets / counts[i]
    # A centre without samples gets the weight of one sample, so that it can still attract samples.
    weights = np.maximum(counts, 1.0)
    return GaussianComponents(weights / weights.sum(), centres, prior.apply(covariances, counts))


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
        distance: "euclid" or "fmle".
    """
    if distance == "fmle":
        factors = precision_factors(components.covariances)
        constant: float = 0.5 * Z.shape[1] * LOG_2PI
        squared = squared_mahalanobis(Z, components.means, factors)
        return -constant - (log_normalizers(components.weights, factors) - 0.5 * squared)
    squared = ((Z[:, None] - components.means) ** 2).sum(axis=2)
    return np.asarray(np.log(np.maximum(squared, MIN_SQUARED_DISTANCE)))


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
        distance: "euclid" or "fmle".
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
        history.n_clusters.append(len(components))
        history.eta.append(eta)
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
