"""The bandwidth that a regressor selects for itself by leaving out samples."""

import numpy as np
import pytest

from skill.regression.leave_one_out import MAX_LEFT_OUT, candidate_bandwidths, searched
from skill.regression.locally_weighted_regression import LWRegressor
from tests.skill.regression.samples import wavy


def default_bandwidths(dut):
    return candidate_bandwidths(dut.X_, dut.numbers())


def linear(n, d, seed, noise=0.0):
    """Standard normal features, and a linear function of them with the same coefficients for every seed."""
    slope = np.random.default_rng(99).normal(size=d)
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(n, d))
    return X, X @ slope + noise * rng.normal(size=n)


def relative_error(model, X, truth):
    return np.sqrt(np.mean((model.predict(X) - truth) ** 2)) / truth.std()


def cross(n, seed):
    """The cross-shaped surface of Schaal and Atkeson, Neural Computation 10, 1998: features (n, 2) and outputs (n,)."""
    X = np.random.default_rng(seed).uniform(-1, 1, (n, 2))
    a, b = X[:, 0] ** 2, X[:, 1] ** 2
    return X, np.maximum.reduce([np.exp(-10 * a), np.exp(-50 * b), 1.25 * np.exp(-5 * (a + b))])


@pytest.mark.slow
def test_the_selected_bandwidth_is_better_than_one_on_a_surface_with_ridges():
    X, truth = cross(500, 0)
    y = truth + 0.1 * np.random.default_rng(1).normal(size=500)
    fresh = cross(500, 2)
    auto, one = (relative_error(LWRegressor(bandwidth=h).fit(X, y), *fresh) for h in ("auto", 1.0))
    assert auto < 0.4 * one


def test_a_linear_function_with_noise_is_predicted_better_than_its_noise():
    dut = LWRegressor().fit(*linear(600, 14, 0, noise=0.2))
    X, truth = linear(500, 14, 1)
    assert relative_error(dut, X, truth) * truth.std() < 0.1


@pytest.mark.parametrize(("K", "n_neighbors"), [(1, 20), (3, None)])
def test_the_selected_bandwidth_has_the_smallest_error_of_refitted_regressors(K, n_neighbors):
    X, Y = wavy(60, 3)
    rng = np.random.default_rng(0)
    P, weight = rng.dirichlet(np.ones(K), 60), rng.uniform(0.1, 1.0, 60) if K > 1 else np.ones(60)
    dut = LWRegressor(feature_scale=None, n_neighbors=n_neighbors).fit(X, Y, P, weight)
    candidates, errors = default_bandwidths(dut), []
    for bandwidth in candidates:
        model, left_out = LWRegressor(bandwidth, feature_scale=None, n_neighbors=n_neighbors), []
        for i, kept in enumerate(~np.eye(60, dtype=bool)):
            model.fit(X[kept], Y[kept], P[kept], weight[kept])
            left_out.append(model.predict(X[i : i + 1], P[i : i + 1])[0])
        errors.append((np.average((left_out - Y) ** 2, axis=0, weights=weight) / Y.var(axis=0)).mean())
    assert dut.bandwidth_ == candidates[np.argmin(errors)]


@pytest.mark.filterwarnings("error")
def test_a_sample_alone_in_its_state_does_not_disturb_the_selection():
    X, y = linear(50, 2, 0)
    states = np.tile([1.0, 0.0], (50, 1))
    everyone = LWRegressor().fit(X, y, states).bandwidth_
    states[7] = [0.0, 1.0]
    assert LWRegressor().fit(X, y, states).bandwidth_ == everyone


def test_many_samples_are_left_out_evenly():
    """The first samples alone are constant; a selection by them would take the widest bandwidth."""
    n = 4 * MAX_LEFT_OUT
    X = np.linspace(0.0, 1.0, n)[:, None]
    Y = np.where(X[:, 0] < 0.3, 0.0, np.sin(60.0 * X[:, 0]))
    dut = LWRegressor(n_neighbors=None).fit(X, Y)
    assert dut.bandwidth_ < 0.25 * default_bandwidths(dut)[-1]


@pytest.mark.parametrize(
    ("X", "Y", "bandwidth"),
    [
        ([[0.5]], [3.0], 1.0),
        ([[0.0], [1.0], [2.0]], [3.0, 3.0, 3.0], 1.0),
        ([[0.5]] * 5, [1.0, 2.0, 3.0, 4.0, 5.0], 4.0),
    ],
    ids=["one sample", "equal outputs", "equal samples"],
)
def test_samples_that_do_not_tell_bandwidths_apart_select_a_wide_one(X, Y, bandwidth):
    dut = LWRegressor().fit(X, Y)
    assert dut.bandwidth_ == pytest.approx(bandwidth)
    np.testing.assert_allclose(dut.predict([[0.5]]), np.mean(Y))


def test_a_given_bandwidth_is_used_as_it_is_and_may_be_changed_after_the_fit():
    X, Y = wavy(50)
    dut = LWRegressor().fit(X, Y)
    selected = dut.bandwidth_
    dut.set_params(bandwidth=0.25)
    assert dut.bandwidth_ == 0.25
    np.testing.assert_array_equal(dut.predict(X), LWRegressor(bandwidth=0.25).fit(X, Y).predict(X))
    assert dut.set_params(bandwidth="auto").bandwidth_ == selected


def test_the_selected_bandwidth_is_stored():
    X, Y = wavy(50)
    dut = LWRegressor().fit(X, Y)
    again = LWRegressor.from_arrays(dut.to_arrays())
    assert again.bandwidth == again.bandwidth_ == dut.bandwidth_
    np.testing.assert_array_equal(again.predict(X), dut.predict(X))


def test_the_best_bandwidth_may_lie_beyond_the_candidates():
    """150 samples of two periods have neighbourhoods as wide as the data: the best bandwidth is far below."""
    rng = np.random.default_rng(0)
    X = rng.uniform(0.0, 10.0, (150, 1))
    y = np.sin(X[:, 0]) + 0.05 * rng.normal(size=150)
    dut = LWRegressor().fit(X, y)
    assert dut.bandwidth_ < 0.5 * default_bandwidths(dut)[0]


@pytest.mark.parametrize(("n", "step", "k"), [(40, 1, 5), (330, 3, 5), (40, 1, None)])
def test_candidates_are_multiples_of_the_median_radius(n, step, k):
    X = np.random.default_rng(0).normal(size=(n, 3))
    radii = [np.sort(np.linalg.norm(X - q, axis=1))[(n if k is None else k) - 1] for q in X[::step]]
    dut = LWRegressor(1.0, feature_scale=None, n_neighbors=k).fit(X, X[:, 0])
    np.testing.assert_allclose(
        default_bandwidths(dut), np.median(radii) * 2.0 ** np.linspace(-3.0, 2.0, 12), rtol=1e-12
    )


def test_candidates_go_on_in_both_directions_and_end():
    candidates = np.geomspace(1.0, 32.0, 6)
    for best in (1e-3, 0.2, 5.0, 300.0):
        found, errors = searched(candidates, lambda h, best=best: np.abs(np.log(h / best)))
        np.testing.assert_allclose(np.diff(np.log(found)), np.log(2.0))
        np.testing.assert_allclose(errors, np.abs(np.log(found / best)))
        assert np.abs(np.log(found[errors.argmin()] / best)) <= 0.5 * np.log(2.0) + 1e-12
    assert searched(candidates, lambda h: 1.0 / h)[0].max() == 32.0 * 2.0**24
