"""Discovery of contact states: Competitive Agglomeration with the fuzzy-maximum-likelihood distance."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
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
from skill.clustering.clustering_arguments import (
    PARAMETER_CONSTRAINTS,
    checked_groups,
    checked_phase,
    checked_sensor_variance,
)
from skill.clustering.effective_sample_size import design_effect
from skill.clustering.expectation_maximization import CovariancePrior, em_step, expectation_maximization
from skill.clustering.gaussian_components import GaussianComponents
from skill.clustering.gaussian_states import GaussianStates
from skill.clustering.prototype_competition import FUZZY_ITERATIONS, compete_for_prototypes
from skill.clustering.standardised_samples import StandardisedSamples
from skill.clustering.state_number import (
    bayesian_information_criterion,
    number_for_density,
    number_of_demonstrated,
    number_of_independent,
)
from skill.clustering.student_tails import STUDENT_DEGREES

SLICE_RATIO = 1.4
"""Ratio between the numbers of time slices of consecutive starts by phase: 30, 21, 15, 11, 8."""

NEGLIGIBLE_ETA = 0.05
"""Strength of the competition below which it hardly changes memberships; merging then continues faster."""

MAX_SEARCHED = 20_000
"""Maximum number of independent samples in the search for mixtures. All samples then polish the mixtures and choose
their number. A state with fewer than ``min_cardinality`` of these samples (0.3 % with 14 channels) is not found."""


@dataclass(frozen=True)
class _Start:
    """Result of one start: its competition, and the mixtures of its mergers (empty without merging)."""

    components: GaussianComponents
    history: History
    converged: bool
    path: list[Mixture]


@dataclass(frozen=True)
class _Selection:
    """Selected mixture, its start, the design effect under it, and (number, log-likelihood) of all candidates."""

    components: GaussianComponents
    converged: bool
    start: _Start
    design_effect: float
    candidates: list[tuple[int, float]]


class CompetitiveAgglomeration(GaussianStates):
    """Clusters samples into an unknown number of Gaussian states.

    The initial partition has more clusters than there are states. It consists of slices of normalised time if
    ``phase`` is given to `fit`, and otherwise of the samples nearest to k-means++ seeds. The clusters compete. With
    the posterior h_ij of cluster i for sample j and the cardinality N_i = sum_j u_ij, the memberships are

        u_ij = h_ij [1 + eta N / sum_k N_k^2 (N_i - sum_k h_kj N_k)],

    clipped to [0, 1] and normalised. Means and covariances are weighted by u^2 / sum u^2. Clusters with a small N_i
    die (Frigui and Krishnapuram, Pattern Recognition 30(7), 1997, with the distance of Gath and Geva, IEEE PAMI
    11(7), 1989, normalised for each sample). The surviving clusters are merged pair by pair. The number of states is
    the one that the evidence supports: it minimises the Bayesian information criterion, or follows from a comparison
    at the effective sample size (`skill.clustering.state_number`) if ``groups`` are given to `fit`.

    Args:
        distance: "fmle" for Gaussian clusters; "gk" (Gustafson-Kessel) or "euclid" for the published algorithm.
        bias: "posterior" as above, or "literal" for the printed equations of "fmle", which collapse.
        m_init: initial number of clusters, at most N / (2 (d + 1)).
        eta0: initial strength of the competition. None means 1, or 5 with a phase and for "gk", "euclid" and
            "literal".
        tau: number of iterations in which the strength changes by a factor e.
        schedule: "exp" for eta0 exp(-k / tau), or "ramp" for a rise until iteration ``rise``, a plateau, and a decay
            from iteration ``decay``.
        rise: first iteration of the plateau of the ramp.
        decay: first iteration of the decay of the ramp.
        min_cardinality: clusters with a smaller cardinality die. None means max(5, T/2) with T the number of
            parameters of one Gaussian, and 5 for "gk", "euclid" and "literal".
        tails: "normal" for Gaussians, or "heavy" for Student distributions with 4 degrees of freedom
            (`skill.clustering.student_tails`), which impacts and other rare samples hardly change. Only the posteriors
            of "fmle" know tails.
        covariance_type: "full" or "diag".
        shrinkage: weight of the spherical prior of a covariance, as a number of samples; None means d + 1.
        reg_covar: variance added to each channel, as a fraction of the mean variance of the channels.
        sensor_variance: shape (d,), known noise variance that is also added to each channel, in its unit squared;
            None means zero.
        merge: "bic", or None to keep the clusters that survive the competition.
        number: with ``groups`` and mergers, "states" for components each of which is a state, or "density" for as many
            components as describe the density (`skill.clustering.state_number`).
        init: "auto" (by phase if there is one), "k-means++", "phase", centres of shape (M, d), or initial labels of
            shape (N,).
        n_init: number of starts; the mixture of maximum likelihood is kept for each number of states. None means 5.
            Given centres or labels have one start.
        max_iter: maximum number of iterations of the competition, and of the final expectation-maximisation.
        tol: a centre is still if it moves by less than this fraction of the channels' standard deviation.
        standardize: whether to scale the channels to variance one. Results are in the units of X in both cases.
        random_state: seed of the starts.

    Attributes:
        labels_: shape (N,), state of each sample.
        history_: course of the competition of the selected start, "n_clusters", "eta" and "log_likelihood", each of
            shape (n_iter_,).
        n_iter_: number of iterations of this competition.
        converged_: whether this competition and the final expectation-maximisation converged.
        merge_path_: shape (., 3), number of components, log-likelihood and criterion of each candidate.
        n_effective_: effective number of independent samples, N / ``design_effect_``.

    It also has the attributes of `GaussianStates`.
    """

    _parameter_constraints = PARAMETER_CONSTRAINTS

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
        tails: str = "normal",
        covariance_type: str = "full",
        shrinkage: float | None = None,
        reg_covar: float = 1e-6,
        sensor_variance: ArrayLike | None = None,
        merge: str | None = "bic",
        number: str = "states",
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
        self.tails = tails
        self.covariance_type = covariance_type
        self.shrinkage = shrinkage
        self.reg_covar = reg_covar
        self.sensor_variance = sensor_variance
        self.merge = merge
        self.number = number
        self.init = init
        self.n_init = n_init
        self.max_iter = max_iter
        self.tol = tol
        self.standardize = standardize
        self.random_state = random_state

    def fit(self, X: ArrayLike, y: Any = None, groups: ArrayLike | None = None, phase: ArrayLike | None = None) -> Self:
        """Finds the states.

        Args:
            X: samples, shape (N, d), in any units; finite.
            y: ignored.
            groups: shape (N,), demonstration of each sample, any labels. With two or more demonstrations, the number
                of states is chosen at the effective sample size. Otherwise samples count as independent.
            phase: shape (N,), normalised time of each sample within its demonstration, in [0, 1]. It is useful if
                the states come in a similar order in all demonstrations.

        Returns:
            The fitted estimator.

        Raises:
            ValueError: if a parameter or an argument is out of range or has the wrong shape.
        """
        self._validate_params()
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
        # The matrix products are small: a second thread costs time and would change the last bits.
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
        """Finds the states of checked samples and sets the fitted attributes."""
        data = StandardisedSamples.of(X, centred=self.standardize or self.distance == "fmle", scaled=self.standardize)
        Z = data.Z
        N = len(Z)
        prior = self._prior(data)
        degrees = STUDENT_DEGREES if self.tails == "heavy" else np.inf
        initial = [replace(c, degrees=degrees) for c in self._initialize(data, prior, phase, random_state)]
        searched = Z
        # Demonstrations are searched with all samples: thinned, they gave the best mixture less often.
        if self.merge == "bic" and groups is None and N > MAX_SEARCHED:
            searched = Z[np.sort(random_state.choice(N, MAX_SEARCHED, replace=False))]
        starts = [self._run_start(searched, components, prior, with_phase=phase is not None) for components in initial]
        if self.merge == "bic":
            selection = self._select_by_evidence(Z, starts, prior, groups, polish=searched is not Z)
            distance = "fmle"
        else:
            selection = self._select_start(Z, starts, prior, groups)
            distance = "fmle" if self.bias == "literal" else self.distance
        self.converged_ = selection.converged and selection.start.converged
        if not self.converged_:
            warnings.warn(
                f"not converged after max_iter={self.max_iter} iterations: raise max_iter or tol",
                ConvergenceWarning,
                stacklevel=3,
            )
        tau = selection.design_effect
        self.history_ = selection.start.history.arrays()
        self.n_iter_ = len(self.history_["eta"])
        self.merge_path_ = np.array(
            [
                (M, value, bayesian_information_criterion(value, M, prior.parameters, N, tau))
                for M, value in selection.candidates
            ]
        )
        self._set_states(data.restored(selection.components), distance=distance, design_effect=tau)
        self.n_effective_ = N / tau
        self.labels_ = self._log_memberships_of(X, *self.marginal())[0].argmax(axis=1)

    def _select_by_evidence(
        self, Z: Array, starts: list[_Start], prior: CovariancePrior, groups: NDArray[np.intp] | None, *, polish: bool
    ) -> _Selection:
        """Chooses the number of states among the merged mixtures, and runs EM on the chosen mixture.

        ``polish`` tells that the mixtures were found with a part of the samples.
        """
        N = len(Z)
        found = best_of_each_number([start.path for start in starts])
        candidates = polished(Z, found, prior) if polish else found
        if groups is None:
            M, tau = number_of_independent(candidates, prior.parameters, N), 1.0
        else:
            choose = number_for_density if self.number == "density" else number_of_demonstrated
            M, tau = choose(candidates, prior.parameters, Z, groups)
        components, _, converged = expectation_maximization(
            Z, candidates[M].components, prior, max_iter=self.max_iter, tol=1e-5 * N
        )
        return _Selection(
            components,
            converged,
            start=next(start for start in starts if any(mixture is found[M] for mixture in start.path)),
            design_effect=tau,
            candidates=[(m, mixture.log_likelihood) for m, mixture in candidates.items()],
        )

    def _select_start(
        self, Z: Array, starts: list[_Start], prior: CovariancePrior, groups: NDArray[np.intp] | None
    ) -> _Selection:
        """Chooses the start whose surviving clusters have the minimum BIC."""
        scored = [(em_step(Z, start.components).log_likelihood, start) for start in starts]
        log_likelihood, best = min(
            scored,
            key=lambda pair: bayesian_information_criterion(pair[0], len(pair[1].components), prior.parameters, len(Z)),
        )
        return _Selection(
            best.components,
            best.converged,
            start=best,
            design_effect=1.0 if groups is None else design_effect(Z, best.components, groups),
            candidates=[(len(best.components), log_likelihood)],
        )

    def _prior(self, data: StandardisedSamples) -> CovariancePrior:
        """Returns the regularisation of the covariances."""
        d = data.Z.shape[1]
        g = float(data.Z.var(axis=0).mean())
        g = g if g > 0.0 else 1.0
        noise = checked_sensor_variance(self.sensor_variance, d)
        return CovariancePrior(
            count=float(d + 1 if self.shrinkage is None else self.shrinkage),
            variance=g,
            floor=self.reg_covar * g + noise / data.scale**2,
            diagonal=self.covariance_type == "diag",
        )

    def _initialize(
        self,
        data: StandardisedSamples,
        prior: CovariancePrior,
        phase: Array | None,
        random_state: np.random.RandomState,
    ) -> list[GaussianComponents]:
        """Returns the initial components of each start."""
        Z = data.Z
        N, d = Z.shape
        if not isinstance(self.init, str):
            given = np.asarray(self.init)
            if given.shape == (N,):
                return [components_of_partition(Z, np.unique(given, return_inverse=True)[1], prior)]
            if given.ndim == 2 and given.shape[1] == d and len(given) >= 1:
                return [components_at_centres(Z, (given - data.shift) / data.scale, prior)]
            raise ValueError(f"init has shape {given.shape}, expected centres (M, {d}) or labels ({N},), or 'auto'")
        m_init = max(1, min(self.m_init, N // (2 * (d + 1))))
        n_init = 5 if self.n_init is None else self.n_init
        if self.init == "phase" and phase is None:
            raise ValueError("init='phase' needs phase: pass fit(X, phase=...) or use init='k-means++'")
        if phase is not None and self.init != "k-means++":
            slices = dict.fromkeys(max(1, round(m_init / SLICE_RATIO**r)) for r in range(n_init))
            partitions = [phase_slices(phase, m) for m in slices]
        else:
            partitions = [nearest_centre(Z, seed_centres(Z, m_init, random_state)) for _ in range(n_init)]
        return [components_of_partition(Z, labels, prior) for labels in partitions]

    @property
    def _published(self) -> bool:
        """Whether the published algorithm runs instead of the competition of posteriors."""
        return self.distance != "fmle" or self.bias == "literal"

    def _schedule(self, *, with_phase: bool) -> Schedule:
        """Returns the strength of the competition."""
        eta0 = self.eta0 if self.eta0 is not None else (5.0 if with_phase or self._published else 1.0)
        if self.schedule == "exp":
            return exponential_schedule(eta0, self.tau, begin=FUZZY_ITERATIONS if self._published else 0)
        return ramp_schedule(eta0, self.tau, self.rise, self.decay)

    def _run_start(
        self, Z: Array, components: GaussianComponents, prior: CovariancePrior, *, with_phase: bool
    ) -> _Start:
        """Runs the competition and the mergers from the given initial components."""
        schedule = self._schedule(with_phase=with_phase)
        merging = self.merge == "bic"
        if not self._published:
            default_cardinality = max(5.0, prior.parameters / 2)
            components, history, converged = compete(
                Z,
                components,
                prior,
                schedule,
                min_cardinality=default_cardinality if self.min_cardinality is None else self.min_cardinality,
                max_iter=self.max_iter,
                tol=self.tol * float(np.sqrt(prior.variance)),
                min_eta=NEGLIGIBLE_ETA if merging else 0.0,
            )
        else:
            competition = compete_for_prototypes(
                Z,
                components,
                prior,
                schedule,
                distance=self.distance,
                # The ramp is the schedule of the authors' program, so its death rule goes with it.
                death_rule="cardinality" if self.schedule == "exp" else "nearest",
                min_count=5.0 if self.min_cardinality is None else self.min_cardinality,
                max_iter=self.max_iter,
                tol=self.tol,
            )
            components, history, converged = competition.components, competition.history, competition.converged
            if merging:
                components = components_of_partition(Z, competition.labels, prior)
        return _Start(components, history, converged, merge_path(Z, components, prior) if merging else [])
