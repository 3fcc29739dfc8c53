"""Contact states of recordings: sets of components, discovered without labels and followed by a hidden Markov model."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClusterMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from skill.arrays import Array, outlier_limits, sequences
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration, checked_groups
from skill.clustering.component_sets import (
    component_sets,
    densest_component,
    recurrence_of_components,
    set_log_likelihoods,
)
from skill.clustering.gaussian_states import GaussianStates
from skill.states.hidden_markov import (
    MarkovChain,
    by_sequence,
    forward,
    learnt_chain,
    most_probable_path,
    smoothed,
)
from skill.states.recurrence import recurrent_sets

RECORDING_FLOOR = 0.01
"""Variance that is added to each channel, as a share of its variance: differences below a tenth of the spread of a
channel tell no states apart."""

VALLEY = 0.4
"""Components are merged while the density between two sets falls to no less than this share of the lower of their
peaks."""

RECURRENCE = 0.5
"""Recurrence of the components below which they tell recordings and not contacts. It is 0.59 to 1 on the snap
assemblies, and 0.27 to 0.47 on eleven of twelve sets of ten simulated insertions, whose pegs tilt to all sides; 0.77 on
one."""

SMOOTHED_SHARE, CAUSAL_SHARE = 1 / 2, 1 / 16
"""Samples, as shares of the design effect, whose evidence counts as that of one. The design effect is an upper bound:
it also counts what differs from recording to recording, which does not hide a change of state. A whole recording
corrects single samples, and a filter has to answer before it ends. Chosen on snap assemblies and simulated
insertions, where half and twice the shares find nearly the same states."""


class ContactStates(ClusterMixin, BaseEstimator):
    """Finds the contact states of recordings, such as the wrenches of several assemblies.

    1. Competitive Agglomeration with heavy tails finds components that describe the density of the samples.
    2. Components whose samples no valley of the density separates belong to the same state
       (`skill.clustering.component_sets`). The likelihood of a sample x in a state s is that of its components,
       p(x | s) = sum_(k in s) P_k p_k(x) / sum_(k in s) P_k. A component whose peak is eight times as high as that of
       any other is a state by itself: in free space a sensor shows its noise only.
    3. Where the components of such sets differ from recording to recording, because the force of one contact has
       another direction in each, Gaussians take their place: Competitive Agglomeration finds as many as the recordings
       support, and each is a state.
    4. A state recurs: a set that occurs in fewer than three recordings, or two if there are no more than three, is
       given to the state that takes its place in the others, unless there is none and a recording begins or ends with
       it (`skill.states.recurrence`).
    5. A hidden Markov model learns the transitions between the states, and finds the most probable path through them.
       Samples of a trajectory repeat each other, so the log-likelihoods are divided by a share of the design effect,
       the number of samples that carry the information of one.

    An outlier, such as a spike of the sensor, counts as a sample at its limit (`skill.arrays.outlier_limits`).

    States are numbered in the order in which they come in the recordings.

    Args:
        random_state: seed of the clusterer.

    Attributes:
        components_: the fitted components, `GaussianStates` with K components.
        component_states_: shape (K,), state of each component.
        n_clusters_: number of states M.
        chain_: probabilities of the first state and of the transitions, `MarkovChain`.
        probabilities_: shape (N, M), smoothed probability of each state.
        labels_: shape (N,), state of each sample on the most probable path.
        limits_: lower and upper limits (d,) of the channels.
        n_features_in_: number of channels d.
    """

    _parameter_constraints: dict[str, list[Any]] = {
        "random_state": ["random_state"],
    }

    components_: GaussianStates
    component_states_: NDArray[np.intp]
    chain_: MarkovChain
    limits_: tuple[Array, Array]

    def __init__(self, *, random_state: Any = None) -> None:
        self.random_state = random_state

    def fit(self, X: ArrayLike, y: Any = None, groups: ArrayLike | None = None) -> Self:
        """Finds the states.

        Args:
            X: samples, shape (N, d), in any units; those of a recording in the order of time.
            y: ignored.
            groups: shape (N,), recording of each sample, any labels; at least two recordings.

        Returns:
            The fitted estimator.

        Raises:
            ValueError: if an argument is out of range or has the wrong shape, or there is a single recording.
        """
        self._validate_params()
        samples: Array = validate_data(self, X, dtype=np.float64, ensure_min_samples=2)
        if groups is None or len(np.unique(np.asarray(groups))) < 2:
            raise ValueError("expected groups of two or more recordings: a single one does not show what they share")
        index = checked_groups(groups, len(samples))
        assert index is not None  # two groups or more
        self.limits_ = outlier_limits(samples)
        samples = np.clip(samples, *self.limits_)
        learner = CompetitiveAgglomeration(
            tails="heavy", number="density", reg_covar=RECORDING_FLOOR, random_state=self.random_state
        )
        self.components_ = learner.fit(samples, groups=index)
        memberships = learner.predict_proba(samples)
        sets = component_sets(
            samples,
            memberships,
            design_effect=learner.design_effect_,
            threshold=VALLEY,
            alone=densest_component(learner.weights_, learner.covariances_),
        )
        if recurrence_of_components(memberships.argmax(axis=1), sets, index) < RECURRENCE:
            gaussians = CompetitiveAgglomeration(random_state=self.random_state).fit(samples, groups=index)
            together = np.zeros(gaussians.n_clusters_, dtype=np.intp)
            if recurrence_of_components(gaussians.labels_, together, index) > RECURRENCE:
                self.components_ = learner = gaussians
                memberships = learner.predict_proba(samples)
                sets = np.arange(learner.n_clusters_)
        densities, weights = self._densities(samples), learner.weights_
        sets = recurrent_sets(densities, weights, sets, index, self._n_alike(SMOOTHED_SHARE))
        self.component_states_ = _in_order_of_time(sets, memberships.argmax(axis=1), index)
        self.n_clusters_ = int(sets.max()) + 1
        evidence = set_log_likelihoods(densities, weights, self.component_states_) / self._n_alike(SMOOTHED_SHARE)
        self.chain_ = learnt_chain(evidence, index)
        self.probabilities_ = by_sequence(smoothed, evidence, self.chain_, index)
        self.labels_ = by_sequence(most_probable_path, evidence, self.chain_, index).argmax(axis=1)
        return self

    def state_log_likelihoods(self, X: ArrayLike) -> Array:
        """Returns log p(x | s), shape (N, M)."""
        check_is_fitted(self, "component_states_")
        samples: Array = validate_data(self, X, dtype=np.float64, reset=False)
        return set_log_likelihoods(self._densities(samples), self.components_.weights_, self.component_states_)

    def _densities(self, samples: Array) -> Array:
        """Returns the log-density of each sample in each component with its weight, shape (N, K)."""
        return self.components_.log_densities(np.clip(samples, *self.limits_))

    def _n_alike(self, share: float) -> float:
        """Returns the number of samples whose evidence counts as that of one."""
        return max(1.0, share * self.components_.design_effect_)

    def predict_proba(self, X: ArrayLike, groups: ArrayLike | None = None, *, causal: bool = False) -> Array:
        """Returns the probability of each state, shape (N, M).

        Args:
            X: samples, shape (N, d); those of a recording in the order of time.
            groups: shape (N,), recording of each sample; None for a single recording.
            causal: whether to use the samples so far only, as on line, instead of the whole recording.
        """
        if causal:
            return self._followed(forward, CAUSAL_SHARE, X, groups)
        return self._followed(smoothed, SMOOTHED_SHARE, X, groups)

    def predict(self, X: ArrayLike, groups: ArrayLike | None = None, *, causal: bool = False) -> NDArray[np.intp]:
        """Returns the state of each sample, shape (N,); arguments as of `predict_proba`.

        The states are those of the most probable path, or with ``causal`` the most probable ones of each sample.
        """
        if causal:
            found = self.predict_proba(X, groups, causal=True)
        else:
            found = self._followed(most_probable_path, SMOOTHED_SHARE, X, groups)
        return np.asarray(found.argmax(axis=1), dtype=np.intp)

    def _followed(
        self, recursion: Callable[[Array, MarkovChain], Array], share: float, X: ArrayLike, groups: ArrayLike | None
    ) -> Array:
        """Applies a recursion to each recording, shape (N, M)."""
        evidence = self.state_log_likelihoods(X) / self._n_alike(share)
        given = np.zeros(len(evidence)) if groups is None else np.asarray(groups)
        if given.shape != (len(evidence),):
            raise ValueError(
                f"groups has shape {given.shape}, expected ({len(evidence)},): the recording of each sample"
            )
        index = np.unique(given, return_inverse=True)[1].astype(np.intp)
        return by_sequence(recursion, evidence, self.chain_, index)


def _in_order_of_time(sets: NDArray[np.intp], nearest: NDArray[np.intp], groups: NDArray[np.intp]) -> NDArray[np.intp]:
    """Numbers the states by the median time of their samples within the recordings; state of each component."""
    time = np.empty(len(groups))
    for rows in sequences(groups):
        time[rows] = np.linspace(0.0, 1.0, len(rows))
    of = sets[nearest]
    medians = [np.median(time[of == s]) if (of == s).any() else 1.0 for s in range(sets.max() + 1)]
    rank = np.argsort(np.argsort(medians))
    return rank[sets].astype(np.intp)
