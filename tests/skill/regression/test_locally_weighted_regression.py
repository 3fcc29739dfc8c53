"""Locally weighted regression against its definition, known answers, and what it refuses."""

import numpy as np
import pandas as pd
import pytest
import statsmodels.api as sm
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import t as student_t
from sklearn.utils.estimator_checks import parametrize_with_checks

from skill.regression.locally_weighted_regression import LWRegressor
from tests.skill.regression.samples import wavy

# R's `cars`: speed (mph) and stopping distance (ft) of 50 cars, M. Ezekiel, 1930.
CARS_SPEED = np.repeat(
    [4, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 22, 23, 24, 25],
    [2, 2, 1, 1, 3, 2, 4, 4, 4, 3, 2, 3, 4, 3, 5, 1, 1, 4, 1],
).astype(float)
CARS_DISTANCE = np.fromstring(
    "2 10 4 22 16 10 18 26 34 17 28 14 20 24 28 26 34 34 46 26 36 60 80 20 26 54 32 40 32 40 50 42 56 76"
    " 84 36 46 68 32 48 52 56 64 66 54 70 92 93 120 85",
    sep=" ",
)


@parametrize_with_checks([LWRegressor()])
def test_scikit_learn_checks(estimator, check):
    check(estimator)


def plain(X, Y, q, h, ridge, weights):
    """The local model from its definition, by least squares with the roots of the weights."""
    w = np.exp(-((X - q) ** 2).sum(1) / h**2) * weights
    Z = np.column_stack([np.ones(len(X)), X - q])
    d = X.shape[1]
    rows = np.vstack([np.sqrt(w)[:, None] * Z, np.sqrt(ridge) * np.eye(d + 1)[1:]])
    right = np.vstack([np.sqrt(w)[:, None] * Y, np.zeros((d, Y.shape[1]))])
    return np.linalg.lstsq(rows, right, rcond=None)[0][0]


@pytest.mark.parametrize("ridge", [0.0, 1e-2, 1.0])
def test_the_prediction_is_the_weighted_least_squares_one(ridge):
    rng = np.random.default_rng(4)
    X, Y = wavy()
    queries, weight = rng.uniform(-1, 1, (20, 3)), rng.uniform(0.1, 1.0, 400)
    P, Q = 0.1 + 0.8 * rng.dirichlet([0.5] * 2, 400), 0.1 + 0.8 * rng.dirichlet([0.5] * 2, 20)
    dut = LWRegressor(feature_scale=None, bandwidth=0.7, ridge=ridge, n_neighbors=None).fit(X, Y, P, weight)
    expected = np.array([plain(X, Y, q, 0.7, ridge, weight * (P @ r)) for q, r in zip(queries, Q, strict=True)])
    np.testing.assert_allclose(dut.predict(queries, Q), expected, rtol=0, atol=1e-12)


def tricube_local_line(x, y, frac=2 / 3):
    """Cleveland's local line with tricube weights, given to our solver as sample weights."""
    k = int(frac * len(x) + 1e-10)
    fitted = []
    for q in x:
        distance = np.abs(x - q)
        h = np.sort(distance)[k - 1]
        w = np.where(distance <= 0.999 * h, (1 - (distance / h) ** 3).clip(0) ** 3, 0.0)
        w[distance <= 0.001 * h] = 1.0
        dut = LWRegressor(bandwidth=1e9, ridge=0.0, n_neighbors=None).fit(x[:, None], y, sample_weight=w)
        fitted.append(dut.predict([[q]])[0])
    return np.array(fitted)


def test_known_answers_of_r_on_cars():
    fitted = tricube_local_line(CARS_SPEED, CARS_DISTANCE)
    # lowess(cars, iter = 0)$y at distinct speeds, first three and last
    distinct = fitted[np.unique(CARS_SPEED, return_index=True)[1]]
    np.testing.assert_allclose(distinct[[0, 1, 2, -1]], [3.443864, 12.784337, 15.952393, 89.127515], atol=1e-6)


@pytest.mark.parametrize("distance", [1e1, 1e8, 1e307])
def test_the_prediction_at_a_far_query_is_a_mean_of_the_outputs(distance):
    X, Y = wavy()
    local = LWRegressor(bandwidth=0.3, n_neighbors=50).fit(X, Y).predict_local(np.full((2, 3), distance))
    for value in (local.mean, local.variance, *local.interval()):
        assert np.isfinite(value).all()
    assert np.all((local.mean >= Y.min(0) - 1e-9) & (local.mean <= Y.max(0) + 1e-9))
    assert np.all(local.log_w_max < -100)


