"""Contexts: what stays the same during a demonstration, and what one sample cannot show.

The same measurement can ask for opposite actions, for example with the pivot of the gimbal above or below the contact.
What tells the two cases apart is how the measurement *answers* to an own motion, and that answer keeps its law during a
whole demonstration. A context is such a law. `ContextMixture` discovers contexts as a mixture of regressions in which
all samples of a demonstration g share one context k:

    p(Y_g | X_g, U_g) = sum_k pi_k prod_t p(y_t | x_t, u_t, k).

Each p is the `ResponseModel` of the samples, weighted by the responsibilities r_gk of their demonstrations. EM
alternates between

    r_gk ~ pi_k exp( sum_t sum_p log p(y_tp | x_t, u_t, k without g) / tau_p ),    pi_k = mean_g r_gk,

and the regressions, which need no step of their own. It deviates twice from textbook EM (Dempster, Laird, Rubin, J. R.
Stat. Soc. B 39(1), 1977; for regressions DeSarbo, Cron, J. Classif. 5, 1988):

* *Without g*: a demonstration is predicted from the others alone. A flexible regression would otherwise reproduce the
  demonstration itself, in every context.
* tau_p is the integrated autocorrelation time of output p, in samples (Geyer, Stat. Sci. 7(4), 1992): consecutive
  samples repeat each other, and their evidence counts only once.

The number of contexts, and the best of several random starts, are those which predict unseen halves best: the first
half of each demonstration gives the probabilities of its contexts, and these predict its second half. One context more
must gain more than one standard error of the gain over the demonstrations, and hold at least two of them; otherwise
there is nothing to find.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import log_softmax, logsumexp, softmax
from sklearn.base import BaseEstimator
from sklearn.utils._param_validation import Interval
from sklearn.utils.validation import check_array, check_consistent_length, check_is_fitted

from skill.arrays import Array, standard_scale
from skill.data.array_schema import MIN_POSITIVE, ArrayRule, check_arrays
from skill.regression.response_model import (
    RESPONSE_RULES,
    ResponseModel,
    ResponseSamples,
    response_arrays,
    restored_responses,
)

MAX_SAMPLES = 3000
"""Most samples that are kept; more are thinned evenly. The time of a fit grows with their square."""

MAX_CONTEXTS = 3
"""Largest number of contexts that is selected by default."""

STARTS = 12
"""Number of random starts of EM for each number of contexts."""

MAX_ITERATIONS = 50
"""Largest number of iterations of EM."""

TOLERANCE = 1e-3
"""Largest change of a responsibility at which EM ends."""

MIN_WEIGHT = 0.02
"""Smallest weight pi_k."""

MIN_GROUPS = 2.0
"""Smallest sum of the responsibilities of a context: what a single demonstration shows is its own peculiarity."""

MAX_SUM_ERROR = 1e-6

RULES = {
    "bandwidth": ArrayRule(low=MIN_POSITIVE),
    **RESPONSE_RULES,
    "correlation_times": ArrayRule(("p",), low=1.0),
    "group": ArrayRule(("n",), holds="integers", low=0),
    "groups": ArrayRule(("G",), holds="integers", low=0),
    "responsibilities": ArrayRule(("G", "C"), low=0.0, high=1.0 + MAX_SUM_ERROR),
}
"""The arrays of a stored `ContextMixture`: n samples of G groups, C contexts."""


@dataclass(frozen=True)
class _Fit:
    """One result of EM: responsibilities (G, K), and the log-likelihood of each sample (n, K)."""

    responsibilities: Array
    samples: Array


class ContextMixture(BaseEstimator):
    """Mixture of locally weighted regressions over groups of samples; see the module.

    Args:
        n_contexts: number of contexts K; None selects it.
        max_contexts: largest number that is selected.
        bandwidth: h of the kernel, in standard deviations of the features.
        random_state: seed of the starts.

    Attributes:
        n_contexts_: number of contexts K.
        groups_: (G,), the names of the groups.
        responsibilities_: (G, K), probabilities of the contexts of each group.
        weights_: (K,), pi.
        memberships_: (n, K), probabilities of the contexts of each sample that is kept.
        gains_: (mean, standard error) of the left-out log-likelihood of a group with 2, 3, ... contexts, less that with
            one context fewer; empty if ``n_contexts`` is given.
        correlation_times_: (p,), tau, in samples.
        samples_, scales_, centre_, model_: the samples, their units, and the regression over them.
    """

    _parameter_constraints: dict[str, list[Any]] = {
        "n_contexts": [Interval(Integral, 1, None, closed="left"), None],
        "max_contexts": [Interval(Integral, 1, None, closed="left")],
        "bandwidth": [Interval(Real, 0, None, closed="neither")],
    }

    def __init__(
        self,
        *,
        n_contexts: int | None = None,
        max_contexts: int = MAX_CONTEXTS,
        bandwidth: float = 1.5,
        random_state: int | None = 0,
    ) -> None:
        self.n_contexts = n_contexts
        self.max_contexts = max_contexts
        self.bandwidth = bandwidth
        self.random_state = random_state

    def fit(self, X: ArrayLike, y: ArrayLike, *, inputs: ArrayLike, groups: ArrayLike) -> Self:
        """Discovers the contexts.

        Args:
            X: (n, d), features.
            y: (n, p), outputs: how the measurement answers.
            inputs: (n, q), own motions.
            groups: (n,), the demonstration of each sample; the samples of one are in the order of time.

        Raises:
            ValueError: if shapes differ, a number is not finite, a parameter is out of range, or there are fewer than
                two groups.
        """
        self._validate_params()
        given = {"X": X, "y": y, "inputs": inputs}
        features, answers, motions = (check_array(a, dtype=np.float64, input_name=name) for name, a in given.items())
        names = np.asarray(groups)
        check_consistent_length(features, answers, motions, names)
        stride = -(-len(features) // MAX_SAMPLES)
        rows = np.argsort(names, kind="stable")[::stride]  # one group after the other, each in the order of time
        self.groups_, group = np.unique(names[rows], return_inverse=True)
        if len(self.groups_) < 2:
            raise ValueError(f"contexts differ between groups: found {len(self.groups_)} group, expected at least 2")
        self.scales_ = standard_scale(features[rows]), standard_scale(motions[rows]), standard_scale(answers[rows])
        self.centre_ = answers[rows].mean(axis=0)
        self.samples_ = self._scaled(features[rows], motions[rows], answers[rows])
        self.model_ = ResponseModel(self.samples_)
        kernel = self.samples_.kernel(self.samples_.X, self.bandwidth)
        kernel[group[:, None] == group[None]] = 0.0
        residuals, _ = self.model_.residuals(kernel, self.samples_.U, self.samples_.Y)
        thinned = correlation_times(residuals, group)
        self.correlation_times_ = thinned * stride
        em = _ExpectationMaximization(self.model_, self.samples_, kernel, group, thinned)
        rng = np.random.default_rng(self.random_state)
        if self.n_contexts is None:
            found = self._selected(em, rng)
        else:
            self.gains_: list[tuple[float, float]] = []
            found = self._best(em, self.n_contexts, rng)
        self._store(found.responsibilities, group)
        return self

    def log_likelihoods(self, X: ArrayLike, y: ArrayLike, *, inputs: ArrayLike) -> Array:
        """Returns the evidence (m, K) of samples: their log-likelihood in each context, over the correlation times."""
        check_is_fitted(self)
        queries = self._scaled(*(np.asarray(values, dtype=float) for values in (X, inputs, y)))
        kernel = self.samples_.kernel(queries.X, self.bandwidth)
        return self.model_.log_likelihoods(kernel, self.memberships_, queries.U, queries.Y, self.correlation_times_)

    def predict_proba(self, X: ArrayLike, y: ArrayLike, *, inputs: ArrayLike, groups: ArrayLike) -> Array:
        """Returns the probabilities (G, K) of the contexts of other groups, in the order of ``np.unique(groups)``."""
        names, group = np.unique(np.asarray(groups), return_inverse=True)
        evidence = _group_sums(self.log_likelihoods(X, y, inputs=inputs), group, len(names))
        return softmax(np.log(self.weights_) + evidence, axis=1)

    def probabilities_of(self, groups: ArrayLike) -> Array:
        """Returns the responsibilities (n, K) of groups (n,) by their names; ``weights_`` for those without samples."""
        names = np.asarray(groups)
        place = np.minimum(np.searchsorted(self.groups_, names), len(self.groups_) - 1)
        known = self.groups_[place] == names
        return np.where(known[:, None], self.responsibilities_[place], self.weights_)

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The fitted estimator as plain arrays, which can be stored without pickle."""
        check_is_fitted(self)
        return {
            "bandwidth": np.array(float(self.bandwidth)),
            **response_arrays(self.samples_, self.scales_, self.centre_),
            "correlation_times": self.correlation_times_,
            "group": self._group,
            "groups": self.groups_,
            "responsibilities": self.responsibilities_,
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Restores an estimator from ``to_arrays``; its evidence is bit-identical.

        Raises:
            ValueError: if an array is missing, unknown, or does not fit the others.
        """
        sizes = check_arrays(arrays, RULES, "ContextMixture.to_arrays")
        group = np.asarray(arrays["group"], dtype=np.intp)
        R = np.array(arrays["responsibilities"], dtype=float)
        if group.max() >= sizes["G"]:
            raise ValueError(f"array 'group' goes up to {group.max()}, expected below {sizes['G']}")
        if (np.diff(arrays["groups"]) <= 0).any():
            raise ValueError("array 'groups': expected increasing numbers")
        if np.abs(R.sum(axis=1) - 1.0).max() > MAX_SUM_ERROR:
            raise ValueError("array 'responsibilities': expected rows that sum to one")
        self = cls(n_contexts=sizes["C"], bandwidth=float(arrays["bandwidth"]))
        self.samples_, self.scales_, self.centre_ = restored_responses(arrays)
        self.model_ = ResponseModel(self.samples_)
        self.correlation_times_ = np.array(arrays["correlation_times"], dtype=float)
        self.groups_, self.gains_ = np.array(arrays["groups"]), []
        self._store(R, group)
        return self

    def _selected(self, em: _ExpectationMaximization, rng: np.random.Generator) -> _Fit:
        """The result with the fewest contexts to which one more adds no more than its standard error."""
        best, self.gains_ = em.run(np.ones((em.n_groups, 1))), []
        score = em.split_score(best)
        for number in range(2, 1 + min(self.max_contexts, em.n_groups)):
            found = self._best(em, number, rng)
            found_score = em.split_score(found)
            gain = found_score - score
            mean, error = float(gain.mean()), float(gain.std(ddof=1) / np.sqrt(len(gain)))
            self.gains_.append((mean, error))
            if mean <= error or found.responsibilities.sum(axis=0).min() < MIN_GROUPS:
                break
            best, score = found, found_score
        return best

    def _best(self, em: _ExpectationMaximization, number: int, rng: np.random.Generator) -> _Fit:
        starts = [rng.dirichlet(np.ones(number), em.n_groups) for _ in range(STARTS)]
        found = [em.run(start) for start in starts]
        return max(found, key=lambda fit: float(em.split_score(fit).sum()))

    def _store(self, responsibilities: Array, group: NDArray[np.intp]) -> None:
        self.responsibilities_ = responsibilities
        self.n_contexts_ = responsibilities.shape[1]
        self.weights_ = _weights(responsibilities)
        self.memberships_ = np.ascontiguousarray(responsibilities[group])
        self._group = group

    def _scaled(self, X: Array, U: Array, Y: Array) -> ResponseSamples:
        of_X, of_U, of_Y = self.scales_
        return ResponseSamples(X / of_X, U / of_U, (Y - self.centre_) / of_Y)


class _ExpectationMaximization:
    """EM on one set of samples, whose ``group`` (n,) does not decrease; ``times`` (p,) are tau."""

    def __init__(
        self, model: ResponseModel, samples: ResponseSamples, kernel: Array, group: NDArray[np.intp], times: Array
    ) -> None:
        self._model = model
        self._samples = samples
        self._kernel = kernel
        self._group = group
        self._times = times
        self.n_groups = int(group.max()) + 1

    def run(self, start: Array) -> _Fit:
        """Returns the result of EM from responsibilities (G, K)."""
        responsibilities = start
        for _ in range(MAX_ITERATIONS):
            evidence = self._evidence(responsibilities)
            updated = softmax(np.log(_weights(responsibilities)) + self._sums(evidence), axis=1)
            change = np.abs(updated - responsibilities).max()
            responsibilities = updated
            if change <= TOLERANCE:
                break
        return _Fit(responsibilities, evidence)

    def split_score(self, fit: _Fit) -> Array:
        """Returns the log-likelihood (G,) of the second half of each group, given the first half."""
        order = np.arange(len(self._group)) - np.searchsorted(self._group, self._group)
        late = order >= (np.bincount(self._group) // 2)[self._group]
        first = np.log(_weights(fit.responsibilities)) + self._sums(np.where(late[:, None], 0.0, fit.samples))
        second = self._sums(np.where(late[:, None], fit.samples, 0.0))
        return logsumexp(log_softmax(first, axis=1) + second, axis=1)

    def _evidence(self, responsibilities: Array) -> Array:
        """Log-likelihoods (n, K) of the samples, each from the other groups."""
        memberships, samples = responsibilities[self._group], self._samples
        return self._model.log_likelihoods(self._kernel, memberships, samples.U, samples.Y, self._times)

    def _sums(self, evidence: Array) -> Array:
        return _group_sums(evidence, self._group, self.n_groups)


def correlation_times(residuals: Array, group: NDArray[np.intp]) -> Array:
    """Returns the integrated autocorrelation times (p,) of residuals (n, p) within groups, in samples, at least 1.

    tau = 1 + 2 sum_l rho_l over the lags l, up to the first pair of lags whose sum is not positive (Geyer's initial
    positive sequence). The groups are runs of equal numbers in ``group`` (n,).
    """
    blocks = [residuals[group == g] for g in np.unique(group)]
    longest = max(len(block) for block in blocks)
    variance = (residuals**2).sum(axis=0)
    times = np.ones(residuals.shape[1])
    going = variance > 0
    for lag in range(1, longest - 1, 2):
        pair = np.zeros(residuals.shape[1])
        for block in blocks:
            for step in (lag, lag + 1):
                pair += (block[:-step] * block[step:]).sum(axis=0)
        going &= pair > 0
        if not going.any():
            break
        times[going] += 2.0 * pair[going] / variance[going]
    return times


def _group_sums(evidence: Array, group: NDArray[np.intp], number: int) -> Array:
    """Sums (G, K) of the evidence (n, K) of the samples of each group."""
    sums = np.zeros((number, evidence.shape[1]))
    np.add.at(sums, group, evidence)
    return sums


def _weights(responsibilities: Array) -> Array:
    weights = np.maximum(responsibilities.mean(axis=0), MIN_WEIGHT)
    normalised: Array = weights / weights.sum()
    return normalised
