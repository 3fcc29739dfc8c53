"""Learners of contact states: the skill's own, with some of its choices undone, and others."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from hmmlearn.hmm import GaussianHMM
from numpy.typing import NDArray
from sklearn.cluster import KMeans
from sklearn.mixture import BayesianGaussianMixture

from benchmarks.learners.gaussian_mixture_regression import best_mixture
from benchmarks.learners.labelled_demonstrations import LabelledDemonstrations
from skill.arrays import Array
from skill.clustering.cluster_initialization import components_of_partition
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.clustering.expectation_maximization import CovariancePrior
from skill.manipulation_skill import STATE_FLOOR
from skill.states.contact_states import ContactStates

MAX_STATES = 15  # largest number of states of the learners that choose by a criterion

States = NDArray[np.intp]
Found = tuple[States, Array | None]
"""State of each sample (N,), and the transition matrix if the learner has one of its own."""


def competition(data: LabelledDemonstrations, seed: int, floor: float = STATE_FLOOR) -> Found:
    """Competitive Agglomeration with a floor under the variances."""
    learner = CompetitiveAgglomeration(reg_covar=floor, random_state=seed)
    fitted = learner.fit(data.Z, groups=data.groups, phase=data.phase)
    return fitted.predict(data.Z), None


def on_regressor_features(data: LabelledDemonstrations, seed: int) -> Found:
    """Competitive Agglomeration on the features of the regressor, without a floor."""
    return competition(data.as_the_regressor_sees_it(), seed, floor=1e-6)


def recurring_sets(data: LabelledDemonstrations, seed: int) -> Found:
    """The learner of recordings of other sensors: sets of components."""
    return ContactStates(random_state=seed).fit(data.Z, groups=data.groups).labels_, None


def mixture_by_bic(data: LabelledDemonstrations, seed: int) -> Found:
    """The Gaussian mixture of smallest BIC."""
    best = best_mixture(data.Z, MAX_STATES, reg_covar=STATE_FLOOR, n_init=2, random_state=seed)
    return best.predict(data.Z), None


def bayesian_mixture(data: LabelledDemonstrations, seed: int) -> Found:
    """A variational mixture."""
    mixture = BayesianGaussianMixture(n_components=MAX_STATES, max_iter=500, reg_covar=STATE_FLOOR, random_state=seed)
    return mixture.fit_predict(data.Z), None


def k_means(data: LabelledDemonstrations, seed: int) -> Found:
    """k-means with the number of states of the competition."""
    count = competition(data, seed)[0].max() + 1
    return KMeans(int(count), n_init=10, random_state=seed).fit_predict(data.Z), None


def hidden_markov(data: LabelledDemonstrations, seed: int) -> Found:
    """The hidden Markov model with Gaussian emissions of smallest BIC, among odd numbers of states."""
    models = []
    for k in range(1, MAX_STATES + 1, 2):
        model = GaussianHMM(k, covariance_type="full", min_covar=STATE_FLOOR, n_iter=60, random_state=seed)
        models.append(model.fit(data.Z, data.lengths))
    best = min(models, key=lambda model: model.bic(data.Z, data.lengths))
    return best.predict(data.Z, data.lengths), best.transmat_


def true_gaussians(data: LabelledDemonstrations, seed: int) -> Found:
    """Gaussians fitted to the true labels: an upper bound for learners with one Gaussian per state."""
    _, dense = np.unique(data.labels, return_inverse=True)
    return gaussian_states(data.Z, dense).predict(data.Z), None


def gaussian_states(Z: Array, states: States) -> CompetitiveAgglomeration:
    """A classifier with one Gaussian per state, from samples (N, d) and their states (N,)."""
    d = Z.shape[1]
    prior = CovariancePrior(count=d + 1.0, variance=1.0, floor=np.full(d, STATE_FLOOR), diagonal=False)
    components = components_of_partition(Z, states, prior)
    factors = np.stack([np.linalg.inv(np.linalg.cholesky(F)).T for F in components.covariances])
    return CompetitiveAgglomeration.from_arrays(
        {
            "weights": components.weights,
            "means": components.means,
            "covariances": components.covariances,
            "precision_factors": factors,
            "design_effect": np.array(1.0),
            "distance": np.array("fmle"),
        }
    )


LEARNERS: dict[str, Callable[[LabelledDemonstrations, int], Found]] = {
    "CA-FMLE": competition,
    "CA-FMLE, no floor": partial(competition, floor=1e-6),
    "... and regressor's features": on_regressor_features,
    "ContactStates": recurring_sets,
    "GMM-BIC": mixture_by_bic,
    "BayesianGaussianMixture": bayesian_mixture,
    "k-means": k_means,
    "HMM": hidden_markov,
    "Gaussians of true labels": true_gaussians,
}