def test_the_variance_of_a_wide_local_line_is_that_of_ordinary_least_squares():
    X, Y = wavy(80, 2)
    dut = LWRegressor(bandwidth=1e6, ridge=0.0, n_neighbors=None).fit(X, Y[:, 0])
    ols = sm.OLS(Y[:, 0], sm.add_constant(X)).fit()
    fresh = np.random.default_rng(1).uniform(-1, 1, (10, 2))
    frame = ols.get_prediction(sm.add_constant(fresh)).summary_frame(alpha=0.1)
    local = dut.predict_local(fresh)
    lower, upper = local.interval(0.9)
    np.testing.assert_allclose(local.mean[:, 0], frame["mean"], atol=1e-8)
    np.testing.assert_allclose(lower[:, 0], frame["obs_ci_lower"], atol=1e-6)
    np.testing.assert_allclose(upper[:, 0], frame["obs_ci_upper"], atol=1e-6)


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


@pytest.mark.parametrize("q", [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [0.2, 0.0, 0.0]])
def test_a_state_without_samples_or_an_unknown_state_gives_a_kernel_mean(q):
    X, Y = wavy()
    P = np.eye(3)[np.arange(400) % 2]
    dut = LWRegressor(bandwidth=0.5).fit(X, Y, memberships=P)
    local = dut.predict_local(X[:1], [q])
    assert np.isfinite(local.mean).all()
    assert np.all((local.mean > Y.min(0)) & (local.mean < Y.max(0)))
    if q[0] == 0:
        assert local.log_w_max[0] < -600


def test_sample_weights_count_like_repetitions():
    X, Y = wavy(100)
    weight = np.random.default_rng(0).integers(0, 3, 100)
    repeated = np.repeat(np.arange(100), weight)
    dut = LWRegressor(feature_scale=None, bandwidth=0.5, n_neighbors=None).fit(X, Y, sample_weight=weight)
    other = LWRegressor(feature_scale=None, bandwidth=0.5, n_neighbors=None).fit(X[repeated], Y[repeated])
    np.testing.assert_allclose(dut.predict(X), other.predict(X), atol=1e-11)


def test_the_explanation_adds_up_to_the_prediction():
    X, Y = wavy()
    weight = np.ones(400)
    weight[:7] = 0
    P = np.random.default_rng(0).dirichlet([0.3] * 3, 400)
    dut = LWRegressor(bandwidth=0.4, n_neighbors=30).fit(X, Y, memberships=P, sample_weight=weight)
    why = dut.explain(X[20], P[20])
    np.testing.assert_allclose(why.influence @ Y[why.neighbours], why.prediction, atol=1e-12)
    np.testing.assert_allclose(dut.predict(X[20:21], P[20:21])[0], why.prediction, atol=1e-12)
    assert np.all(np.diff(why.weights) <= 0)
    assert why.weights[0] == 1.0
    assert len(np.unique(why.neighbours)) == len(why.neighbours) <= 30
    assert why.support == pytest.approx(why.weights.sum())
    assert np.all((why.lower < why.prediction) & (why.prediction < why.upper))
    np.testing.assert_allclose(why.influence.sum(), 1.0)


def test_other_errors_name_the_remedy():
    X, Y = wavy()
    dut = LWRegressor(bandwidth=1.0).fit(X, Y)
    with pytest.raises(ValueError, match="at least one"):
        LWRegressor().fit(X, Y, sample_weight=np.zeros(400))
    with pytest.raises(ValueError, match="one row a sample"):
        LWRegressor().fit(X, Y, memberships=np.ones((399, 1)))
    with pytest.raises(ValueError, match="give memberships to fit too"):
        dut.predict(X[:1], [[1.0]])
    with pytest.raises(ValueError, match="between 0 and 1"):
        dut.predict_local(X[:1]).interval(95)
    with pytest.raises(ValueError, match="to_arrays"):
        LWRegressor.from_arrays({})
    with pytest.raises(ValueError, match="NaN"):
        dut.predict([[np.nan, 0.0, 0.0]])


@given(
    st.integers(1, 60),
    st.integers(1, 5),
    st.floats(1e-3, 1e3),
    st.sampled_from([0.0, 1e-8, 1e-2]),
    st.integers(0, 2**32 - 1),
)
def test_duplicates_constant_channels_and_few_samples_stay_finite(n, d, bandwidth, ridge, seed):
    rng = np.random.default_rng(seed)
    X = rng.integers(0, 3, (n, d)).astype(float)  # many duplicates
    X[:, 0] = 1.0
    y = rng.normal(size=n)
    dut = LWRegressor(bandwidth=bandwidth, ridge=ridge, n_neighbors=10).fit(X, y)
    queries = rng.normal(size=(5, d))
    local = dut.predict_local(queries)
    lower, upper = local.interval()
    for value in (local.mean, local.standard_deviation(), lower, upper):
        assert np.isfinite(value).all()
    assert np.all(lower <= upper)


