import numpy as np
import pytest
from scipy.stats import t as student_t

from skill.regression.locally_weighted_regression import LWRegressor
from tests.skill.regression.samples import wavy


@pytest.mark.parametrize(
    "change",
    [
        *({"bandwidth": 0.0}, {"bandwidth_type": "wide"}, {"degree": 2}, {"degree": -1}, {"ridge": -1e-9}),
        *({"n_neighbors": 0}, {"feature_scale": "large"}),
    ],
)
def test_a_parameter_out_of_range_is_refused(change):
    X, Y = wavy(20)
    with pytest.raises(ValueError, match=f"The '{next(iter(change))}' parameter of LWRegressor must be"):
        LWRegressor(**change).fit(X, Y)


def test_standardised_features_ignore_those_that_do_not_vary():
    X, Y = wavy(60)
    X = np.column_stack([X * [1.0, 10.0, 0.1], np.full(60, 7.0)])
    dut = LWRegressor(feature_scale="standard").fit(X, Y)
    np.testing.assert_allclose(dut.feature_scale_, [*(1.0 / X[:, :3].std(axis=0)), 1.0])
    np.testing.assert_allclose(dut.X_, X * dut.feature_scale_)
    given = LWRegressor(feature_scale=[1.0, 2.0, 3.0, 4.0]).fit(X, Y)
    np.testing.assert_array_equal(given.X_, X * [1.0, 2.0, 3.0, 4.0])
    np.testing.assert_array_equal(LWRegressor(feature_scale=None).fit(X, Y).feature_scale_, 1.0)


@pytest.mark.parametrize(
    ("scale", "found"),
    [
        ([0.0, 1.0, 1.0], r"is \[0. 1. 1.\]"),
        ([1.0, 2.0, -1.0], r"is \[ 1.  2. -1.\]"),
        ([1.0, np.inf, 1.0], r"is \[ 1. inf  1.\]"),
        ([np.nan, 1.0, 1.0], r"is \[nan  1.  1.\]"),
        ([1.0, 1.0], r"has shape \(2,\)"),
        (1.0, r"The 'feature_scale' parameter of LWRegressor must be"),
    ],
)
def test_the_error_about_a_feature_scale_says_what_is_wrong_with_it(scale, found):
    X, Y = wavy(20)
    with pytest.raises(ValueError, match=found):
        LWRegressor(feature_scale=scale).fit(X, Y)


@pytest.mark.parametrize("value", [1e-300, 1e6 + 0.1])
@pytest.mark.parametrize("n", [3, 300, 100_000])
def test_a_constant_feature_keeps_its_unit_for_any_number_of_samples(value, n):
    X = np.column_stack([np.linspace(0.0, 1.0, n), np.full(n, value)])
    dut = LWRegressor(bandwidth=1.0, feature_scale="standard").fit(X, X[:, 0])
    np.testing.assert_array_equal(dut.feature_scale_, [1.0 / X.std(axis=0)[0], 1.0])


