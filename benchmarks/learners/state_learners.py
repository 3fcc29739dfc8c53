"""Learners of contact states: this project's, with some of its choices undone, and others."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from hmmlearn.hmm import GaussianHMM
from numpy.typing import NDArray
from sklearn.cluster import KMeans
from sklearn.metrics import adjusted_rand_score, normalized_mutual_info_score, silhouette_score
from sklearn.mixture import BayesianGaussianMixture, GaussianMixture

from benchmarks.learners.gaussian_mixture_regression import best_mixture
from skill.arrays import Array, sequences
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.states.contact_states import ContactStates

MAX_STATES = 15  # largest number of states of the learners that choose by a criterion
SILHOUETTE_SAMPLES = 5000

States = NDArray[np.intp]


@dataclass(frozen=True, kw_only=True)
class Samples:
    """Samples of several recordings, in the order of time.

    Attributes:
        Z: (N, d), scaled features.
        times: (N,), time within the recording, s.
        groups: (N,), number of the recording.
        labels: (N,), true label; no learner sees it.
        phase: (N,), normalised time within the recording, in [0, 1), if the learners know it.
    """

    Z: Array
    times: Array
    groups: States
    labels: States
    phase: Array | None = None

    @property
    def lengths(self) -> list[int]:
        """Number of samples of each recording."""
        return [len(rows) for rows in sequences(self.groups)]


class Found(NamedTuple):
    """What a learner found in training samples, and says of test samples.

    Attributes:
        number: of states.
        states: (N,), state of each test sample.
        transitions: (M, M), transition matrix, if the learner has one of its own.
    """

    number: int
    states: States
    transitions: Array | None = None


Learner = Callable[[Samples, Samples, int, int | None], Found]
"""Discovers states in training samples and tells those of test samples, with a seed and the number of states if it is
told."""


def competition(train: Samples, test: Samples, seed: int, _: int | None = None, *, floor: float = 1e-6) -> Found:
    """Competitive Agglomeration with a floor under the variances: each Gaussian is a state."""
    learner = CompetitiveAgglomeration(reg_covar=floor, random_state=seed)
    fitted = learner.fit(train.Z, groups=train.groups, phase=train.phase)
    return Found(fitted.n_clusters_, fitted.predict(test.Z))


def recurring_sets(train: Samples, test: Samples, seed: int, _: int | None = None) -> Found:
    """The learner of recordings of other sensors: sets of components."""
    fitted = ContactStates(random_state=seed).fit(train.Z, groups=train.groups)
    return Found(fitted.n_clusters_, fitted.labels_ if test is train else fitted.predict(test.Z, test.groups))


def mixture(train: Samples, test: Samples, seed: int, told: int | None, *, floor: float = 1e-6) -> Found:
    """A Gaussian mixture, by default that of smallest BIC."""
    if told is None:
        best = best_mixture(train.Z, MAX_STATES, reg_covar=floor, n_init=2, random_state=seed)
    else:
        best = GaussianMixture(told, reg_covar=floor, n_init=5, random_state=seed).fit(train.Z)
    return Found(best.n_components, best.predict(test.Z))


def bayesian_mixture(train: Samples, test: Samples, seed: int, _: int | None, *, floor: float = 1e-6) -> Found:
    """A variational mixture."""
    fitted = BayesianGaussianMixture(n_components=MAX_STATES, max_iter=500, reg_covar=floor, random_state=seed)
    return Found(MAX_STATES, fitted.fit(train.Z).predict(test.Z))


def k_means(train: Samples, test: Samples, seed: int, told: int | None) -> Found:
    """k-means, by default with the number of the largest mean silhouette."""
    numbers = range(2, MAX_STATES + 1) if told is None else [told]
    fits = [KMeans(k, n_init=10, random_state=seed).fit(train.Z) for k in numbers]

    def silhouette(fit: KMeans) -> float:
        size = min(SILHOUETTE_SAMPLES, len(train.Z))
        return float(silhouette_score(train.Z, fit.labels_, sample_size=size, random_state=seed))

    best = fits[0] if told else max(fits, key=silhouette)
    return Found(best.n_clusters, best.predict(test.Z))


def hidden_markov(
    train: Samples,
    test: Samples,
    seed: int,
    told: int | None,
    *,
    floor: float = 1e-3,
    numbers: Iterable[int] = range(1, MAX_STATES + 1),
) -> Found:
    """A hidden Markov model with Gaussian emissions, by default that of smallest BIC among those that can be fitted."""
    fits = []
    for k in numbers if told is None else [told]:
        model = GaussianHMM(k, covariance_type="full", min_covar=floor, n_iter=60, random_state=seed)
        with suppress(ValueError):  # a state with too few samples
            model.fit(train.Z, train.lengths)
            fits.append((float(model.bic(train.Z, train.lengths)), k, model))
    if not fits:
        raise ValueError(f"the hidden Markov model of {told} states cannot be fitted: too few samples")
    _, _, best = min(fits)
    return Found(best.n_components, best.predict(test.Z, test.lengths), best.transmat_)


def agreement(labels: States, states: States) -> dict[str, float]:
    """Adjusted Rand index and normalised mutual information between states and true labels."""
    return {
        "ari": float(adjusted_rand_score(labels, states)),
        "nmi": float(normalized_mutual_info_score(labels, states)),
    }
