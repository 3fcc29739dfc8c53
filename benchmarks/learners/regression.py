"""Locally weighted regression against other regressors: accuracy on fresh data, and time.

    python -m benchmarks.learners.regression [--only accuracy|intervals] [--json FILE]

Every learner chooses its parameters by cross-validation over groups of the training set. Accuracy, one row per learner:

- nRMSE: root mean squared error to the noiseless outputs of fresh seeds, over their standard deviation, averaged over
  outputs and seeds;
- fit s: time of a fit, the choice of parameters included;
- us/query: time of a query, all queries in one call.

Intervals, one row per problem, one figure per output: coverage of the intervals of locally weighted regression on fresh
seeds, of nominally 0.95.

- prediction: share of new noisy outputs within the prediction interval;
- mean, variance only: share of noiseless outputs within the interval of the mean, which leaves out the bias.
"""

from __future__ import annotations

import platform
import time
import warnings
from collections.abc import Callable
from typing import Annotated, Any, Literal

import numpy as np
import typer
from numpy.typing import ArrayLike
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
from sklearn.linear_model import RidgeCV
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.multioutput import MultiOutputRegressor
from sklearn.neighbors import KNeighborsRegressor
from sklearn.preprocessing import StandardScaler
from threadpoolctl import threadpool_limits

from benchmarks.command_line import JsonFile, finish, run
from benchmarks.learners.gaussian_mixture_regression import best_mixture, gmr_predict
from benchmarks.learners.regression_sets import Problem, cross, friedman, insertion
from interfaces.terminal import progress
from skill.arrays import Array
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.regression.bandwidth_selection import select_bandwidth, select_feature_scale
from skill.regression.locally_weighted_regression import LWRegressor

Predict = Callable[[Array], Array]
"""Outputs (n, p) for inputs (n, d)."""

Fit = Callable[[Array, Problem], Predict]
"""Trains on standardised inputs (n, d) of a problem."""

SEEDS = range(3)
MAX_GP_SAMPLES = 1500  # the cost of a Gaussian process grows with their cube


def main(
    only: Annotated[Literal["accuracy", "intervals"] | None, typer.Option(help="Measure this alone.")] = None,
    json: JsonFile = None,
) -> None:
    parts: dict[str, Callable[[], Any]] = {"accuracy": compare, "intervals": coverages}
    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        found = {name: measure() for name, measure in parts.items() if only in (None, name)}
    finish({"python": platform.python_version(), **found}, json)


PROBLEMS: dict[str, Callable[[int], Problem]] = {
    "cross 500": lambda s: cross(500, s),
    "friedman 1000": lambda s: friedman(1000, s),
    "insertion canonical": lambda s: insertion(3000, s, "canonical"),
    "insertion normalised": lambda s: insertion(3000, s, "normalised"),
    "insertion raw": lambda s: insertion(3000, s, "raw"),
    "friedman 10000": lambda s: friedman(10_000, s),
}
"""The problems by name, as functions of the seed."""


def compare() -> dict[str, Any]:
    """Accuracy and time of every learner on every problem, by the names of both."""
    table: dict[str, Any] = {}
    with progress("regression", len(PROBLEMS) * len(LEARNERS)) as advance:
        for name, problem in PROBLEMS.items():
            table[name] = {}
            for learner, fit in LEARNERS.items():
                pairs = [(problem(seed), problem(1000 + seed)) for seed in SEEDS]
                if not (fit is fit_gp and len(pairs[0][0].X) > MAX_GP_SAMPLES):
                    nrmse, seconds, query = np.mean([evaluate(fit, *pair) for pair in pairs], axis=0)
                    table[name][learner] = {"nrmse": nrmse, "fit_s": seconds, "query_us": query}
                advance(f"{name}: {learner}")
            report(name, table[name])
    return table


def evaluate(fit: Fit, train: Problem, fresh: Problem) -> tuple[float, float, float]:
    """The normalised error on fresh data, the time of the fit, s, and the time of a query, us."""
    start = time.perf_counter()
    scaler = StandardScaler().fit(train.X)
    predict = fit(scaler.transform(train.X), train)
    fitted = time.perf_counter()
    out = predict(scaler.transform(fresh.X)).reshape(len(fresh.X), -1)
    done = time.perf_counter()
    out = fresh.judged(out)
    error = np.sqrt(((out - fresh.truth) ** 2).mean(axis=0)) / fresh.truth.std(axis=0)
    return float(error.mean()), fitted - start, 1e6 * (done - fitted) / len(out)


def report(name: str, results: dict[str, dict[str, float]]) -> None:
    """Prints the results on one problem, the most accurate learner first."""
    print(f"\n{name:28} {'nRMSE':>7} {'fit s':>8} {'us/query':>9}")
    best = min(r["nrmse"] for r in results.values())
    for learner, r in sorted(results.items(), key=lambda item: item[1]["nrmse"]):
        mark = " <- best" if r["nrmse"] == best else ""
        print(f"  {learner:26} {r['nrmse']:7.3f} {r['fit_s']:8.2f} {r['query_us']:9.1f}{mark}")


def predictor(model: Any) -> Predict:
    """The ``predict`` of a fitted model."""
    return lambda Q: np.asarray(model.predict(Q))


def fit_ridge(X: Array, train: Problem) -> Predict:
    return predictor(RidgeCV(np.geomspace(1e-3, 1e3, 13)).fit(X, train.y))


