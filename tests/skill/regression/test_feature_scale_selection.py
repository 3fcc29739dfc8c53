import numpy as np
import pytest
from sklearn.base import BaseEstimator
from sklearn.model_selection import GroupKFold

from skill.regression import feature_scale_selection
from skill.regression.feature_scale_selection import select_feature_scale, tuned_regressor
from skill.regression.locally_weighted_regression import LWRegressor
from tests.skill.regression.samples import wavy


@pytest.mark.parametrize("queries", [120, 40])
def test_the_errors_are_normalised_mean_squares_over_the_folds(monkeypatch, queries):
    monkeypatch.setattr(feature_scale_selection, "MAX_QUERIES", queries)
    X, Y = wavy(120)
    Y = np.column_stack([Y, np.full(120, 3.0)])  # an output that does not vary has no error
    groups, P = np.arange(120) // 10, np.random.default_rng(0).dirichlet([0.2] * 3, 120)
    found = select_feature_scale(LWRegressor(bandwidth=1.0), X, Y, groups, memberships=P, random_state=4)
    chosen = np.random.default_rng(4).choice(120, queries, replace=False)

    def error(scale):
        errors = []
        for train, test in GroupKFold(5).split(X, groups=groups):
            left_out = np.intersect1d(test, chosen)
            model = LWRegressor(bandwidth=1.0, feature_scale=scale).fit(X[train], Y[train], P[train])
            squares = (model.predict(X[left_out], P[left_out]) - Y[left_out])[:, :2] ** 2
            errors.append((squares.mean(axis=0) / Y[:, :2].var(axis=0)).sum() / 3)
        return np.mean(errors)

    assert found.initial_error == pytest.approx(error(1.0 / X.std(axis=0)), rel=1e-12)
    assert found.error == pytest.approx(error(found.feature_scale), rel=1e-12)


def test_the_tuned_regressor_shrinks_a_useless_feature():
    rng = np.random.default_rng(0)
    X = rng.uniform(-1, 1, (600, 3))
    Y = np.sin(4 * X[:, :1]) + 0.05 * rng.normal(size=(600, 1))
    groups = np.repeat(np.arange(20), 30)
    dut = tuned_regressor(X, Y, groups, memberships=np.ones((600, 1)), random_state=0)
    assert (dut.bandwidth, dut.ridge) == (1.0, 1.0)
    assert dut.feature_scale[0] >= 1.0
    assert np.all(dut.feature_scale[1:] < dut.feature_scale[0])
    few = tuned_regressor(X, Y, groups % 4, memberships=np.ones((600, 1)), random_state=0)
    assert few.feature_scale == "standard"


class KnownError(BaseEstimator):
    """A regressor whose normalised error on y = X[:, 0] is a given function of its feature scale."""

    def __init__(self, error=None, feature_scale=None):
        self.error = error
        self.feature_scale = feature_scale

    def __sklearn_clone__(self):
        return KnownError(self.error, self.feature_scale)

    def fit(self, X, y, memberships):
        self.feature_scale_ = np.ones(X.shape[1]) if self.feature_scale is None else np.asarray(self.feature_scale)
        return self

    def predict(self, X, memberships):
        return X[:, :1] + np.sqrt(self.error(self.feature_scale_))


def descend(error, n_features=1):
    X = np.tile([[1.0], [-1.0]], (20, n_features))  # outputs of variance 1
    groups = np.repeat(np.arange(5), 8)
    return select_feature_scale(KnownError(error), X, X[:, :1], groups, memberships=np.ones((40, 1)))


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
def test_a_scale_is_changed_for_a_gain_of_a_thousandth(gain, changed):
    found = descend(lambda scale: 1.0 - gain * (scale[0] == 2.0))
    assert (found.feature_scale[0] == 2.0) == changed
