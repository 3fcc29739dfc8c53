import numpy as np
import pandas as pd
import pytest
import statsmodels.api as sm
from hypothesis import given
from hypothesis import strategies as st
from sklearn.utils.estimator_checks import parametrize_with_checks
from statsmodels.nonparametric.kernel_regression import KernelReg

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


@parametrize_with_checks([LWRegressor(), LWRegressor(bandwidth=0.3, degree=0, bandwidth_type="adaptive")])
def test_scikit_learn_checks(estimator, check):
    check(estimator)


def plain(X, Y, q, h, ridge, weights=None):
    """The local model from its definition, by least squares with the roots of the weights."""
    w = np.exp(-((X - q) ** 2).sum(1) / h**2) * (1.0 if weights is None else weights)
    Z = np.column_stack([np.ones(len(X)), X - q])
    d = X.shape[1]
    rows = np.vstack([np.sqrt(w)[:, None] * Z, np.sqrt(ridge) * np.eye(d + 1)[1:]])
    right = np.vstack([np.sqrt(w)[:, None] * Y, np.zeros((d, Y.shape[1]))])
    return np.linalg.lstsq(rows, right, rcond=None)[0][0]


@pytest.mark.parametrize("ridge", [0.0, 1e-2, 1.0])
def test_the_prediction_is_the_weighted_least_squares_one(ridge):
    X, Y = wavy()
    queries = np.random.default_rng(1).uniform(-1, 1, (20, 3))
    dut = LWRegressor(feature_scale=None, bandwidth=0.7, ridge=ridge, n_neighbors=None).fit(X, Y)
    expected = np.array([plain(X, Y, q, 0.7, ridge) for q in queries])
    np.testing.assert_allclose(dut.predict(queries), expected, rtol=0, atol=1e-12)
    one_by_one = np.vstack([dut.predict(q[None]) for q in queries])
    np.testing.assert_allclose(one_by_one, expected, rtol=0, atol=1e-12)


def test_degree_zero_is_the_kernel_mean():
    X, Y = wavy()
    queries = X[:15] + 0.01
    w = np.exp(-((X[None] - queries[:, None]) ** 2).sum(-1) / 0.3**2)
    dut = LWRegressor(feature_scale=None, bandwidth=0.3, degree=0, n_neighbors=None).fit(X, Y)
    np.testing.assert_allclose(dut.predict(queries), w @ Y / w.sum(1, keepdims=True), atol=1e-13)


def test_statsmodels_local_linear_kernel_regression_agrees():
    X, Y = wavy(150, 2)
    h = 0.5
    queries = X[:30] * 0.9
    peer = KernelReg(Y[:, 0], X, var_type="cc", reg_type="ll", bw=[h / np.sqrt(2)] * 2)
    dut = LWRegressor(feature_scale=None, bandwidth=h, ridge=0.0, n_neighbors=None).fit(X, Y[:, 0])
    np.testing.assert_allclose(dut.predict(queries), peer.fit(queries)[0], atol=1e-12)


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
    peer = sm.nonparametric.lowess(CARS_DISTANCE, CARS_SPEED, it=0, delta=0.0)
    np.testing.assert_allclose(fitted, peer[:, 1], atol=1e-10)


def test_known_answers_of_r_loess_on_cars():
    # loess(cars): local quadratics, span 0.75. A quadratic in x is linear in (x, x^2). R interpolates
    # between the vertices of its grid, of which 8 is one; at 5, 6, 7 its printed values are only near the
    # local fits.
    def quadratic(q):
        distance = np.abs(CARS_SPEED - q)
        h = np.sort(distance)[int(0.75 * 50) - 1]
        w = (1 - (distance / h).clip(max=1) ** 3) ** 3
        X = np.column_stack([CARS_SPEED, CARS_SPEED**2])
        dut = LWRegressor(bandwidth=1e9, ridge=0.0, n_neighbors=None).fit(X, CARS_DISTANCE, sample_weight=w)
        return dut.predict([[q, q**2]])[0]

    assert quadratic(8.0) == pytest.approx(15.281082, abs=1e-6)
    np.testing.assert_allclose(
        [quadratic(5.0), quadratic(6.0), quadratic(7.0)], [7.797353, 10.002308, 12.499786], atol=0.1
    )


def test_a_linear_function_is_reproduced_exactly():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(500, 14))
    Y = X @ rng.normal(size=(14, 3)) + rng.normal(size=3)
    dut = LWRegressor(bandwidth=3.0, ridge=0.0).fit(X, Y)
    queries = rng.normal(size=(50, 14))
    B = np.linalg.lstsq(np.column_stack([np.ones(500), X]), Y, rcond=None)[0]
    np.testing.assert_allclose(dut.predict(queries), np.column_stack([np.ones(50), queries]) @ B, atol=1e-10)


