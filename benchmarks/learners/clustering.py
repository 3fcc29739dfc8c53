"""Competitive Agglomeration against other clusterings that choose the number of clusters, on labelled data sets.

    python -m benchmarks.learners.clustering [--seeds 5] [--json FILE]

Columns of the table, one row per learner and data set:

- right: in how many of the seeds the number of clusters is the number of labels;
- ARI mean, ARI min: adjusted Rand index between clusters and labels, mean and minimum over the seeds;
- time ratio: time of a fit over that of the default learner ("competition") in the same run;
- numbers: number of clusters for each seed.

"oracle" classifies with Gaussians fitted to the true labels, and is an upper bound for learners of Gaussians.
Learners that are slow on large sets are left out there.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

import numpy as np
import typer
from sklearn.cluster import HDBSCAN
from sklearn.metrics import adjusted_rand_score
from sklearn.mixture import BayesianGaussianMixture
from threadpoolctl import threadpool_limits

from benchmarks.command_line import JsonFile, finish, run
from benchmarks.learners import cluster_sets as sets
from benchmarks.learners.cluster_sets import Labels
from benchmarks.learners.gaussian_mixture_regression import best_mixture
from benchmarks.learners.published_competition import PublishedCompetition
from interfaces.terminal import progress
from skill.arrays import Array
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.clustering.expectation_maximization import CovariancePrior, components_of_partition
from skill.clustering.gaussian_components import log_normalizers, precision_factors, squared_mahalanobis

DEFAULT = "competition"
FIRST_SEED = 100  # those below are for development


@dataclass(frozen=True)
class LabelledSet:
    """A labelled data set.

    Attributes:
        X: (N, d), standardised samples.
        y: (N,), true labels; -1 for outliers.
        demonstrations: ``groups`` (N,) and ``phase`` (N,) of the samples, as far as they are known to the learner.
    """

    X: Array
    y: Labels
    demonstrations: dict[str, np.ndarray]


def plain(generate: Callable[[int], tuple[Array, Labels]], seed: int) -> LabelledSet:
    """A set of independent samples, standardised."""
    X, y = generate(seed)
    return LabelledSet((X - X.mean(0)) / X.std(0), y, {})


def demonstrated(seed: int, N: int, T: int = 30, *, phase: bool = True) -> LabelledSet:
    """Standardised samples of T demonstrations of `sets.insertion`; without ``phase`` the learner gets groups alone."""
    X, y = sets.insertion(seed, N, T)
    groups, time_in_demonstration = sets.demonstrations_and_phase(y)
    known = {"groups": groups, **({"phase": time_in_demonstration} if phase else {})}
    return LabelledSet((X - X.mean(0)) / X.std(0), y, known)


def with_outliers(seed: int) -> tuple[Array, Labels]:
    """The ellipses with 5 % of uniform outliers, which belong to no cluster (label -1)."""
    X, y = sets.ellipses(seed)
    rng = np.random.default_rng(seed + 1)
    n = len(X) // 20
    return np.vstack([X, rng.uniform(-20, 120, (n, 2))]), np.r_[y, np.full(n, -1)]


SETS: dict[str, Callable[[int], LabelledSet]] = {
    "spheres, 2-D": partial(plain, sets.spheres),
    "ellipses, 2-D": partial(plain, sets.ellipses),
    "overlapping, 2-D": partial(plain, sets.overlapping),
    "c=2, 14-D": partial(plain, partial(sets.separated, c=2.0)),
    "c=1, 14-D": partial(plain, partial(sets.separated, c=1.0)),
    "c=1, 14-D, N=1000": partial(plain, partial(sets.separated, c=1.0, N=1000)),
    "ellipses, 5 % outliers": partial(plain, with_outliers),
    "wine": partial(plain, sets.wine),
    "insertion, N=3000": partial(demonstrated, N=3_000),
    "insertion, N=10000": partial(demonstrated, N=10_000),
    "insertion, N=30000": partial(demonstrated, N=30_000),
    "insertion, no phase": partial(demonstrated, N=3_000, phase=False),
    "insertion, 10 demos": partial(demonstrated, N=3_000, T=10),
}


def agglomerate(data: LabelledSet, seed: int, *, ignore: tuple[str, ...] = (), **parameters: Any) -> Labels:
    """Competitive Agglomeration, without the arguments of ``fit`` that are named in ``ignore``."""
    known = {name: value for name, value in data.demonstrations.items() if name not in ignore}
    return np.asarray(CompetitiveAgglomeration(random_state=seed, **parameters).fit(data.X, **known).labels_)


def published(data: LabelledSet, seed: int, *, distance: str, ignore: tuple[str, ...] = ()) -> Labels:
    """Competitive Agglomeration as published."""
    known = {name: value for name, value in data.demonstrations.items() if name not in ignore}
    return np.asarray(PublishedCompetition(distance, random_state=seed).fit(data.X, **known).labels_)


def mixture_by_bic(data: LabelledSet, seed: int, *, starts: int) -> Labels:
    """The Gaussian mixture of smallest BIC among 1 to 15 components."""
    best = best_mixture(data.X, 15, n_init=starts, random_state=seed, reg_covar=1e-6)
    return np.asarray(best.predict(data.X))


def bayesian_mixture(data: LabelledSet, seed: int) -> Labels:
    """A variational mixture of at most 30 components."""
    mixture = BayesianGaussianMixture(n_components=30, max_iter=300, random_state=seed).fit(data.X)
    return np.asarray(mixture.predict(data.X))


def density_tree(data: LabelledSet, seed: int) -> Labels:
    """HDBSCAN with clusters of at least 1 % of the samples."""
    return np.asarray(HDBSCAN(min_cluster_size=max(5, len(data.X) // 100), copy=True).fit_predict(data.X))


def oracle(data: LabelledSet, seed: int) -> Labels:
    """The maximum-likelihood class of each sample under Gaussians fitted to the true labels."""
    known = data.y >= 0
    d = data.X.shape[1]
    floor = CovariancePrior(count=0.0, variance=1.0, floor=np.full(d, 1e-6))
    true = components_of_partition(data.X[known], data.y[known], floor)
    factors = precision_factors(true.covariances)
    squared = squared_mahalanobis(data.X, true.means, factors)
    return np.asarray(np.argmax(log_normalizers(true.weights, factors) - 0.5 * squared, axis=1))


LEARNERS: dict[str, Callable[[LabelledSet, int], Labels]] = {
    DEFAULT: agglomerate,
    "eta0 = 0": partial(agglomerate, eta0=0.0),
    "heavy tails": partial(agglomerate, tails="heavy"),
    "samples independent": partial(agglomerate, ignore=("groups",)),
    "printed equations": partial(published, distance="fmle"),
    "Gustafson-Kessel": partial(published, distance="gk", ignore=("phase",)),
    "GMM-BIC, 1 start": partial(mixture_by_bic, starts=1),
    "GMM-BIC, 5 starts": partial(mixture_by_bic, starts=5),
    "BayesianGaussianMixture": bayesian_mixture,
    "HDBSCAN": density_tree,
    "oracle": oracle,
}
SLOW_ABOVE_5000 = ("GMM-BIC, 5 starts", "BayesianGaussianMixture", "HDBSCAN", "Gustafson-Kessel")


def evaluate(name: str, generate: Callable[[int], LabelledSet], seeds: range) -> Iterator[dict[str, Any]]:
    """Yields one row of the table for each learner on one set."""
    data = {seed: generate(seed) for seed in seeds}
    first = data[seeds[0]]
    truth = len(np.unique(first.y[first.y >= 0]))
    reference = None
    for learner, find in LEARNERS.items():
        if len(first.X) > 5_000 and learner in SLOW_ABOVE_5000:
            continue
        if learner == "samples independent" and not first.demonstrations:
            continue
        numbers, indices, seconds = [], [], 0.0
        for seed, case in data.items():
            start = time.perf_counter()
            labels = find(case, seed)
            seconds += time.perf_counter() - start
            member = case.y >= 0
            numbers.append(len(np.unique(labels[labels >= 0])))
            indices.append(adjusted_rand_score(case.y[member], labels[member]))
        mean_seconds = seconds / len(numbers)
        reference = reference or mean_seconds
        yield {
            "set": name,
            "learner": learner,
            "right": int(np.sum(np.array(numbers) == truth)),
            "of": len(numbers),
            "numbers": numbers,
            "ari_mean": float(np.mean(indices)),
            "ari_min": float(np.min(indices)),
            "seconds": mean_seconds,
            "time_ratio": mean_seconds / reference,
        }


def main(
    seeds: Annotated[int, typer.Option(min=1, help="Number of seeds.")] = 5,
    json: JsonFile = None,
) -> None:
    warnings.simplefilter("ignore")
    rows: list[dict[str, Any]] = []
    with threadpool_limits(1), progress("clustering", len(SETS)) as advance:
        for name, generate in SETS.items():
            print(f"\n{name}\n{'':26}right   ARI mean   min   time ratio   numbers")
            for row in evaluate(name, generate, range(FIRST_SEED, FIRST_SEED + seeds)):
                rows.append(row)
                print(
                    f"  {row['learner']:24}{row['right']}/{row['of']}    {row['ari_mean']:8.3f}"
                    f" {row['ari_min']:7.3f}{row['time_ratio']:9.2f}     {row['numbers']}",
                    flush=True,
                )
            advance(name)
    finish({"rows": rows}, json)


if __name__ == "__main__":
    run(main)
