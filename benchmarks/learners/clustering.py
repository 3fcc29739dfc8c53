"""Does the competition earn its place? Learners of the number of clusters side by side, in one run.

    python -m benchmarks.learners.clustering [--seeds 5] [--first-seed 100] [--only NAME ...] [--json FILE]

For each set: how often the number is right, mean and least adjusted Rand index, and the time as a ratio to the
default learner's in the same run. "oracle" classifies with Gaussians fitted to the true labels: no learner of
Gaussians can be expected to do better. Sets on which the default learner loses are part of the table.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.cluster import HDBSCAN
from sklearn.metrics import adjusted_rand_score
from sklearn.mixture import BayesianGaussianMixture, GaussianMixture
from threadpoolctl import threadpool_limits

from benchmarks.learners import cluster_sets as sets
from skill.clustering.cluster_initialization import components_of_partition
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.clustering.expectation_maximization import CovariancePrior
from skill.clustering.gaussian_components import log_densities, precision_factors

DEFAULT = "competition"


@dataclass(frozen=True)
class LabelledSet:
    """Samples, true labels, and what is known of the demonstrations."""

    X: np.ndarray
    y: np.ndarray
    demonstrations: dict[str, np.ndarray]


def plain(generate: Callable[[int], tuple[np.ndarray, np.ndarray]], seed: int) -> LabelledSet:
    X, y = generate(seed)
    return LabelledSet((X - X.mean(0)) / X.std(0), y, {})


def demonstrated(seed: int, N: int, T: int = 30, *, phase: bool = True) -> LabelledSet:
    X, y = sets.insertion(seed, N, T)
    groups, time_in_demonstration = sets.demonstrations_and_phase(y)
    known = {"groups": groups, **({"phase": time_in_demonstration} if phase else {})}
    return LabelledSet((X - X.mean(0)) / X.std(0), y, known)


def with_outliers(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """The ellipses and 5 % of uniform outliers, which belong to no cluster (label -1)."""
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


def agglomerate(data: LabelledSet, seed: int, *, ignore: tuple[str, ...] = (), **parameters: Any) -> np.ndarray:
    known = {name: value for name, value in data.demonstrations.items() if name not in ignore}
    return CompetitiveAgglomeration(random_state=seed, **parameters).fit(data.X, **known).labels_


def mixture_by_bic(data: LabelledSet, seed: int, *, starts: int) -> np.ndarray:
    mixtures = [GaussianMixture(k, n_init=starts, random_state=seed, reg_covar=1e-6).fit(data.X) for k in range(1, 16)]
    best = min(mixtures, key=lambda mixture: mixture.bic(data.X))
    return np.asarray(best.predict(data.X))


def bayesian_mixture(data: LabelledSet, seed: int) -> np.ndarray:
    mixture = BayesianGaussianMixture(n_components=30, max_iter=300, random_state=seed).fit(data.X)
    return np.asarray(mixture.predict(data.X))


def density_tree(data: LabelledSet, seed: int) -> np.ndarray:
    return np.asarray(HDBSCAN(min_cluster_size=max(5, len(data.X) // 100), copy=True).fit_predict(data.X))


def oracle(data: LabelledSet, seed: int) -> np.ndarray:
    known = data.y >= 0
    d = data.X.shape[1]
    floor = CovariancePrior(count=0.0, variance=1.0, floor=np.full(d, 1e-6), diagonal=False)
    true = components_of_partition(data.X[known], data.y[known], floor)
    factors = precision_factors(true.covariances)
    return np.argmax(log_densities(data.X, true.weights, true.means, factors), axis=1)


LEARNERS: dict[str, Callable[[LabelledSet, int], np.ndarray]] = {
    DEFAULT: agglomerate,
    "eta0 = 0": partial(agglomerate, eta0=0.0),
    "samples independent": partial(agglomerate, ignore=("groups",)),
    "printed equations": partial(agglomerate, bias="literal", merge=None, n_init=1),
    "Gustafson-Kessel": partial(agglomerate, distance="gk", merge=None, n_init=1, ignore=("phase",)),
    "GMM-BIC, 1 start": partial(mixture_by_bic, starts=1),
    "GMM-BIC, 5 starts": partial(mixture_by_bic, starts=5),
    "BayesianGaussianMixture": bayesian_mixture,
    "HDBSCAN": density_tree,
    "oracle": oracle,
}
SLOW_ABOVE_5000 = ("GMM-BIC, 5 starts", "BayesianGaussianMixture", "HDBSCAN", "Gustafson-Kessel")


def judge(name: str, generate: Callable[[int], LabelledSet], seeds: range) -> list[dict[str, Any]]:
    """One row for each learner on one set."""
    rows: list[dict[str, Any]] = []
    data = {seed: generate(seed) for seed in seeds}
    for learner, find in LEARNERS.items():
        if len(data[seeds[0]].X) > 5_000 and learner in SLOW_ABOVE_5000:
            continue
        if learner == "samples independent" and not data[seeds[0]].demonstrations:
            continue
        numbers, indices, seconds = [], [], 0.0
        for seed, case in data.items():
            start = time.perf_counter()
            labels = find(case, seed)
            seconds += time.perf_counter() - start
            member = case.y >= 0
            numbers.append(len(np.unique(labels[labels >= 0])))
            indices.append(adjusted_rand_score(case.y[member], labels[member]))
        truth = len(np.unique(data[seeds[0]].y[data[seeds[0]].y >= 0]))
        rows.append(
            {
                "set": name,
                "learner": learner,
                "right": int(np.sum(np.array(numbers) == truth)),
                "of": len(numbers),
                "numbers": numbers,
                "ari_mean": float(np.mean(indices)),
                "ari_min": float(np.min(indices)),
                "seconds": seconds / len(numbers),
                "time_ratio": seconds / len(numbers) / (rows[0]["seconds"] if rows else seconds / len(numbers)),
            }
        )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5, help="how many seeds")
    parser.add_argument("--first-seed", type=int, default=100)
    parser.add_argument("--only", nargs="*", help="sets whose name contains one of these")
    parser.add_argument("--json", type=Path, help="write all rows to this file")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
    rows: list[dict[str, Any]] = []
    with threadpool_limits(1):
        for name, generate in SETS.items():
            if arguments.only and not any(part in name for part in arguments.only):
                continue
            print(f"\n{name}\n{'':26}right   ARI mean   min   time ratio   numbers")
            for row in judge(name, generate, seeds):
                rows.append(row)
                print(
                    f"  {row['learner']:24}{row['right']}/{row['of']}    {row['ari_mean']:8.3f}"
                    f" {row['ari_min']:7.3f}{row['time_ratio']:9.2f}     {row['numbers']}",
                    flush=True,
                )
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
