import numpy as np
import pytest
from sklearn.base import BaseEstimator
from sklearn.model_selection import GroupKFold

from skill.regression.bandwidth_selection import (
    GroupedSamples,
    default_bandwidths,
    select_bandwidth,
    select_feature_scale,
)
from skill.regression.locally_weighted_regression import LWRegressor


def demonstrations(n_groups=12, length=60, seed=0):
    """Smooth trajectories, each with an offset of its own: similar samples within a group, not between groups."""
    rng = np.random.default_rng(seed)
    groups = np.repeat(np.arange(n_groups), length)
    t = np.tile(np.linspace(0, 1, length), n_groups)
    own = rng.normal(size=(n_groups, 3))[groups]
    X = np.column_stack([t, 0.3 * own[:, 0] + 0.1 * t, own[:, 1]])
    y = np.column_stack([np.sin(4 * t) + 0.5 * X[:, 1], 1e-3 * np.cos(3 * t)])
    y[:, 0] += 0.3 * own[:, 2]  # not visible in any feature
    return X, y + rng.normal(size=y.shape) * [0.05, 5e-5], groups


def test_left_out_groups_select_a_wider_bandwidth_than_left_out_samples():
    X, y, groups = demonstrations()
    chosen = select_bandwidth(LWRegressor(), X, y, groups)
    single = select_bandwidth(LWRegressor(), X, y, np.arange(len(X)))
    assert chosen.bandwidth > single.bandwidth
    assert chosen.errors.min() == chosen.errors[chosen.bandwidths == chosen.bandwidth][0]


def test_the_given_regressor_is_not_changed_and_its_parameters_are_used():
    X, y, groups = demonstrations()
    dut = LWRegressor(bandwidth=123.0, degree=0)
    chosen = select_bandwidth(dut, X, y[:, 0], groups)
    assert dut.bandwidth == 123.0
    assert not hasattr(dut, "X_")
    linear = select_bandwidth(LWRegressor(), X, y[:, 0], groups)
    assert not np.allclose(linear.errors, chosen.errors)


def test_memberships_change_the_error():
    X, y, groups = demonstrations(n_groups=6, length=20)
    P = np.random.default_rng(0).dirichlet([0.2] * 3, len(X))
    plain = select_feature_scale(LWRegressor(bandwidth=1.0), X, y, groups)
    other = select_feature_scale(LWRegressor(bandwidth=1.0), X, y, groups, memberships=P)
    assert np.isfinite(other.initial_error)
    assert other.initial_error != pytest.approx(plain.initial_error)


def test_the_feature_scale_shrinks_a_useless_feature():
    rng = np.random.default_rng(0)
    X = rng.uniform(-1, 1, (600, 3))
    y = np.sin(4 * X[:, 0]) + 0.05 * rng.normal(size=600)
    groups = np.repeat(np.arange(20), 30)
    dut = LWRegressor(bandwidth=0.5)
    chosen = select_feature_scale(dut, X, y, groups, max_queries=300)
    assert chosen.error < 0.8 * chosen.initial_error
    assert chosen.feature_scale[0] >= 1.0
    assert np.all(chosen.feature_scale[1:] < chosen.feature_scale[0])


@pytest.mark.parametrize(
    ("groups", "remedy"), [(np.zeros(720), "record more demonstrations"), (np.zeros(3), "expected \\(n, d\\)")]
)
def test_bad_groups_raise(groups, remedy):
    X, y, _ = demonstrations()
    with pytest.raises(ValueError, match=remedy):
        select_bandwidth(LWRegressor(), X, y, groups)


def test_the_errors_are_normalised_mean_squares_over_the_folds():
    X, y, groups = demonstrations(n_groups=7, length=20)
    y = np.column_stack([y, np.full(len(y), 3.0)])  # an output that does not vary is ignored
    found = select_bandwidth(LWRegressor(feature_scale=None), X, y, groups)
    errors = np.empty((5, len(found.bandwidths)))
    for i, (train, test) in enumerate(GroupKFold(5).split(X, groups=groups)):
        for j, h in enumerate(found.bandwidths):
            model = LWRegressor(feature_scale=None, bandwidth=h).fit(X[train], y[train])
            squares = (model.predict(X[test]) - y[test])[:, :2] ** 2
            errors[i, j] = (squares.mean(axis=0) / y[:, :2].var(axis=0)).mean()
    np.testing.assert_allclose(found.errors, errors.mean(axis=0), rtol=1e-12)
    assert found.bandwidth == found.bandwidths[found.errors.argmin()]


def test_outputs_that_do_not_vary_have_no_error():
    X, _, groups = demonstrations(n_groups=3, length=10)
    np.testing.assert_array_equal(select_bandwidth(LWRegressor(), X, np.ones(len(X)), groups).errors, 0.0)