@pytest.mark.parametrize("ridge", [1e-3, 0.3])
@pytest.mark.parametrize("degree", [0, 1])
@pytest.mark.parametrize("bandwidth", [0.1, 0.25, 0.8])
def test_the_variance_is_that_of_the_weighted_residuals(ridge, degree, bandwidth):
    """sum w r^2 / (n - p) with p = sum w^2 z' A^-1 z; less than one degree of freedom is filled by the variance."""
    X, Y = wavy(40, 2)
    dut = LWRegressor(feature_scale=None, bandwidth=bandwidth, ridge=ridge, degree=degree, n_neighbors=None).fit(X, Y)
    queries = np.random.default_rng(3).uniform(-1, 1, (15, 2))
    local = dut.predict_local(queries)
    filled = 0
    for i, q in enumerate(queries):
        log_w = -((X - q) ** 2).sum(axis=1) / bandwidth**2
        w, scaled_ridge = np.exp(log_w - log_w.max()), ridge / np.exp(log_w.max())
        n = w.sum()
        centred = X - w @ X / n
        S = (centred * w[:, None]).T @ centred + scaled_ridge * np.eye(2)
        inverse = np.linalg.pinv(S, rcond=1e-13, hermitian=True) * degree
        residual = Y - w @ Y / n
        residual = residual - centred @ inverse @ (centred * w[:, None]).T @ residual
        kernel = w * (1.0 / n - centred @ inverse @ (w @ X / n - q))
        p = (w**2 * (1.0 / n + np.einsum("ij,jk,ik->i", centred, inverse, centred))).sum()
        missing = max(0.0, 1.0 - (n - p))
        filled += missing > 0
        freedom = max(n - p, 0.0) + missing
        variance = (w @ residual**2 + missing * Y.var(axis=0)) / freedom
        np.testing.assert_allclose(local.variance[i], variance, rtol=1e-6, atol=1e-12)
        np.testing.assert_allclose(local.freedom[i], freedom, rtol=1e-6)
        np.testing.assert_allclose(local.support[i], n)
        np.testing.assert_allclose(local.leverage[i], kernel @ kernel, rtol=1e-6)
        np.testing.assert_allclose(local.mean[i], kernel @ Y, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(local.log_w_max[i], log_w.max())
    assert (filled > 0) == (bandwidth < 0.3)
    factor = local.leverage[:, None]
    np.testing.assert_allclose(local.standard_deviation(), np.sqrt(local.variance * (1.0 + factor)))
    t = student_t.ppf(0.95, local.freedom)[:, None]
    lower, upper = local.interval(0.9)
    np.testing.assert_allclose(upper - local.mean, t * np.sqrt(local.variance * (1.0 + factor)), rtol=1e-6)
    np.testing.assert_allclose(local.mean - lower, upper - local.mean, rtol=1e-6)
    low, high = local.interval(0.9, kind="variance_only")
    np.testing.assert_allclose(high - low, 2.0 * t * np.sqrt(local.variance * factor), rtol=1e-6)


def test_a_channel_that_varies_by_rounding_errors_has_no_slope():
    rng = np.random.default_rng(0)
    X, y = rng.uniform(-1, 1, (50, 2)), rng.normal(size=50)
    X[:, 0] = 1.0 + 2e-16 * rng.integers(0, 2, 50)
    dut = LWRegressor(bandwidth=10.0, ridge=0.0).fit(X, y)
    queries = np.array([[2.0, 0.1], [0.0, -0.2], [1.5, 0.9]])
    batch = dut.predict(queries)
    assert np.abs(batch).max() < np.abs(y).max()
    np.testing.assert_allclose([dut.predict(q[None])[0] for q in queries], batch, rtol=1e-6)


def test_queries_far_away_are_clipped():
    X, y = wavy(30)
    dut = LWRegressor(feature_scale=np.full(3, 1e3)).fit(X, y)
    for sign in (-1.0, 1.0):
        far = dut.predict_local(np.full((1, 3), sign * 1e120))
        limit = dut.predict_local(np.full((1, 3), sign * 1e97))
        np.testing.assert_array_equal(far.mean, limit.mean)
        np.testing.assert_array_equal(far.log_w_max, limit.log_w_max)


def test_returned_values_have_the_shape_of_the_outputs():
    X, Y = wavy(30)
    one, many = LWRegressor().fit(X, Y[:, 0]), LWRegressor().fit(X, Y)
    for dut, shape in ((one, (4,)), (many, (4, 2))):
        assert dut.predict(X[:4]).shape == shape
        assert dut.predict(X[:1]).shape == (1, *shape[1:])
        assert dut.predict_with_support(X[:4])[0].shape == shape


def test_stored_arrays_restore_every_parameter():
    X, Y = wavy(30)
    P = np.full((30, 2), 0.5)
    for options in ({"n_neighbors": None}, {"n_neighbors": 7, "bandwidth_type": "adaptive", "degree": 0, "ridge": 0.5}):
        dut = LWRegressor(feature_scale=None, bandwidth=0.3, **options).fit(X, Y[:, 0], memberships=P)
        again = LWRegressor.from_arrays(dut.to_arrays())
        expected = {**dut.get_params(), "feature_scale": [1.0, 1.0, 1.0]}
        assert {**again.get_params(), "feature_scale": again.feature_scale.tolist()} == expected
        assert again.single_output_
        assert again.n_features_in_ == 3
        np.testing.assert_array_equal(again.marginal_variance_, dut.marginal_variance_)
        np.testing.assert_array_equal(again.rows_, np.arange(30))
    with pytest.raises(ValueError, match=r"arrays \['rows', 'y'\] are missing"):
        LWRegressor.from_arrays({k: v for k, v in dut.to_arrays().items() if k not in ("y", "rows")})


def test_each_of_two_samples_finds_the_support_of_the_other():
    np.testing.assert_allclose(
        LWRegressor(feature_scale=None, bandwidth=1.0).fit([[0.0], [1.0]], [3.0, 5.0]).support_between([0, 1]),
        [-1.0, -1.0],
    )