@pytest.mark.parametrize("distance", [1e1, 1e8, 1e307])
@pytest.mark.parametrize("kind", ["fixed", "adaptive"])
@pytest.mark.parametrize("degree", [0, 1])
def test_the_prediction_at_a_far_query_is_a_mean_of_the_outputs(distance, kind, degree):
    X, Y = wavy()
    bandwidth = 0.3 if kind == "fixed" else 1.0
    dut = LWRegressor(bandwidth=bandwidth, bandwidth_type=kind, degree=degree, n_neighbors=50).fit(X, Y)
    queries = np.full((2, 3), distance)
    local = dut.predict_local(queries)
    for value in (local.mean, local.variance, *local.interval()):
        assert np.isfinite(value).all()
    if kind == "fixed" or degree == 0:  # an adaptive kernel follows the query
        assert np.all((local.mean >= Y.min(0) - 1e-9) & (local.mean <= Y.max(0) + 1e-9))
    if kind == "fixed":
        assert np.all(local.log_w_max < -100)
    np.testing.assert_allclose(dut.predict(queries[:1]), local.mean[:1], rtol=1e-6)


def test_prediction_intervals_have_their_coverage_and_variance_only_ones_are_narrower():
    covered, narrow = [], []
    for seed in range(5):
        X, Y = wavy(600, 2, noise=0.2, seed=seed)
        fresh, truth = wavy(400, 2, noise=0.2, seed=seed + 100)
        local = LWRegressor(bandwidth=0.3).fit(X, Y).predict_local(fresh)
        lower, upper = local.interval(0.95)
        covered.append(np.mean((truth >= lower) & (truth <= upper)))
        low, high = local.interval(0.95, kind="variance_only")
        narrow.append(np.all((low >= lower) & (high <= upper)))
    assert 0.93 <= np.mean(covered) <= 1.0
    assert all(narrow)


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
    low, high = local.interval(0.9, kind="variance_only")
    np.testing.assert_allclose(low[:, 0], frame["mean_ci_lower"], atol=1e-6)
    np.testing.assert_allclose(high[:, 0], frame["mean_ci_upper"], atol=1e-6)


def one_hot(labels, K):
    return np.eye(K)[labels]


def test_one_hot_memberships_are_a_regressor_for_each_state():
    X, Y = wavy(600)
    labels = np.random.default_rng(2).integers(0, 4, 600)
    queries, state = X[:40] + 0.02, np.random.default_rng(3).integers(0, 4, 40)
    dut = LWRegressor(feature_scale=None, bandwidth=0.5, n_neighbors=60).fit(X, Y, memberships=one_hot(labels, 4))
    expected = np.empty((40, 2))
    for k in range(4):
        alone = LWRegressor(feature_scale=None, bandwidth=0.5, n_neighbors=60).fit(X[labels == k], Y[labels == k])
        expected[state == k] = alone.predict(queries[state == k])
    Q = one_hot(state, 4)
    np.testing.assert_allclose(dut.predict(queries, Q), expected, atol=1e-12)
    singly = np.vstack([dut.predict(queries[i : i + 1], Q[i : i + 1]) for i in range(40)])
    np.testing.assert_allclose(singly, expected, atol=1e-12)


def test_soft_memberships_multiply_the_kernel():
    rng = np.random.default_rng(4)
    X, Y = wavy(300)
    P, Q = rng.dirichlet([0.5] * 3, 300), rng.dirichlet([0.5] * 3, 25)
    queries = rng.uniform(-1, 1, (25, 3))
    weight = rng.uniform(0.1, 1.0, 300)
    dut = LWRegressor(feature_scale=None, bandwidth=0.6, n_neighbors=None).fit(
        X, Y, memberships=P, sample_weight=weight
    )
    expected = [plain(X, Y, q, 0.6, 1e-2, weight * (P @ r)) for q, r in zip(queries, Q, strict=True)]
    # Samples and states below the search's threshold are left out.
    np.testing.assert_allclose(dut.predict(queries, Q), expected, atol=2e-3)
    singly = np.vstack([dut.predict(queries[i : i + 1], Q[i : i + 1]) for i in range(25)])
    np.testing.assert_allclose(singly, dut.predict(queries, Q), atol=1e-12)


@pytest.mark.parametrize("q", [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [0.2, 0.0, 0.0]])
def test_a_state_without_samples_or_an_unknown_state_gives_a_kernel_mean(q):
    X, Y = wavy()
    P = one_hot(np.arange(400) % 2, 3)
    dut = LWRegressor(bandwidth=0.5).fit(X, Y, memberships=P)
    local = dut.predict_local(X[:1], [q])
    assert np.isfinite(local.mean).all()
    assert np.all((local.mean > Y.min(0)) & (local.mean < Y.max(0)))
    if q[0] == 0:
        assert local.log_w_max[0] < -600
    np.testing.assert_allclose(dut.predict(X[:1], [q]), local.mean, atol=1e-12)


