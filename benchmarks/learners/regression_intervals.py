"""Coverage of the 95 % intervals of locally weighted regression on fresh data.

    python -m benchmarks.learners.regression_intervals [--json FILE]

Each row is a problem; each cell has one coverage per output, averaged over three seeds. The nominal value is 0.95.

- prediction: share of new noisy outputs within the prediction interval;
- calibrated: the same for the interval calibrated on left-out groups (`benchmarks.learners.interval_calibration`);
- mean, variance only: share of noiseless outputs within the interval of the mean, which leaves out the bias.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from sklearn.preprocessing import StandardScaler
from threadpoolctl import threadpool_limits

from benchmarks.command_line import argument_parser, run
from benchmarks.learners.interval_calibration import conformal_factors, conformal_interval
from benchmarks.learners.regression_sets import Problem, cross, friedman, insertion
from interfaces.terminal import progress, write_json
from skill.arrays import Array
from skill.regression.bandwidth_selection import select_bandwidth
from skill.regression.locally_weighted_regression import LWRegressor

PROBLEMS: dict[str, Callable[[int], Problem]] = {
    "cross 500": lambda s: cross(500, s),
    "friedman 1000": lambda s: friedman(1000, s),
    "insertion canonical": lambda s: insertion(3000, s, "canonical"),
    "insertion raw": lambda s: insertion(3000, s, "raw"),
}


def main() -> None:
    arguments = argument_parser(__doc__).parse_args()
    table = {}
    print(f"{'coverage, one figure per output':32} {'prediction':>22} {'calibrated':>22} {'mean, variance only':>22}")
    with threadpool_limits(1), progress("coverage of intervals", len(PROBLEMS)) as advance:
        for name, problem in PROBLEMS.items():
            rows = [coverage(problem(seed), problem(1000 + seed)) for seed in range(3)]
            means = {kind: np.mean([row[kind] for row in rows], axis=0).round(3).tolist() for kind in rows[0]}
            table[name] = means
            print(f"  {name:30} " + " ".join(f"{' '.join(f'{v:.3f}' for v in m):>22}" for m in means.values()))
            advance(name)
    if arguments.json:
        write_json(arguments.json, table)


def coverage(train: Problem, fresh: Problem) -> dict[str, Array]:
    """Shares (p,) of fresh outputs, and for the interval of the mean of noiseless outputs, within the intervals."""
    scaler = StandardScaler().fit(train.X)
    X, Q = scaler.transform(train.X), scaler.transform(fresh.X)
    model = LWRegressor()
    model.set_params(bandwidth=select_bandwidth(model, X, train.y, train.groups).bandwidth)
    factors = conformal_factors(model, X, train.y, train.groups)
    local = model.fit(X, train.y).predict_local(Q)
    truth = fresh.framed(fresh.truth)
    intervals = {
        "prediction": (local.interval(), fresh.y),
        "calibrated": (conformal_interval(local, factors), fresh.y),
        "variance_only": (local.interval(kind="variance_only"), truth),
    }
    return {k: ((v >= lower) & (v <= upper)).mean(axis=0) for k, ((lower, upper), v) in intervals.items()}


if __name__ == "__main__":
    run(main)