def fit_knn(X: Array, train: Problem) -> Predict:
    return search(KNeighborsRegressor(), {"n_neighbors": [1, 3, 5, 10, 20, 40, 80]}, X, train)


def fit_gradient_boosting(X: Array, train: Problem) -> Predict:
    model = MultiOutputRegressor(HistGradientBoostingRegressor(random_state=0))
    return search(model, {"estimator__max_iter": [50, 100, 300]}, X, train)


def search(model: Any, grid: dict[str, list[Any]], X: Array, train: Problem) -> Predict:
    """The model with the best parameters of the grid, by cross-validation over groups."""
    folds = GroupKFold(5).split(X, groups=train.groups)
    return predictor(GridSearchCV(model, grid, cv=list(folds), scoring="neg_mean_squared_error").fit(X, train.y))


def fit_gp(X: Array, train: Problem) -> Predict:
    kernel = ConstantKernel(1.0) * RBF(np.ones(X.shape[1])) + WhiteKernel(0.1)
    return predictor(GaussianProcessRegressor(kernel, normalize_y=True, random_state=0).fit(X, train.y))


def lwr(**settings: Any) -> Fit:
    """Locally weighted regression with these settings; the bandwidth is chosen by cross-validation."""

    def fit(X: Array, train: Problem) -> Predict:
        model = LWRegressor(feature_scale=None, **settings)
        chosen = select_bandwidth(model, X, train.y, train.groups)
        return predictor(model.set_params(bandwidth=chosen.bandwidth).fit(X, train.y))

    return fit


def fit_scaled_lwr(X: Array, train: Problem) -> Predict:
    """Chooses the bandwidth, then the scale of each feature, then the bandwidth again."""
    model = LWRegressor(feature_scale=None)
    model.set_params(bandwidth=select_bandwidth(model, X, train.y, train.groups).bandwidth)
    scale = select_feature_scale(model, X, train.y, train.groups, max_queries=500).feature_scale
    model.set_params(feature_scale=scale)
    model.set_params(bandwidth=select_bandwidth(model, X, train.y, train.groups).bandwidth)
    return predictor(model.fit(X, train.y))


def fit_gmr(X: Array, train: Problem) -> Predict:
    """Gaussian mixture regression; the mixture is chosen by BIC, one start each."""
    spread = train.y.std(axis=0)
    Z = np.hstack([X, train.y / spread])
    best = best_mixture(Z, 15, reg_covar=1e-4, random_state=0)
    return conditioned(best.means_, best.covariances_, best.weights_, X.shape[1], spread)


def fit_gmr_ca(X: Array, train: Problem) -> Predict:
    """Gaussian mixture regression; the Gaussians are found by Competitive Agglomeration."""
    spread = train.y.std(axis=0)
    states = CompetitiveAgglomeration(random_state=0).fit(np.hstack([X, train.y / spread]))
    return conditioned(states.means_, states.covariances_, states.weights_, X.shape[1], spread)


def conditioned(means: ArrayLike, covariances: ArrayLike, weights: ArrayLike, d: int, spread: Array) -> Predict:
    """The regression of Gaussians over d inputs and the outputs divided by their ``spread`` (p,)."""
    outputs = np.arange(d, d + len(spread))
    return lambda Q: gmr_predict(means, covariances, weights, Q, np.arange(d), outputs) * spread


LEARNERS: dict[str, Fit] = {
    "global ridge": fit_ridge,
    "KNN": fit_knn,
    "kernel mean (degree 0)": lwr(degree=0),
    "LWR": lwr(),
    "LWR ridge 1e-6": lwr(ridge=1e-6),
    "LWR adaptive": lwr(bandwidth_type="adaptive"),
    "LWR, scale selected": fit_scaled_lwr,
    "GMR, mixture by BIC": fit_gmr,
    "GMR, CA": fit_gmr_ca,
    "gradient boosting": fit_gradient_boosting,
    "Gaussian process": fit_gp,
}


def coverages() -> dict[str, dict[str, list[float]]]:
    """Coverage of the intervals on each problem: one share per output, averaged over the seeds."""
    table = {}
    print(f"\n{'coverage, one figure per output':32} {'prediction':>22} {'mean, variance only':>22}")
    for name, problem in PROBLEMS.items():
        rows = [coverage(problem(seed), problem(1000 + seed)) for seed in SEEDS]
        table[name] = {kind: np.mean([row[kind] for row in rows], axis=0).round(3).tolist() for kind in rows[0]}
        print(f"  {name:30} " + " ".join(f"{' '.join(f'{v:.3f}' for v in m):>22}" for m in table[name].values()))
    return table


def coverage(train: Problem, fresh: Problem) -> dict[str, Array]:
    """Shares (p,) of fresh outputs, and for the interval of the mean of noiseless outputs, within the intervals."""
    scaler = StandardScaler().fit(train.X)
    X, Q = scaler.transform(train.X), scaler.transform(fresh.X)
    model = LWRegressor()
    model.set_params(bandwidth=select_bandwidth(model, X, train.y, train.groups).bandwidth)
    local = model.fit(X, train.y).predict_local(Q)
    intervals = {
        "prediction": (local.interval(), fresh.y),
        "variance_only": (local.interval(kind="variance_only"), fresh.framed(fresh.truth)),
    }
    return {kind: ((v >= lower) & (v <= upper)).mean(axis=0) for kind, ((lower, upper), v) in intervals.items()}


if __name__ == "__main__":
    run(main)