def test_sample_weights_count_like_repetitions():
    X, Y = wavy(100)
    weight = np.random.default_rng(0).integers(0, 3, 100)
    repeated = np.repeat(np.arange(100), weight)
    dut = LWRegressor(feature_scale=None, bandwidth=0.5, n_neighbors=None).fit(X, Y, sample_weight=weight)
    other = LWRegressor(feature_scale=None, bandwidth=0.5, n_neighbors=None).fit(X[repeated], Y[repeated])
    np.testing.assert_allclose(dut.predict(X), other.predict(X), atol=1e-11)
    kept = dut.explain(X[0]).neighbours
    assert np.all(weight[kept] > 0)


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


def test_arrays_restore_an_estimator_that_predicts_the_same_bits(tmp_path):
    X, Y = wavy()
    P = np.random.default_rng(0).dirichlet([0.3] * 3, 400)
    frame = pd.DataFrame(X, columns=["a", "b", "c"])
    dut = LWRegressor(bandwidth=0.4, n_neighbors=30, feature_scale="standard")
    dut.fit(frame, Y, memberships=P, sample_weight=np.linspace(0, 1, 400))
    np.savez(tmp_path / "regressor.npz", **dut.to_arrays())
    with np.load(tmp_path / "regressor.npz", allow_pickle=False) as arrays:
        again = LWRegressor.from_arrays(arrays)
    for Q in (None, P):
        np.testing.assert_array_equal(again.predict(frame, Q), dut.predict(frame, Q))
        np.testing.assert_array_equal(again.predict_local(frame, Q).variance, dut.predict_local(frame, Q).variance)
    one, other = again.explain(X[3], P[3]), dut.explain(X[3], P[3])
    np.testing.assert_array_equal(one.neighbours, other.neighbours)
    np.testing.assert_array_equal(one.prediction, other.prediction)


def test_other_errors_name_the_remedy():
    X, Y = wavy()
    dut = LWRegressor().fit(X, Y)
    with pytest.raises(ValueError, match="at least one"):
        LWRegressor().fit(X, Y, sample_weight=np.zeros(400))
    with pytest.raises(ValueError, match="one row a sample"):
        LWRegressor().fit(X, Y, memberships=np.ones((399, 1)))
    with pytest.raises(ValueError, match="give memberships to fit too"):
        dut.predict(X[:1], [[1.0]])
    with pytest.raises(ValueError, match="one for each feature"):
        LWRegressor(feature_scale=[1.0]).fit(X, Y)
    with pytest.raises(ValueError, match="'prediction' or 'variance_only'"):
        dut.predict_local(X[:1]).interval(kind="other")
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
    st.sampled_from(["fixed", "adaptive"]),
    st.integers(0, 2**32 - 1),
)
def test_duplicates_constant_channels_and_few_samples_stay_finite(n, d, bandwidth, ridge, kind, seed):
    rng = np.random.default_rng(seed)
    X = rng.integers(0, 3, (n, d)).astype(float)  # many duplicates
    X[:, 0] = 1.0
    y = rng.normal(size=n)
    dut = LWRegressor(bandwidth=bandwidth, ridge=ridge, bandwidth_type=kind, n_neighbors=10).fit(X, y)
    queries = rng.normal(size=(5, d))
    local = dut.predict_local(queries)
    lower, upper = local.interval()
    for value in (local.mean, local.standard_deviation(), lower, upper):
        assert np.isfinite(value).all()
    assert np.all(lower <= upper)


@given(st.floats(1e-3, 1e3), st.floats(-100, 100), st.integers(0, 1000))
def test_scaling_features_with_their_bandwidth_and_shifting_outputs_commute_with_the_regression(factor, shift, seed):
    X, Y = wavy(80, 2, seed=seed)
    one = LWRegressor(feature_scale=None, bandwidth=0.5, ridge=0.0, n_neighbors=None).fit(X, Y).predict(X[:5])
    scaled = LWRegressor(feature_scale=None, bandwidth=0.5 * factor, ridge=0.0, n_neighbors=None).fit(
        factor * X, Y + shift
    )
    np.testing.assert_allclose(scaled.predict(factor * X[:5]), one + shift, atol=1e-8)
    order = np.random.default_rng(seed).permutation(80)
    permuted = LWRegressor(feature_scale=None, bandwidth=0.5, ridge=0.0, n_neighbors=None).fit(X[order], Y[order])
    np.testing.assert_allclose(permuted.predict(X[:5]), one, atol=1e-9)


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
