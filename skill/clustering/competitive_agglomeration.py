"""Discovery of contact states: Competitive Agglomeration with the fuzzy-maximum-likelihood distance."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.exceptions import ConvergenceWarning
from sklearn.utils import check_random_state
from sklearn.utils.validation import validate_data
from threadpoolctl import threadpool_limits

from skill.arrays import Array
from skill.clustering.cluster_competition import History, Schedule, compete, exponential_schedule, ramp_schedule
from skill.clustering.cluster_initialization import (
    components_at_centres,
    components_of_partition,
    nearest_centre,
    phase_slices,
    seed_centres,
)
from skill.clustering.cluster_merging import Mixture, best_of_each_number, merge_path, polished
from skill.clustering.clustering_arguments import check_parameters, checked_groups, checked_phase
from skill.clustering.effective_sample_size import design_effect
from skill.clustering.expectation_maximization import CovariancePrior, em_step, expectation_maximization
from skill.clustering.gaussian_components import GaussianComponents
from skill.clustering.gaussian_states import GaussianStates
from skill.clustering.prototype_competition import FUZZY_ITERATIONS, compete_for_prototypes
from skill.clustering.state_number import (
    bayesian_information_criterion,
    number_of_demonstrated,
    number_of_independent,
)

SLICE_RATIO = 1.4
"""Each start by phase uses this many times fewer slices than the one before: 30, 21, 15, 11, 8."""


NEGLIGIBLE_ETA = 0.05
"""Competition weaker than this hardly moves a membership; what is left to do is done sooner by merging."""


MAX_SEARCHED = 20_000
"""Independent samples drawn to search for mixtures; all then polish them and choose their number.

