import numpy as np
import pytest

from benchmarks.learners.interval_calibration import conformal_factors, conformal_interval
from skill.regression.locally_weighted_regression import LWRegressor


def demonstrations(seed, n_groups=30, length=50):
    """A noisy output, a curved output without noise, and an output that differs between demonstrations."""
    rng = np.random.default_rng(seed)
    groups = np.repeat(np.arange(n_groups), length)
    X = rng.uniform(-1, 1, (len(groups), 2))
    own = rng.normal(size=n_groups)[groups]
    y = np.column_stack([X[:, 0] + rng.normal(size=len(X)), np.sin(5 * X[:, 0]), X[:, 1] + own])
    return X, y, groups


def test_calibrated_intervals_have_the_nominal_coverage_on_new_demonstrations():
    dut = LWRegressor(bandwidth=0.8)
    plain, calibrated = [], []
    for seed in range(4):
        X, y, groups = demonstrations(seed)
        fresh, truth, _ = demonstrations(100 + seed)
        factors = conformal_factors(dut, X, y, groups, level=0.9)
        local = dut.fit(X, y).predict_local(fresh)
        for coverage, (lower, upper) in (
            (plain, local.interval(0.9)),
            (calibrated, conformal_interval(local, factors)),
        ):
            coverage.append(((truth >= lower) & (truth <= upper)).mean(axis=0))
    assert np.all(np.abs(np.mean(calibrated, axis=0) - 0.9) < 0.04)
    # Without noise the residuals are bias only, which the plain interval does not contain.
    assert abs(np.mean(plain, axis=0)[1] - 0.9) > 0.05


def test_factors_do_not_depend_on_units_and_grow_with_the_level():
    X, y, groups = demonstrations(0)
    dut = LWRegressor(bandwidth=0.5)
    one = conformal_factors(dut, X, y, groups)
    np.testing.assert_allclose(conformal_factors(dut, X, y * 1e3, groups), one)
    assert np.all(conformal_factors(dut, X, y, groups, level=0.5) < one)
    P = np.random.default_rng(0).dirichlet([0.3] * 3, len(X))
    assert np.isfinite(conformal_factors(dut, X, y, groups, memberships=P)).all()


def test_bad_arguments_raise():
    X, y, groups = demonstrations(0)
    with pytest.raises(ValueError, match="between 0 and 1"):
        conformal_factors(LWRegressor(), X, y, groups, level=95)
    with pytest.raises(ValueError, match="record more demonstrations"):
        conformal_factors(LWRegressor(), X, y, np.zeros(len(X)))
