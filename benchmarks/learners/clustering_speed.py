"""Speed and memory of Competitive Agglomeration, as ratios to references that are measured in the same run.

    python -m benchmarks.learners.clustering_speed [--million] [--json FILE]

Each row is one measurement; its ratios are own time over reference time:

- E and M step: one step at N = 1e5, M = 30, d = 14, against the time bound of two products of N M d^2 multiplications
  and additions at the measured dgemm rate;
- fit: a whole fit at N = 1e4 and 1e5, against the choice among Gaussian mixtures of 1 to 15 components by BIC, one
  start each;
- online estimate: one estimate of the contact state, against one matrix-vector product of the same size;
- with --million: time and peak memory of one fit at N = 1e6, instead of the others.
"""

from __future__ import annotations

import resource
import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.command_line import argument_parser, run
from benchmarks.learners import cluster_sets as sets
from benchmarks.learners.gaussian_mixture_regression import best_mixture
from interfaces.terminal import progress, write_json
from skill.clustering.cluster_initialization import components_of_partition
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.clustering.expectation_maximization import CovariancePrior, em_step
from skill.states.contact_state_filter import ContactStateFilter


def fastest(action: Callable[[], Any], repeats: int = 5, number: int = 1) -> float:
    """Minimum time of one call over the repeats, s; each repeat averages ``number`` calls."""
    minimum = np.inf
    for _ in range(repeats):
        start = time.perf_counter()
        for _ in range(number):
            action()
        minimum = min(minimum, (time.perf_counter() - start) / number)
    return float(minimum)


def step_against_products(N: int = 100_000, M: int = 30, d: int = 14) -> dict[str, float]:
    """One E and M step, plain and with competition, over the time of two products of N M d^2 multiply-adds."""
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
    """A whole fit over the choice of a Gaussian mixture by BIC, on insertions or on separated Gaussians."""
    X, y = sets.insertion(seed, N) if demonstrated else sets.separated(seed, c=2.0, N=N)
    known: dict[str, Any] = {}
    if demonstrated:
        groups, phase = sets.demonstrations_and_phase(y)
        known = {"groups": groups, "phase": phase}
    Z = (X - X.mean(0)) / X.std(0)
    ours = fastest(lambda: CompetitiveAgglomeration(random_state=0).fit(X, **known), repeats=1)
    theirs = fastest(lambda: best_mixture(Z, 15, random_state=0), repeats=1)
    return {"fit_s": ours, "mixtures_s": theirs, "ratio": ours / theirs}


def estimate_against_product() -> dict[str, float]:
    """One on-line estimate of the contact state, without and with a transition matrix, over a matrix-vector product."""
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
    """Time (s) and peak memory (GiB) of one fit of a million samples."""
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
    parser = argument_parser(__doc__)
    parser.add_argument("--million", action="store_true", help="fit a million samples instead (minutes)")
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
    with threadpool_limits(1), progress("clustering speed", len(measurements)) as advance:
        for name, measure in measurements.items():
            figures[name] = measure()
            print(f"{name:24}" + "  ".join(f"{k} {v:.4g}" for k, v in figures[name].items()), flush=True)
            advance(name)
    if arguments.json:
        write_json(arguments.json, figures)


if __name__ == "__main__":
    run(main)
