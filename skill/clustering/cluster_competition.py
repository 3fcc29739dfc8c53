"""The competition: clusters with large cardinalities take samples from small ones until some vanish.

This is Competitive Agglomeration (Frigui and Krishnapuram, Pattern Recognition 30(7), 1997) with the fuzzy-
maximum-likelihood distance (Gath and Geva, IEEE PAMI 11(7), 1989) *normalised for each sample*: with d^2_ij =
1 / h_ij, h the posterior of cluster i, the membership without competition is unchanged, but the weight of the
competition no longer hangs on the few samples of least density, which is what makes the printed equations
collapse to a single cluster.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array
from skill.clustering.expectation_maximization import CovariancePrior, em_step, retained, updated
from skill.clustering.gaussian_components import GaussianComponents

Schedule = Callable[[int], float]


def exponential_schedule(eta0: float, tau: float, begin: int = 0) -> Schedule:
    """eta(k) = eta0 exp(-(k - begin) / tau) from iteration ``begin``, eta0 before."""
    return lambda k: eta0 * float(np.exp(-max(k - begin, 0) / tau))


def ramp_schedule(eta0: float, tau: float, rise: int, decay: int) -> Schedule:
    """eta(k) grows as eta0 exp((k - rise) / tau) up to ``rise``, rests, falls as exp((decay - k) / tau)."""

    def eta(k: int) -> float:
        exponent = (k - rise) / tau if k < rise else (0.0 if k < decay else (decay - k) / tau)
        return eta0 * float(np.exp(exponent))

    return eta


@dataclass
class History:
    """One entry for each iteration of the competition.

    Attributes:
        n_clusters: clusters alive.
        eta: strength of the competition.
        log_likelihood: of all samples, before the update, in nats (NaN for distances that are not
            likelihoods).
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
        """The history as arrays of shape (n_iter,)."""
        return {
            "n_clusters": np.asarray(self.n_clusters, dtype=float),
            "eta": np.asarray(self.eta, dtype=float),
            "log_likelihood": np.asarray(self.log_likelihood, dtype=float),
        }


def survivors(cardinalities: Array, least: float) -> NDArray[np.bool_]:
    """Mask of the clusters that stay: the smallest below ``least`` go, at most a tenth of all at once.

    Without the limit all die at once whenever their number times ``least`` exceeds the number of samples.
    """
    keep = np.ones(len(cardinalities), dtype=bool)
    at_most = max(1, len(cardinalities) // 10)
    smallest_first = np.argsort(cardinalities, kind="stable")[:at_most]
    keep[smallest_first[cardinalities[smallest_first] < least]] = False
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
    """Runs the competition from ``components`` until centres and number rest.

    Args:
        Z: samples, shape (N, d), of mean zero.
        components: the first, too many, Gaussians.
        prior: regularisation of the covariances.
        schedule: strength of the competition for each iteration.
        min_cardinality: clusters of a smaller cardinality vanish.
        max_iter: largest number of iterations.
        tol: stop when no centre moves by more than this (in units of Z) in three iterations without a death.
        min_eta: stop when the competition has become weaker than this, if mergers are to follow anyway.

    Returns:
        The surviving components, the history, and whether it came to rest.
    """
    history = History()
    cardinalities = components.weights * len(Z)
    calm = 0
    for k in range(max_iter):
        eta = schedule(k)
        result = em_step(Z, components, eta=eta, cardinalities=cardinalities, fuzzy=True)
        history.append(len(components), eta, result.log_likelihood)
        moved = float(np.abs(result.means - components.means).max())
        components = updated(result, prior)
        keep = survivors(result.cardinalities, min_cardinality)
        cardinalities = result.cardinalities[keep]
        if keep.all():
            calm = calm + 1 if moved < tol else 0
        else:
            calm = 0
            components = retained(components, keep)
        if calm >= 3 or schedule(k + 1) < min_eta <= eta:
            return components, history, True
    return components, history, False