def test_support_is_the_log_of_the_greatest_kernel_weight():
    rng = np.random.default_rng(5)
    X, y = rng.normal(size=(80, 3)), rng.normal(size=(80, 2))
    P = rng.dirichlet(np.ones(3), 80)
    queries, Q = rng.normal(size=(7, 3)), rng.dirichlet(np.ones(3), 7)
    dut = LWRegressor(feature_scale=None, bandwidth=0.7).fit(X, y, memberships=P)
    predicted, support = dut.predict_with_support(queries, Q)
    np.testing.assert_allclose(predicted, dut.predict(queries, Q), rtol=1e-9)
    squared = ((queries[:, None] - X[None]) ** 2).sum(axis=2)
    np.testing.assert_allclose(support, (np.log(Q @ P.T) - squared / 0.7**2).max(axis=1), rtol=1e-9)
    alone, at_a_sample = LWRegressor(feature_scale=None).fit(X, y).predict_with_support(X[:1])
    assert at_a_sample == pytest.approx(0.0)
    assert alone.shape == (1, 2)


@pytest.mark.parametrize("n_neighbors", [None, 5])
def test_support_between_groups_leaves_each_group_out(n_neighbors):
    rng = np.random.default_rng(6)
    groups = np.repeat([0, 1, 2, 3], 20)
    # Each group walks around its own place, so that the nearest samples of a sample belong to its own group.
    X = rng.normal(size=(4, 1, 2))[:, np.zeros(20, dtype=int)] + 0.05 * rng.normal(size=(4, 20, 2)).cumsum(axis=1)
    X = X.reshape(80, 2)
    dut = LWRegressor(feature_scale=None, bandwidth=0.5, n_neighbors=n_neighbors).fit(X, X)
    squared = ((X[:, None] - X[None]) ** 2).sum(axis=2)
    squared[groups[:, None] == groups] = np.inf
    np.testing.assert_allclose(dut.support_between(groups), -squared.min(axis=1) / 0.25, rtol=1e-9)


@pytest.mark.parametrize(
    "change",
    [
        *({"bandwidth": 0.0}, {"degree": 2}, {"ridge": -1e-9}),
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
    dut = LWRegressor(bandwidth=1.0, feature_scale="standard").fit(X, Y)
    np.testing.assert_allclose(dut.feature_scale_, [*(1.0 / X[:, :3].std(axis=0)), 1.0])
    np.testing.assert_allclose(dut.X_, X * dut.feature_scale_)
    given = LWRegressor(bandwidth=1.0, feature_scale=[1.0, 2.0, 3.0, 4.0]).fit(X, Y)
    np.testing.assert_array_equal(given.X_, X * [1.0, 2.0, 3.0, 4.0])
    np.testing.assert_array_equal(LWRegressor(1.0, feature_scale=None).fit(X, Y).feature_scale_, 1.0)


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


def test_a_constant_feature_keeps_its_unit():
    X = np.column_stack([np.linspace(0.0, 1.0, 100_000), np.full(100_000, 1e6 + 0.1)])
    dut = LWRegressor(bandwidth=1.0, feature_scale="standard").fit(X, X[:, 0])
    np.testing.assert_array_equal(dut.feature_scale_, [1.0 / X.std(axis=0)[0], 1.0])


def test_a_channel_that_varies_by_rounding_errors_has_no_slope():
    rng = np.random.default_rng(0)
    X, y = rng.uniform(-1, 1, (50, 2)), rng.normal(size=50)
    X[:, 0] = 1.0 + 2e-16 * rng.integers(0, 2, 50)
    dut = LWRegressor(bandwidth=10.0, ridge=0.0).fit(X, y)
    queries = np.array([[2.0, 0.1], [0.0, -0.2], [1.5, 0.9]])
    assert np.abs(dut.predict(queries)).max() < np.abs(y).max()


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
        assert dut.predict_with_support(X[:4])[0].shape == shape


def test_stored_arrays_restore_an_estimator_that_predicts_the_same_bits(tmp_path):
    X, Y = wavy(30)
    P = np.random.default_rng(0).dirichlet([0.3] * 3, 30)
    frame = pd.DataFrame(X, columns=["a", "b", "c"])
    for options in ({"n_neighbors": None}, {"n_neighbors": 7, "degree": 0, "ridge": 0.5}):
        dut = LWRegressor(feature_scale=None, bandwidth=0.3, **options)
        dut.fit(frame, Y[:, 0], memberships=P, sample_weight=np.linspace(0, 1, 30))
        np.savez(tmp_path / "regressor.npz", **dut.to_arrays())
        with np.load(tmp_path / "regressor.npz", allow_pickle=False) as arrays:
            again = LWRegressor.from_arrays(arrays)
        expected = {**dut.get_params(), "feature_scale": [1.0, 1.0, 1.0]}
        assert {**again.get_params(), "feature_scale": again.feature_scale.tolist()} == expected
        for Q in (None, P):
            np.testing.assert_array_equal(again.predict(frame, Q), dut.predict(frame, Q))
        one, other = again.explain(X[3], P[3]), dut.explain(X[3], P[3])
        np.testing.assert_array_equal(one.neighbours, other.neighbours)
        np.testing.assert_array_equal(one.lower, other.lower)
    with pytest.raises(ValueError, match=r"arrays \['rows', 'y'\] are missing"):
        LWRegressor.from_arrays({k: v for k, v in dut.to_arrays().items() if k not in ("y", "rows")})
