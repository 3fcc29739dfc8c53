"""Competition between clusters: large clusters take samples from small ones until the small ones vanish.

This is Competitive Agglomeration (Frigui and Krishnapuram, Pattern Recognition 30(7), 1997) with the fuzzy-maximum-
likelihood distance (Gath and Geva, IEEE PAMI 11(7), 1989), *normalised for each sample*: d^2_ij = 1 / h_ij, where h_ij
is the posterior of cluster i. Without competition, the memberships are the same as for the printed distance. With
competition, its strength no longer depends on the few samples of lowest density, which make the printed equations
collapse to a single cluster.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array
from skill.clustering.expectation_maximization import CovariancePrior, em_step, retained, updated_components
from skill.clustering.gaussian_components import GaussianComponents

Schedule = Callable[[int], float]
"""Strength of the competition, eta, as a function of the iteration."""

MIN_STILL_ITERATIONS = 3
"""The competition has converged after this many consecutive iterations in which no centre moved and no cluster died."""


def exponential_schedule(eta0: float, tau: float, begin: int = 0) -> Schedule:
    """Returns eta(k) = eta0 exp(-(k - begin) / tau), and eta0 before iteration ``begin``."""
    return lambda k: eta0 * float(np.exp(-max(k - begin, 0) / tau))


def ramp_schedule(eta0: float, tau: float, rise: int, decay: int) -> Schedule:
    """Returns a schedule that rises to a plateau and falls again.

    eta(k) is eta0 exp((k - rise) / tau) before iteration ``rise``, eta0 exp((decay - k) / tau) from iteration
    ``decay``, and eta0 in between.
    """

    def eta(k: int) -> float:
        if k < rise:
            exponent = (k - rise) / tau
        elif k < decay:
            exponent = 0.0
        else:
            exponent = (decay - k) / tau
        return eta0 * float(np.exp(exponent))

    return eta


@dataclass
class History:
    """Course of the competition, one entry for each iteration.

    Attributes:
        n_clusters: number of clusters before the update.
        eta: strength of the competition.
        log_likelihood: log-likelihood of all samples before the update, in nats; NaN for distances without a
            likelihood.
    """

    n_clusters: list[int] = field(default_factory=list)
    eta: list[float] = field(default_factory=list)
    log_likelihood: list[float] = field(default_factory=list)

    def append(self, n_clusters: int, eta: float, log_likelihood: float) -> None:
        """Adds one iteration."""
        self.n_clusters.append(n_clusters)
        self.eta.append(eta)
        self.log_likelihood.append(log_likelihood)

    def arrays(self) -> dict[str, Array]:
        """Returns the history as arrays of shape (n_iter,), keyed by attribute."""
        return {
            "n_clusters": np.asarray(self.n_clusters, dtype=float),
            "eta": np.asarray(self.eta, dtype=float),
            "log_likelihood": np.asarray(self.log_likelihood, dtype=float),
        }


def survivors(cardinalities: Array, min_cardinality: float) -> NDArray[np.bool_]:
    """Returns the mask (M,) of the clusters that survive an iteration.

    Clusters with a cardinality below ``min_cardinality`` die, the smallest first, but at most a tenth of all clusters
    (at least one) in an iteration. Without this limit all clusters would die at once if M ``min_cardinality`` exceeds
    the number of samples. The last cluster never dies.
    """
    keep = np.ones(len(cardinalities), dtype=bool)
    max_deaths = max(1, len(cardinalities) // 10)
    smallest = np.argsort(cardinalities, kind="stable")[:max_deaths]
    keep[smallest[cardinalities[smallest] < min_cardinality]] = False
    if not keep.any():
        keep[int(np.argmax(cardinalities))] = True
    return keep


def compete(
    Z: Array,
    components: GaussianComponents,
    prior: CovariancePrior,
    schedule: Schedule,
    *,
    min_cardinality: float,
    max_iter: int,
    tol: float,
    min_eta: float = 0.0,
) -> tuple[GaussianComponents, History, bool]:
    """Runs the competition until it converges.

    It converges when in `MIN_STILL_ITERATIONS` consecutive iterations no cluster died and no coordinate of a centre
    moved by ``tol``, or when its strength falls below ``min_eta``.

    Args:
        Z: samples, shape (N, d), of mean zero.
        components: initial Gaussians, more than there are clusters.
        prior: regularisation of the covariances.
        schedule: strength of the competition in each iteration.
        min_cardinality: clusters with a smaller cardinality die.
        max_iter: maximum number of iterations.
        tol: distance in the units of Z below which a centre counts as still.
        min_eta: strength below which the competition ends. Use it if mergers follow.

    Returns:
        The surviving components, the history, and whether the competition converged.
    """
    history = History()
    cardinalities = components.weights * len(Z)
    still_iterations = 0
    for k in range(max_iter):
        eta = schedule(k)
        step = em_step(Z, components, eta=eta, cardinalities=cardinalities, fuzzy=True)
        history.append(len(components), eta, step.log_likelihood)
        movement = float(np.abs(step.means - components.means).max())
        components = updated_components(step, prior, components.degrees)
        keep = survivors(step.cardinalities, min_cardinality)
        cardinalities = step.cardinalities[keep]
        if keep.all():
            still_iterations = still_iterations + 1 if movement < tol else 0
        else:
            still_iterations = 0
            components = retained(components, keep)
        if still_iterations >= MIN_STILL_ITERATIONS or schedule(k + 1) < min_eta <= eta:
            return components, history, True
    return components, history, False