@pytest.mark.parametrize(("n", "step", "k"), [(40, 1, 5), (330, 3, 5), (40, 1, None)])
def test_default_candidates_are_multiples_of_the_median_radius(n, step, k):
    X = np.random.default_rng(0).normal(size=(n, 3))
    radii = [np.sort(np.linalg.norm(X - q, axis=1))[(n if k is None else k) - 1] for q in X[::step]]
    expected = np.median(radii) * 2.0 ** np.linspace(-3.0, 2.0, 12)
    fitted = LWRegressor(feature_scale=None, n_neighbors=k).fit(X, X[:, 0])
    np.testing.assert_allclose(default_bandwidths(fitted), expected, rtol=1e-12)
    adaptive = LWRegressor(feature_scale=None, n_neighbors=k, bandwidth_type="adaptive").fit(X, X[:, 0])
    np.testing.assert_allclose(default_bandwidths(adaptive), 2.0 ** np.linspace(-3.0, 2.0, 12))


def test_equal_samples_have_candidates_around_one():
    np.testing.assert_allclose(
        default_bandwidths(LWRegressor().fit(np.zeros((5, 2)), np.arange(5.0))), 2.0 ** np.linspace(-3.0, 2.0, 12)
    )


class KnownError(BaseEstimator):
    """A regressor whose normalised error on y = X[:, 0] is a given function of its feature scale."""

    def __init__(self, error=None, feature_scale=None):
        self.error = error
        self.feature_scale = feature_scale

    def __sklearn_clone__(self):
        return KnownError(self.error, self.feature_scale)

    def fit(self, X, y, memberships=None, sample_weight=None):
        self.feature_scale_ = np.ones(X.shape[1]) if self.feature_scale is None else np.asarray(self.feature_scale)
        return self

    def predict(self, X, memberships=None):
        return X[:, 0] + np.sqrt(self.error(self.feature_scale_))


def descend(error, n_features=1):
    X = np.tile([[1.0], [-1.0]], (20, n_features))  # outputs of variance 1
    return select_feature_scale(KnownError(error), X, X[:, 0], np.repeat(np.arange(5), 8))


@pytest.mark.parametrize(
    ("best", "evaluations"),
    [
        (8.0, 1 + 3 + 2),  # 2, 4, 8, then neither 16 nor 4
        (0.25, 1 + 2 + 2 + 2 + 2),  # the last pass tries the square root of two
        (np.sqrt(2.0), 1 + 2 + 1 + 2),  # neither 2 nor 1/2; then the root does; then neither neighbour
    ],
)
def test_the_scale_of_a_feature_is_changed_while_that_lowers_the_error(best, evaluations):
    found = descend(lambda scale: 0.1 + np.log2(scale[0] / best) ** 2)
    np.testing.assert_allclose(found.feature_scale, [best])
    assert found.evaluations == evaluations
    assert found.error == pytest.approx(0.1)
    assert found.initial_error == pytest.approx(0.1 + np.log2(best) ** 2)


def test_passes_end_at_their_maximum_and_visit_every_feature():
    found = descend(lambda scale: 1.0 / scale[0] + 1.0 / scale[1], n_features=2)
    np.testing.assert_array_equal(found.feature_scale, [16.0, 16.0])
    assert found.evaluations == 1 + 4 * 2


@pytest.mark.parametrize(("gain", "changed"), [(0.99e-3, False), (1.01e-3, True)])
def test_a_change_needs_a_minimum_gain(gain, changed):
    found = descend(lambda scale: 1.0 if scale[0] == 1.0 else 1.0 - gain)
    assert (found.feature_scale[0] != 1.0) == changed


def test_queries_are_drawn_and_training_samples_are_kept():
    X, y, groups = demonstrations(n_groups=6, length=20)
    data = GroupedSamples.checked(X, y, groups, None)
    thinned = data.thinned(10, 4)
    chosen = np.random.default_rng(4).choice(len(X), 10, replace=False)
    assert {int(row) for _, test in thinned.folds for row in test} == set(chosen.tolist())
    for train, test in thinned.folds:
        original = next(fold for fold in data.folds if np.array_equal(fold[0], train))
        assert set(test) <= set(original[1])
    model = LWRegressor(feature_scale=None, bandwidth=1.0).fit(X, y)
    few = select_feature_scale(model, X, y, groups, max_queries=10, random_state=4)
    assert few.initial_error == pytest.approx(
        np.mean([thinned.error(thinned.fit(model, train), test) for train, test in thinned.folds])
    )
    every = select_feature_scale(model, X, y, groups)
    at_most = select_feature_scale(model, X, y, groups, max_queries=len(X))
    assert every.error == at_most.error != few.error


def test_two_groups_are_enough_and_the_folds_are_at_most_the_groups():
    X, y, groups = demonstrations(n_groups=2, length=10)
    assert len(GroupedSamples.checked(X, y, groups, None).folds) == 2
