"""Speed and memory of Competitive Agglomeration, as ratios to references measured in the same run.

    python -m benchmarks.learners.clustering_speed [--million] [--json FILE]

- one E and M step at N = 1e5, M = 30, d = 14 against the bound of two products of N M d^2 at the measured dgemm rate;
- a whole fit at N = 1e4 and 1e5 against one sweep of Gaussian mixtures (1..15 components, one start, BIC);
- one on-line estimate of the contact state against one matrix-vector product of the same size;
- with --million: time and peak memory of a fit at N = 1e6.
"""

from __future__ import annotations

import argparse
import json
import resource
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.mixture import GaussianMixture
from threadpoolctl import threadpool_limits

from benchmarks.learners import cluster_sets as sets
from skill.clustering.cluster_initialization import components_of_partition
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.clustering.expectation_maximization import CovariancePrior, em_step
from skill.states.contact_state_filter import ContactStateFilter


def fastest(action: Callable[[], Any], repeats: int = 5, number: int = 1) -> float:
    """Least seconds of one call."""
    least = np.inf
    for _ in range(repeats):
        start = time.perf_counter()
        for _ in range(number):
            action()
        least = min(least, (time.perf_counter() - start) / number)
    return float(least)


def step_against_products(N: int = 100_000, M: int = 30, d: int = 14) -> dict[str, float]:
    rng = np.random.default_rng(0)
    A = rng.normal(size=(1500, 1500))
    rate = 2 * 1500**3 / fastest(lambda: A @ A)
    bound = 2 * (2 * N * M * d**2) / rate
    Z = rng.normal(size=(N, d))
    prior = CovariancePrior(count=d + 1.0, variance=1.0, floor=np.full(d, 1e-6), diagonal=False)
    components = components_of_partition(Z, rng.integers(0, M, N), prior)
    cardinalities = em_step(Z, components).cardinalities
    plain = fastest(lambda: em_step(Z, components))
    competing = fastest(lambda: em_step(Z, components, eta=1.0, cardinalities=cardinalities, fuzzy=True))
    return {
        "dgemm_gflops": rate / 1e9,
        "bound_s": bound,
        "em_step_s": plain,
        "em_step_ratio": plain / bound,
        "competition_step_s": competing,
        "competition_step_ratio": competing / bound,
    }


def fit_against_mixtures(N: int, *, demonstrated: bool, seed: int = 100) -> dict[str, float]:
    X, y = sets.insertion(seed, N) if demonstrated else sets.separated(seed, c=2.0, N=N)
    known: dict[str, Any] = {}
    if demonstrated:
        groups, phase = sets.demonstrations_and_phase(y)
        known = {"groups": groups, "phase": phase}
    Z = (X - X.mean(0)) / X.std(0)
    ours = fastest(lambda: CompetitiveAgglomeration(random_state=0).fit(X, **known), repeats=1)
    theirs = fastest(lambda: [GaussianMixture(k, random_state=0).fit(Z).bic(Z) for k in range(1, 16)], repeats=1)
    return {"fit_s": ours, "mixtures_s": theirs, "ratio": ours / theirs}


def estimate_against_product() -> dict[str, float]:
    X, y = sets.insertion(100)
    groups, phase = sets.demonstrations_and_phase(y)
    model = CompetitiveAgglomeration(random_state=0).fit(X, groups=groups, phase=phase)
    M = model.n_clusters_
    rng = np.random.default_rng(0)
    W = rng.normal(size=(M * 14, 14))
    product = fastest(lambda: W @ X[0], number=5000)
    result = {"product_us": product * 1e6}
    for name, transitions in (("posterior", None), ("filter", np.full((M, M), 1.0 / M))):
        estimator = ContactStateFilter(model, transitions=transitions)
        belief = estimator.initial_log_belief()

        def estimate(estimator: ContactStateFilter = estimator, belief: np.ndarray = belief) -> Any:
            return estimator.step(belief, X[0])

        seconds = fastest(estimate, number=5000)
        result |= {f"{name}_us": seconds * 1e6, f"{name}_ratio": seconds / product}
    return result


def million() -> dict[str, float]:
    X, y = sets.insertion(100, 1_000_000)
    groups, phase = sets.demonstrations_and_phase(y)
    start = time.perf_counter()
    model = CompetitiveAgglomeration(random_state=0).fit(X, groups=groups, phase=phase)
    return {
        "fit_s": time.perf_counter() - start,
        "n_clusters": model.n_clusters_,
        "n_effective": model.n_effective_,
        "peak_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--million", action="store_true", help="fit a million samples (minutes)")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    measurements: dict[str, Callable[[], dict[str, float]]] = {
        "E and M step": step_against_products,
        "online estimate": estimate_against_product,
        "fit, Gaussians, N=1e4": lambda: fit_against_mixtures(10_000, demonstrated=False),
        "fit, insertion, N=1e4": lambda: fit_against_mixtures(10_000, demonstrated=True),
        "fit, Gaussians, N=1e5": lambda: fit_against_mixtures(100_000, demonstrated=False),
        "fit, insertion, N=1e5": lambda: fit_against_mixtures(100_000, demonstrated=True),
    }
    if arguments.million:
        measurements = {"fit, N=1e6": million}
    figures: dict[str, dict[str, float]] = {}
    with threadpool_limits(1):
        for name, measure in measurements.items():
            figures[name] = measure()
            print(f"{name:24}" + "  ".join(f"{k} {v:.4g}" for k, v in figures[name].items()), flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