A state rarer than ``min_cardinality`` among so many, 0.3 % with 14 channels, is not found."""


@dataclass(frozen=True)
class _Standardised:
    """Samples with channels of mean zero and variance one, and the way back."""

    Z: Array
    shift: Array
    scale: Array

    @classmethod
    def of(cls, X: Array, *, centred: bool, scaled: bool) -> _Standardised:
        shift = X.mean(axis=0) if centred else np.zeros(X.shape[1])
        scale = np.ones(X.shape[1])
        if scaled:
            spread = X.std(axis=0)
            # A channel that varies by round-off alone is constant: it keeps its unit.
            varies = spread > 10.0 * np.finfo(float).eps * np.abs(X).max(axis=0)
            scale[varies] = spread[varies]
        return cls((X - shift) / scale, shift, scale)

    def restored(self, components: GaussianComponents) -> GaussianComponents:
        """Components in the units of the channels, the largest first."""
        order = np.argsort(-components.weights, kind="stable")
        return GaussianComponents(
            components.weights[order],
            self.shift + self.scale * components.means[order],
            self.scale[:, None] * components.covariances[order] * self.scale,
        )


@dataclass(frozen=True)
class _Start:
    """The outcome of one start: its competition and the mixtures it merged through."""

    components: GaussianComponents
    history: History
    converged: bool
    path: list[Mixture]


class CompetitiveAgglomeration(GaussianStates):
    """Clusters samples into an unknown number of Gaussian states.

    Too many clusters start, by normalised time within the demonstrations if ``phase`` is given to `fit`, else
    at k-means++ seeds. They compete: with h_ij the posterior of cluster i for sample j and N_i = sum_j u_ij,

        u_ij = h_ij [1 + eta N / sum_k N_k^2 (N_i - sum_k h_kj N_k)],

    clipped to [0, 1] and renormalised, means and covariances weighted by u^2 / sum u^2, and clusters of small
    N_i vanish (Frigui and Krishnapuram, Pattern Recognition 30(7), 1997, with the distance of Gath and Geva,
    IEEE PAMI 11(7), 1989, normalised for each sample). The survivors are merged pair by pair, and the number
    of states is the one the evidence supports: the Bayesian information criterion, at the effective sample
    size when ``groups`` tell which samples belong to the same demonstration.

    Args:
        distance: "fmle" for Gaussian clusters; "gk" (Gustafson-Kessel) and "euclid" as published.
        bias: "posterior" as above, or "literal" for the printed equations of "fmle", which collapse.
        m_init: clusters to start with; at most N / (2 (d + 1)) are.
        eta0: initial strength of the competition; by default 1, or 5 with a phase or for "gk" and "euclid".
        tau: iterations in which it changes by a factor e.
        schedule: "exp", eta0 exp(-k / tau), or "ramp": up to iteration ``rise``, flat, down from ``decay``.
        rise: iteration at which the ramp has risen.
        decay: iteration at which the ramp starts to fall.
        min_cardinality: clusters below this vanish; by default max(5, T/2) with T the parameters of one
            Gaussian, and
            5 samples for "gk", "euclid" and "literal".
        covariance_type: "full" or "diag".
        shrinkage: samples that the spherical prior of a covariance counts for; d + 1 by default.
        reg_covar: variance added to each channel, as a fraction of the mean variance of the channels.
        sensor_variance: shape (d,) or None, known noise variance of each channel in its unit squared,
            added too.
        merge: "bic", or None to keep the clusters that survive the competition.
        init: "auto", "k-means++", "phase", centres of shape (M, d), or first labels of shape (N,).
        n_init: starts, of which the likeliest mixture of each number of states is kept; by default 5, or
            1 for
            given centres or labels.
        max_iter: most iterations of the competition, and of the final expectation-maximisation.
        tol: largest movement of a centre at rest, as a fraction of the channels' spread.
        standardize: whether to work with channels of variance one (results are in the units of X either way).
        random_state: seed of the starts.

    Attributes:
        labels_: shape (N,), state of each sample; ``history_``, ``converged_`` and ``n_iter_`` are those
            of the
            start with the likeliest mixture of the chosen number.
        history_: dict of arrays (n_iter,): "n_clusters", "eta", "log_likelihood" of the competition.
        merge_path_: shape (., 3): number of components, log-likelihood, criterion.
        n_effective_: N / design_effect_, the independent samples the demonstrations are worth.

    Beside these it has the attributes of `GaussianStates`.
    """

    def __init__(
        self,
        distance: str = "fmle",
        *,
        bias: str = "posterior",
        m_init: int = 30,
        eta0: float | None = None,
        tau: float = 10.0,
        schedule: str = "exp",
        rise: int = 10,
        decay: int = 30,
        min_cardinality: float | None = None,
        covariance_type: str = "full",
        shrinkage: float | None = None,
        reg_covar: float = 1e-6,
        sensor_variance: ArrayLike | None = None,
        merge: str | None = "bic",
        init: Any = "auto",
        n_init: int | None = None,
        max_iter: int = 100,
        tol: float = 1e-3,
        standardize: bool = True,
        random_state: Any = None,
    ) -> None:
        self.distance = distance
        self.bias = bias
        self.m_init = m_init
        self.eta0 = eta0
        self.tau = tau
        self.schedule = schedule
        self.rise = rise
        self.decay = decay
        self.min_cardinality = min_cardinality
        self.covariance_type = covariance_type
        self.shrinkage = shrinkage
        self.reg_covar = reg_covar
        self.sensor_variance = sensor_variance
        self.merge = merge
        self.init = init
        self.n_init = n_init
        self.max_iter = max_iter
        self.tol = tol
        self.standardize = standardize
        self.random_state = random_state

    def fit(self, X: ArrayLike, y: Any = None, groups: ArrayLike | None = None, phase: ArrayLike | None = None) -> Self:
        """Finds the states.

        Args:
            X: samples, shape (N, d), any units; finite.
            y: ignored.
            groups: shape (N,), the demonstration of each sample, any labels. With two or more
                demonstrations the number of states is chosen at the effective sample size; without, samples
                count as independent.
            phase: shape (N,), normalised time of each sample within its demonstration, in [0, 1]. The
                states are
                taken to come in much the same order in all demonstrations.

        Returns:
            The fitted estimator.

        Raises:
            ValueError: if a parameter or an argument is not as described; the message says what was expected.
        """
        check_parameters(self)
        samples: Array = validate_data(self, X, dtype=np.float64, ensure_min_samples=2)
        group_index = checked_groups(groups, len(samples))
        normalised_time = checked_phase(phase, len(samples))
        if self.distance == "fmle" and self.bias == "literal":
            warnings.warn(
                "bias='literal' evaluates the printed equations, which collapse to one or two clusters; use"
                " bias='posterior' to find states",
                UserWarning,
                stacklevel=2,
            )
        # Many small products: a second thread costs more than it brings, and would change the last bits.
        with threadpool_limits(1):
            self._fit(samples, group_index, normalised_time, check_random_state(self.random_state))
        return self

    def _fit(
        self,
        X: Array,
        groups: NDArray[np.intp] | None,
        phase: Array | None,
        random_state: np.random.RandomState,
    ) -> None:
        data = _Standardised.of(X, centred=self.standardize or self.distance == "fmle", scaled=self.standardize)
        Z = data.Z
        N = len(Z)
        prior = self._prior(Z, data.scale)
        first = self._first_components(Z, data, prior, phase, random_state)
        searched = Z
        # Demonstrations are searched whole: thinned, their mixtures were less often the likeliest.
        if self.merge == "bic" and groups is None and N > MAX_SEARCHED:
            searched = Z[np.sort(random_state.choice(N, MAX_SEARCHED, replace=False))]
        starts = [self._start(searched, components, prior, with_phase=phase is not None) for components in first]
        T = prior.parameters
        tau = 1.0
        if self.merge == "bic":
            found = best_of_each_number([start.path for start in starts])
            candidates = found if searched is Z else polished(Z, found, prior)
            if groups is None:
                M = number_of_independent(candidates, T, N)
            else:
                M, tau = number_of_demonstrated(candidates, T, Z, groups)
            chosen = candidates[M]
            winner = next(start for start in starts if any(mixture is found[M] for mixture in start.path))
            components, log_likelihood, converged = expectation_maximization(
                Z, chosen.components, prior, max_iter=self.max_iter, tol=1e-5 * N
            )
            path = [(m, mixture.log_likelihood) for m, mixture in candidates.items()]
        else:
            scored = [(em_step(Z, start.components).log_likelihood, start) for start in starts]
            log_likelihood, winner = min(
                scored,
                key=lambda pair: bayesian_information_criterion(pair[0], len(pair[1].components), T, N),
            )
            components, converged = winner.components, winner.converged
            if groups is not None:
                tau = design_effect(Z, components, groups)
            path = [(len(components), log_likelihood)]
        if not (converged and winner.converged):
            warnings.warn(
                f"not at rest after max_iter={self.max_iter} iterations: raise max_iter or tol",
                ConvergenceWarning,
                stacklevel=3,
            )
        self.converged_ = converged and winner.converged
        self.history_ = winner.history.arrays()
        self.n_iter_ = len(self.history_["eta"])
        self.merge_path_ = np.array(
            [(m, value, bayesian_information_criterion(value, m, T, N, tau)) for m, value in path]
        )
        distance = "fmle" if self.merge == "bic" or self.bias == "literal" else self.distance
        self._set_states(data.restored(components), distance=distance, design_effect=tau)
        self.n_effective_ = N / tau
        self.labels_ = self.predict(X)

    def _prior(self, Z: Array, scale: Array) -> CovariancePrior:
        d = Z.shape[1]
        g = float(Z.var(axis=0).mean())
        g = g if g > 0.0 else 1.0
        noise = np.zeros(d)
        if self.sensor_variance is not None:
            noise = np.asarray(self.sensor_variance, dtype=float)
            if noise.shape != (d,) or not np.isfinite(noise).all() or (noise < 0.0).any():
                raise ValueError(f"sensor_variance has shape {noise.shape}, expected ({d},): a variance >= 0 a channel")
        return CovariancePrior(
            count=float(d + 1 if self.shrinkage is None else self.shrinkage),
            variance=g,
            floor=self.reg_covar * g + noise / scale**2,
            diagonal=self.covariance_type == "diag",
        )

    def _first_components(
        self,
        Z: Array,
        data: _Standardised,
        prior: CovariancePrior,
        phase: Array | None,
        random_state: np.random.RandomState,
    ) -> list[GaussianComponents]:
        """Where each start begins."""
        N, d = Z.shape
        if not isinstance(self.init, str):
            given = np.asarray(self.init)
            if given.shape == (N,):
                return [components_of_partition(Z, np.unique(given, return_inverse=True)[1], prior)]
            if given.ndim == 2 and given.shape[1] == d and len(given) >= 1:
                return [components_at_centres(Z, (given - data.shift) / data.scale, prior)]
            raise ValueError(f"init has shape {given.shape}, expected centres (M, {d}) or labels ({N},), or 'auto'")
        n_initial = max(1, min(self.m_init, N // (2 * (d + 1))))
        n_init = 5 if self.n_init is None else self.n_init
        if self.init == "phase" and phase is None:
            raise ValueError("init='phase' needs phase: pass fit(X, phase=...) or use init='k-means++'")
        if phase is not None and self.init != "k-means++":
            slices = {max(1, round(n_initial / SLICE_RATIO**r)): None for r in range(n_init)}
            partitions = [phase_slices(phase, m) for m in slices]
        else:
            partitions = [nearest_centre(Z, seed_centres(Z, n_initial, random_state)) for _ in range(n_init)]
        return [components_of_partition(Z, labels, prior) for labels in partitions]

    def _schedule(self, *, with_phase: bool) -> Schedule:
        published = self.distance != "fmle" or self.bias == "literal"
        eta0 = self.eta0 if self.eta0 is not None else (5.0 if with_phase or published else 1.0)
        if self.schedule == "exp":
            return exponential_schedule(eta0, self.tau, begin=FUZZY_ITERATIONS if published else 0)
        return ramp_schedule(eta0, self.tau, self.rise, self.decay)

    def _start(
        self,
        Z: Array,
        components: GaussianComponents,
        prior: CovariancePrior,
        *,
        with_phase: bool,
    ) -> _Start:
        """Competition and mergers from one beginning."""
        schedule = self._schedule(with_phase=with_phase)
        merging = self.merge == "bic"
        if self.distance == "fmle" and self.bias == "posterior":
            least = max(5.0, prior.parameters / 2) if self.min_cardinality is None else self.min_cardinality
            components, history, converged = compete(
                Z,
                components,
                prior,
                schedule,
                min_cardinality=least,
                max_iter=self.max_iter,
                tol=self.tol * float(np.sqrt(prior.variance)),
                min_eta=NEGLIGIBLE_ETA if merging else 0.0,
            )
        else:
            outcome = compete_for_prototypes(
                Z,
                components,
                prior,
                schedule,
                distance=self.distance,
                # The ramp is the schedule of the author's program, whose rule for deaths goes with it.
                deaths="cardinality" if self.schedule == "exp" else "nearest",
                min_count=5.0 if self.min_cardinality is None else self.min_cardinality,
                max_iter=self.max_iter,
                tol=self.tol,
            )
            components, history, converged = outcome.components, outcome.history, outcome.converged
            if merging:
                components = components_of_partition(Z, outcome.labels, prior)
        return _Start(components, history, converged, merge_path(Z, components, prior) if merging else [])
