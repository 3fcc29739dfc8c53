import numpy as np
import pytest

from skill.regression.bandwidth_selection import default_bandwidths, select_bandwidth, select_feature_scale
from skill.regression.locally_weighted_regression import LWRegressor


def demonstrations(n_groups=12, length=60, seed=0):
    """Smooth trajectories, each with an offset of its own: near twins within a group, not between groups."""
    rng = np.random.default_rng(seed)
    groups = np.repeat(np.arange(n_groups), length)
    t = np.tile(np.linspace(0, 1, length), n_groups)
    own = rng.normal(size=(n_groups, 3))[groups]
    X = np.column_stack([t, 0.3 * own[:, 0] + 0.1 * t, own[:, 1]])
    y = np.column_stack([np.sin(4 * t) + 0.5 * X[:, 1], 1e-3 * np.cos(3 * t)])
    y[:, 0] += 0.3 * own[:, 2]  # what no feature shows
    return X, y + rng.normal(size=y.shape) * [0.05, 5e-5], groups


def test_left_out_groups_ask_for_a_wider_bandwidth_than_left_out_samples():
    X, y, groups = demonstrations()
    chosen = select_bandwidth(LWRegressor(), X, y, groups)
    single = select_bandwidth(LWRegressor(), X, y, np.arange(len(X)), n_splits=10)
    assert chosen.bandwidth > single.bandwidth
    assert chosen.errors.min() == chosen.errors[chosen.bandwidths == chosen.bandwidth][0]


def test_the_choice_is_near_the_best_on_fresh_groups():
    X, y, groups = demonstrations()
    fresh, truth, _ = demonstrations(seed=1)
    chosen = select_bandwidth(LWRegressor(), X, y, groups)
    errors = {}
    for h in chosen.bandwidths:
        out = LWRegressor(bandwidth=h).fit(X, y).predict(fresh)
        errors[h] = (((out - truth) ** 2).mean(0) / truth.var(0)).mean()
    assert errors[chosen.bandwidth] <= 1.2 * min(errors.values())


def test_the_one_standard_error_rule_never_chooses_a_narrower_one():
    X, y, groups = demonstrations()
    least = select_bandwidth(LWRegressor(), X, y, groups)
    smooth = select_bandwidth(LWRegressor(), X, y, groups, rule="one_standard_error")
    assert smooth.bandwidth >= least.bandwidth
    np.testing.assert_array_equal(smooth.errors, least.errors)


def test_units_of_the_outputs_do_not_matter():
    X, y, groups = demonstrations()
    one = select_bandwidth(LWRegressor(), X, y, groups)
    other = select_bandwidth(LWRegressor(), X, y * [1.0, 1e6], groups)
    np.testing.assert_allclose(one.errors, other.errors, rtol=1e-9)


def test_the_regressor_passed_in_is_left_alone_and_its_settings_are_used():
    X, y, groups = demonstrations()
    dut = LWRegressor(bandwidth=123.0, degree=0)
    chosen = select_bandwidth(dut, X, y[:, 0], groups, bandwidths=[0.3, 0.1])
    assert dut.bandwidth == 123.0
    assert not hasattr(dut, "X_")
    np.testing.assert_array_equal(chosen.bandwidths, [0.1, 0.3])
    linear = select_bandwidth(LWRegressor(), X, y[:, 0], groups, bandwidths=[0.3, 0.1])
    assert not np.allclose(linear.errors, chosen.errors)


def test_memberships_and_weights_take_part():
    X, y, groups = demonstrations()
    P = np.random.default_rng(0).dirichlet([0.2] * 3, len(X))
    weight = np.random.default_rng(1).uniform(0, 1, len(X))
    options = {"bandwidths": [0.2, 0.5]}
    plain = select_bandwidth(LWRegressor(), X, y, groups, **options)
    for extra in ({"memberships": P}, {"sample_weight": weight}):
        other = select_bandwidth(LWRegressor(), X, y, groups, **options, **extra)
        assert np.isfinite(other.errors).all()
        assert not np.allclose(plain.errors, other.errors)


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
    fresh = rng.uniform(-1, 1, (300, 3))
    before = dut.fit(X, y).predict(fresh) - np.sin(4 * fresh[:, 0])
    dut.set_params(feature_scale=chosen.feature_scale)
    after = dut.fit(X, y).predict(fresh) - np.sin(4 * fresh[:, 0])
    assert np.std(after) < np.std(before)


def test_default_candidates_scale_with_the_features():
    X, y, _ = demonstrations()
    one = default_bandwidths(LWRegressor().fit(X, y))
    np.testing.assert_allclose(default_bandwidths(LWRegressor().fit(10 * X, y)), 10 * one)
    assert (default_bandwidths(LWRegressor().fit(np.zeros((5, 2)), np.arange(5.0))) > 0).all()


@pytest.mark.parametrize(
    ("change", "remedy"),
    [
        ({"groups": np.zeros(720)}, "record more demonstrations"),
        ({"groups": np.zeros(3)}, "expected \\(n, d\\)"),
        ({"bandwidths": [0.0, 1.0]}, "positive"),
        ({"bandwidths": []}, "positive"),
        ({"rule": "other"}, "'minimum' or"),
        ({"n_splits": 1}, "at least"),
    ],
)
def test_bad_arguments_raise(change, remedy):
    X, y, groups = demonstrations()
    with pytest.raises(ValueError, match=remedy):
        select_bandwidth(LWRegressor(), X, y, **({"groups": groups} | change))
