"""Discovery of contact states: Competitive Agglomeration with the fuzzy-maximum-likelihood distance.

Large clusters take samples from small ones until the small ones vanish (Frigui and Krishnapuram, Pattern Recognition
30(7), 1997). The distance is that of fuzzy maximum likelihood (Gath and Geva, IEEE PAMI 11(7), 1989), *normalised for
each sample*: d^2_ij = 1 / h_ij, where h_ij is the posterior of cluster i
(`skill.clustering.expectation_maximization.posterior_blocks`). Without competition, the memberships are the
same as for the printed distance. With competition, its strength no longer depends on the few samples of lowest density,
which make the printed equations collapse to a single cluster.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field, replace
from numbers import Integral, Real
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.cluster import kmeans_plusplus
from sklearn.exceptions import ConvergenceWarning
from sklearn.utils import check_random_state
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.validation import validate_data
from threadpoolctl import threadpool_limits

from skill.arrays import Array, outlier_limits, resolution, standard_scale
from skill.clustering.component_merging import Mixture, best_of_each_number, merge_path, polished
from skill.clustering.expectation_maximization import (
    CovariancePrior,
    components_of_partition,
    e_step,
    expectation_maximization,
    m_step,
)
from skill.clustering.gaussian_components import STUDENT_DEGREES, GaussianComponents
from skill.clustering.gaussian_states import GaussianStates
from skill.clustering.number_of_states import (
    bayesian_information_criterion,
    number_for_density,
    number_of_demonstrated,
    number_of_independent,
)

DECAY = 10.0
"""Number of iterations in which the strength of the competition falls by a factor e."""

NEGLIGIBLE_ETA = 0.05
"""Strength of the competition below which it hardly changes memberships; merging then continues faster."""

MIN_STILL_ITERATIONS = 3
"""The competition has converged after this many consecutive iterations in which no centre moved and no cluster died."""

SLICE_RATIO = 1.4
"""Ratio between the numbers of time slices of consecutive starts by phase: 30, 21, 15, 11, 8."""

MAX_SEARCHED = 20_000
"""Maximum number of independent samples in the search for mixtures. All samples then polish the mixtures and choose
their number. A state with fewer than half as many of these samples as it has parameters is not found."""


BLOCK = 8192
"""Number of samples whose distances to all centres are computed together."""


@dataclass
class History:
    """Course of the competition, one entry for each iteration.

    Attributes:
        n_clusters: number of clusters before the update.
        eta: strength of the competition.
        log_likelihood: log-likelihood of all samples before the update, in nats.
    """

    n_clusters: list[int] = field(default_factory=list)
    eta: list[float] = field(default_factory=list)
    log_likelihood: list[float] = field(default_factory=list)


@dataclass(frozen=True)
class Start:
    """Result of one start.

    Attributes:
        components: the clusters that survive the competition.
        history: course of the competition.
        converged: whether the competition converged.
        path: the mixtures of its mergers, largest number of components first.
    """

    components: GaussianComponents
    history: History
    converged: bool
    path: list[Mixture]


class CompetitiveAgglomeration(GaussianStates):
    """Clusters samples into an unknown number of Gaussian states.

    The initial partition has more clusters than there are states. It consists of slices of normalised time if
    ``phase`` is given to `fit`, and otherwise of the samples nearest to k-means++ seeds. The clusters compete. With
    the posterior h_ij of cluster i for sample j and the cardinality N_i = sum_j u_ij, the memberships are

        u_ij = h_ij [1 + eta N / sum_k N_k^2 (N_i - sum_k h_kj N_k)],

    clipped to [0, 1] and normalised; eta decays exponentially. Means and covariances are weighted by u^2 / sum u^2.
    Clusters with N_i below max(5, T/2) die, with T the number of parameters of one component. The surviving clusters
    are merged pair by pair. The number of states is the one that the evidence supports: it minimises the Bayesian
    information criterion, or follows from a comparison at the effective sample size
    (`skill.clustering.number_of_states`) if ``groups`` are given to `fit`. An outlier (`skill.arrays.outlier_limits`)
    counts as a sample at its limit.

    Args:
        m_init: initial number of clusters, at most N / (2 (d + 1)).
        eta0: initial strength of the competition. None means 1, or 5 with a phase.
        tails: "normal" for Gaussians, or "heavy" for Student distributions with 4 degrees of freedom, which impacts
            and other rare samples hardly change.
        reg_covar: variance added to each channel, as a fraction of the mean variance of the channels; at least that of
            rounding to the smallest step between values of the channel.
        number: with ``groups``, "states" for components each of which is a state, or "density" for as many components
            as describe the density.
        n_init: number of starts; the mixture of maximum likelihood is kept for each number of states.
        max_iter: maximum number of iterations of the competition, and of the final expectation-maximisation.
        tol: a centre is still if it moves by less than this fraction of the channels' standard deviation.
        random_state: seed of the starts.

    Attributes:
        labels_: shape (N,), state of each sample.
        history_: course of the competition of the selected start, `History`.
        n_iter_: number of iterations of this competition.
        converged_: whether this competition and the final expectation-maximisation converged.
        merge_path_: shape (., 3), number of components, log-likelihood and criterion of each candidate.
        n_effective_: effective number of independent samples, N / ``design_effect_``.

    It also has the attributes of `GaussianStates`. Results are in the units of X.
    """

    _parameter_constraints: dict[str, list[Any]] = {
        "m_init": [Interval(Integral, 1, None, closed="left")],
        "eta0": [Interval(Real, 0, None, closed="left"), None],
        "tails": [StrOptions({"normal", "heavy"})],
        "reg_covar": [Interval(Real, 0, None, closed="left")],
        "number": [StrOptions({"states", "density"})],
        "n_init": [Interval(Integral, 1, None, closed="left")],
        "max_iter": [Interval(Integral, 1, None, closed="left")],
        "tol": [Interval(Real, 0, None, closed="left")],
        "random_state": ["random_state"],
    }

    def __init__(
        self,
        *,
        m_init: int = 30,
        eta0: float | None = None,
        tails: str = "normal",
        reg_covar: float = 1e-6,
        number: str = "states",
        n_init: int = 5,
        max_iter: int = 100,
        tol: float = 1e-3,
        random_state: Any = None,
    ) -> None:
        self.m_init = m_init
        self.eta0 = eta0
        self.tails = tails
        self.reg_covar = reg_covar
        self.number = number
        self.n_init = n_init
        self.max_iter = max_iter
        self.tol = tol
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
        # The matrix products are small: a second thread costs time and would change the last bits.
        with threadpool_limits(1):
            self._fit(samples, group_index, normalised_time)
        return self

    def _fit(self, X: Array, groups: NDArray[np.intp] | None, phase: Array | None) -> None:
        """Finds the states of checked samples and sets the fitted attributes."""
        limited = np.clip(X, *outlier_limits(X))
        shift, scale = limited.mean(axis=0), standard_scale(X)
        Z = (limited - shift) / scale
        N = len(Z)
        prior = self._prior(Z, resolution(X) / scale)
        random_state = check_random_state(self.random_state)
        initial = self._initialize(Z, prior, phase, random_state)
        searched = Z
        # Demonstrations are searched with all samples: thinned, they gave the best mixture less often.
        if groups is None and N > MAX_SEARCHED:
            searched = Z[np.sort(random_state.choice(N, MAX_SEARCHED, replace=False))]
        eta0 = self.eta0 if self.eta0 is not None else (1.0 if phase is None else 5.0)
        starts = [self._run_start(searched, components, prior, eta0) for components in initial]
        found = best_of_each_number([start.path for start in starts])
        candidates = found if searched is Z else polished(Z, found, prior)
        M, tau = self._choose_number(candidates, Z, prior, groups)
        components, _, converged = expectation_maximization(
            Z, candidates[M].components, prior, max_iter=self.max_iter, tol=1e-5 * N
        )
        start = next(start for start in starts if any(mixture is found[M] for mixture in start.path))
        self.converged_ = converged and start.converged
        if not self.converged_:
            warnings.warn(
                f"not converged after max_iter={self.max_iter} iterations: raise max_iter or tol",
                ConvergenceWarning,
                stacklevel=3,
            )
        if M == self.m_init > 1:
            warnings.warn(
                f"found as many states as the competition began with, m_init={self.m_init}: raise m_init",
                UserWarning,
                stacklevel=3,
            )
        self.history_ = start.history
        self.n_iter_ = len(start.history.eta)
        self.merge_path_ = np.array(
            [
                (m, value, bayesian_information_criterion(value, m, prior.parameters, N, tau))
                for m, value in ((m, mixture.log_likelihood) for m, mixture in candidates.items())
            ]
        )
        self._set_states(components.rescaled(shift, scale), design_effect=tau)
        self.n_effective_ = N / tau
        self.labels_ = self._log_densities(X, *self.marginal())[0].argmax(axis=1)

    def _prior(self, Z: Array, step: Array) -> CovariancePrior:
        """Returns the regularisation of the covariances: that of d + 1 samples, and the floor.

        The floor is at least the variance of what a ``step`` (d,) between values leaves unknown, step^2 / 12.
        """
        d = Z.shape[1]
        g = float(Z.var(axis=0).mean()) or 1.0
        floor = np.maximum(self.reg_covar * g, step**2 / 12.0)
        return CovariancePrior(float(d + 1), variance=g, floor=floor)

    def _initialize(
        self, Z: Array, prior: CovariancePrior, phase: Array | None, random_state: np.random.RandomState
    ) -> list[GaussianComponents]:
        """Returns the initial components of each start, of slices of time or of k-means++ seeds."""
        N, d = Z.shape
        m_init = max(1, min(self.m_init, N // (2 * (d + 1))))
        if phase is not None:
            numbers = dict.fromkeys(max(1, round(m_init / SLICE_RATIO**r)) for r in range(self.n_init))
            partitions = [phase_slices(phase, number) for number in numbers]
        else:
            # k-means itself would split elongated clusters.
            partitions = [
                nearest_centre(Z, kmeans_plusplus(Z, m_init, random_state=random_state)[0]) for _ in range(self.n_init)
            ]
        degrees = STUDENT_DEGREES if self.tails == "heavy" else np.inf
        return [replace(components_of_partition(Z, labels, prior), degrees=degrees) for labels in partitions]

    def _run_start(self, Z: Array, components: GaussianComponents, prior: CovariancePrior, eta0: float) -> Start:
        """Runs the competition from the given initial components, and merges what survives."""
        components, history, converged = self._compete(Z, components, prior, eta0)
        return Start(components, history, converged, merge_path(Z, components, prior))

    def _compete(
        self, Z: Array, components: GaussianComponents, prior: CovariancePrior, eta0: float
    ) -> tuple[GaussianComponents, History, bool]:
        """Runs the competition until no cluster dies and no centre moves, or until it becomes negligible.

        Returns:
            The surviving components, the history, and whether the competition converged.
        """
        tol = self.tol * float(np.sqrt(prior.variance))
        min_cardinality = max(5.0, prior.parameters / 2)
        history = History()
        cardinalities = components.weights * len(Z)
        still_iterations = 0
        for k in range(self.max_iter):
            eta, next_eta = (eta0 * float(np.exp(-n / DECAY)) for n in (k, k + 1))
            moments = e_step(Z, components, eta=eta, cardinalities=cardinalities, fuzzy=True)
            history.n_clusters.append(len(components))
            history.eta.append(eta)
            history.log_likelihood.append(moments.log_likelihood)
            movement = float(np.abs(moments.means - components.means).max())
            components = m_step(moments, prior, components.degrees)
            keep = survivors(moments.cardinalities, min_cardinality)
            cardinalities = moments.cardinalities[keep]
            if keep.all():
                still_iterations = still_iterations + 1 if movement < tol else 0
            else:
                still_iterations = 0
                components = components.retained(keep)
            if still_iterations >= MIN_STILL_ITERATIONS or next_eta < NEGLIGIBLE_ETA <= eta:
                return components, history, True
        return components, history, False

    def _choose_number(
        self, candidates: dict[int, Mixture], Z: Array, prior: CovariancePrior, groups: NDArray[np.intp] | None
    ) -> tuple[int, float]:
        """Returns the number of components that the evidence supports, and the design effect under their mixture."""
        if groups is None:
            return number_of_independent(candidates, prior.parameters, len(Z)), 1.0
        choose = number_for_density if self.number == "density" else number_of_demonstrated
        return choose(candidates, prior.parameters, Z, groups)


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


def nearest_centre(Z: Array, centres: Array) -> NDArray[np.intp]:
    """Returns the index of the Euclidean-nearest centre of each sample, shape (N,)."""
    half_norms = 0.5 * np.einsum("md,md->m", centres, centres)
    blocks = [Z[start : start + BLOCK] for start in range(0, len(Z), BLOCK)]
    return np.concatenate([np.argmin(half_norms - block @ centres.T, axis=1) for block in blocks])


def phase_slices(phase: Array, slices: int) -> NDArray[np.intp]:
    """Returns the time slice of each sample, floor(slices phase), shape (N,); a phase of 1 is in the last slice."""
    return np.minimum((slices * phase).astype(np.intp), slices - 1)


def checked_groups(groups: ArrayLike | None, N: int) -> NDArray[np.intp] | None:
    """Returns the index of the demonstration of each sample, shape (N,).

    Warns if there is a single demonstration.

    Args:
        groups: shape (N,), any labels of the demonstrations, or None.
        N: number of samples.

    Returns:
        None if there are fewer than two demonstrations: the dependence of the samples cannot be measured.

    Raises:
        ValueError: if the shape is wrong.
    """
    if groups is None:
        return None
    given = np.asarray(groups)
    if given.shape != (N,):
        raise ValueError(f"groups has shape {given.shape}, expected ({N},): the recording of each sample")
    names, index = np.unique(given, return_inverse=True)
    if len(names) < 2:
        warnings.warn(
            "groups contains a single demonstration, so all samples count as independent and the number of"
            " states grows with the sampling rate: use two or more demonstrations",
            UserWarning,
            stacklevel=3,
        )
        return None
    return np.asarray(index, dtype=np.intp)


def checked_phase(phase: ArrayLike | None, N: int) -> Array | None:
    """Returns the normalised time of each sample, shape (N,), or None if it is not given.

    Raises:
        ValueError: if the shape is wrong or a value lies outside [0, 1].
    """
    if phase is None:
        return None
    given = np.asarray(phase, dtype=float)
    if given.shape != (N,):
        raise ValueError(f"phase has shape {given.shape}, expected ({N},): the time of each sample")
    if not np.isfinite(given).all() or given.min() < 0.0 or given.max() > 1.0:
        raise ValueError(
            f"phase lies between {given.min():.3g} and {given.max():.3g}, expected [0, 1]: divide the time"
            " since the start of each demonstration by its duration"
        )
    return given
