import numpy as np
import pytest
from sklearn.linear_model import LinearRegression

from skill.manipulation_skill import ManipulationSkill
from skill.practice import policy_update
from skill.practice.exploration import Rollout
from skill.practice.policy_update import advantage_weighted_update, advantages
from skill.regression.locally_weighted_regression import LWRegressor

DOUBLE, HALF = np.log([2.0, 1.0]), np.log([0.5, 1.0])  # factors on the turn; that on the feed is 1


def make_skill(x=0.0, action=(0.3, -0.1, -1.0), n=4, feature_scale=None):
    """Returns a skill with one state and n samples of the same feature and action; its regressor is a kernel mean."""
    skill = ManipulationSkill()
    skill.regressor_ = LWRegressor(bandwidth=1.0, degree=0, n_neighbors=None, feature_scale=feature_scale).fit(
        np.full((n, 1), x), np.tile(action, (n, 1)), memberships=np.ones((n, 1))
    )
    skill.metadata_ = {"good": 1}
    return skill


def make_rollout(*, log_factors, cost, x=0.0, n=2):
    """Returns a rollout whose whole cost is at the end, so that every row has the same cost to go."""
    return Rollout(
        features=np.full((n, 1), x),
        memberships=np.ones((n, 1)),
        log_factors=np.tile(log_factors, (n, 1)),
        costs=np.append(np.zeros(n - 1), cost),
    )


def action_of(skill, x=0.0):
    return skill.regressor_.predict([[x]], memberships=np.ones((1, 1)))[0]


def test_a_turn_about_the_axis_is_not_practised():
    rollouts = [make_rollout(log_factors=DOUBLE, cost=1.0), make_rollout(log_factors=HALF, cost=3.0)]
    turning = make_skill(action=(0.3, -0.1, -1.0, 0.2))
    found = action_of(advantage_weighted_update(turning, rollouts))
    np.testing.assert_allclose(found[:3], action_of(advantage_weighted_update(make_skill(), rollouts)), rtol=1e-9)
    assert found[3] == pytest.approx(0.2)


def test_the_advantage_is_the_saved_cost_over_its_standard_deviation():
    z = advantages(
        [make_rollout(log_factors=DOUBLE, cost=1.0), make_rollout(log_factors=HALF, cost=3.0)], make_skill().regressor_
    )
    # Costs 1, 1, 3, 3: mean 2, variance 4 / 3 (one parameter fitted), and a quarter more for a new observation.
    expected = 1.0 / np.sqrt(4 / 3 * 1.25)
    np.testing.assert_allclose(z, [expected, expected, -expected, -expected], rtol=1e-6)


def test_equal_costs_give_no_advantage_and_no_correction():
    rollouts = [make_rollout(log_factors=t, cost=2.0) for t in (DOUBLE, HALF, HALF)]
    np.testing.assert_allclose(advantages(rollouts, make_skill().regressor_), 0.0, atol=1e-9)
    np.testing.assert_allclose(
        action_of(advantage_weighted_update(make_skill(), rollouts)),
        action_of(make_skill()),
        rtol=1e-6,
    )


def test_the_correction_is_the_weighted_minus_the_unweighted_mean_of_the_log_factors():
    rollouts = [make_rollout(log_factors=DOUBLE, cost=1.0), make_rollout(log_factors=HALF, cost=3.0)]
    z = 1.0 / np.sqrt(4 / 3 * 1.25)
    share = np.exp(z) / (np.exp(z) + np.exp(-z))  # normalised weight of the cheaper rollout
    factor = np.exp((share - (1 - share)) * np.log(2.0))
    before, after = (
        action_of(make_skill()),
        action_of(advantage_weighted_update(make_skill(), rollouts)),
    )
    np.testing.assert_allclose(after, before * [factor, factor, 1.0], rtol=1e-6)
    assert factor > 1.2


def test_costs_that_hardly_vary_give_a_small_advantage():
    """The standard deviation of the costs, about 1e-5 s, is below its lower bound of 1e-3 s."""
    rollouts = [make_rollout(log_factors=DOUBLE, cost=2.0), make_rollout(log_factors=HALF, cost=2.00002)]
    z = advantages(rollouts, make_skill().regressor_)
    np.testing.assert_allclose(z, [0.01, 0.01, -0.01, -0.01], rtol=1e-6)


@pytest.mark.parametrize("largest", [2.0, 0.3])
def test_the_weights_are_the_exponential_of_the_clipped_advantage(monkeypatch, largest):
    monkeypatch.setattr(policy_update, "LARGEST_ADVANTAGE", largest)
    z = min(1.0 / np.sqrt(4 / 3 * 1.25), largest)
    rollouts = [make_rollout(log_factors=[0.6, -0.2], cost=1.0), make_rollout(log_factors=[-0.6, 0.2], cost=3.0)]
    updated = advantage_weighted_update(make_skill(), rollouts)
    change = np.tanh(z)  # share of the cheaper rollout minus that of the other
    factor = np.exp([0.6 * change, 0.6 * change, -0.2 * change])
    np.testing.assert_allclose(action_of(updated), action_of(make_skill()) * factor, rtol=1e-6)


def test_the_correction_is_a_kernel_mean_of_all_rows_with_the_wider_bandwidth():
    """Two rows at 0 and two at 1; at 0, those at 1 have the kernel exp(-1 / 2^2)."""
    rollouts = [
        make_rollout(log_factors=np.log([f, 1.0]), cost=cost, x=x, n=1)
        for x, f, cost in ((0.0, 1.2, 1.0), (0.0, 1.0, 3.0), (1.0, 2.0, 1.0), (1.0, 3.0, 3.0))
    ]
    skill = make_skill()
    updated = advantage_weighted_update(skill, rollouts)
    w = np.exp(advantages(rollouts, skill.regressor_))
    assert 0.3 < np.log(w).max() < 2.0
    kernel = np.exp(-np.array([0.0, 0.0, 1.0, 1.0]) / 4.0)
    logs = np.log([1.2, 1.0, 2.0, 3.0])
    change = np.average(logs, weights=kernel * w) - np.average(logs, weights=kernel)
    assert abs(change) > 0.01
    np.testing.assert_allclose(action_of(updated)[:2] / action_of(skill)[:2], np.exp(change), rtol=1e-9)
    assert action_of(updated)[2] == pytest.approx(action_of(skill)[2])


def test_the_number_of_rows_of_a_trial_does_not_decide_the_correction():
    """The unweighted mean, which is subtracted, contains the 90 high-cost rows as well as the 10 low-cost rows."""
    rollouts = [make_rollout(log_factors=DOUBLE, cost=1.0, n=10), make_rollout(log_factors=HALF, cost=3.0, n=90)]
    assert action_of(advantage_weighted_update(make_skill(), rollouts))[0] > action_of(make_skill())[0]


def test_actions_far_from_costs_that_vary_are_not_corrected():
    """The factors change the cost at one place and not at the other."""
    near = [make_rollout(log_factors=DOUBLE, cost=1.0), make_rollout(log_factors=HALF, cost=3.0)]
    far = [make_rollout(log_factors=t, cost=2.0, x=100.0) for t in (DOUBLE, HALF)]
    updated = advantage_weighted_update(make_skill(x=100.0), near + far)
    np.testing.assert_allclose(action_of(updated, 100.0), action_of(make_skill(x=100.0), 100.0), rtol=1e-6)


def test_the_update_returns_a_new_skill_that_counts_its_practice_trials():
    skill = make_skill()
    before = skill.regressor_.y_.copy()
    once = advantage_weighted_update(skill, [make_rollout(log_factors=DOUBLE, cost=c) for c in (1.0, 2.0)])
    twice = advantage_weighted_update(once, [make_rollout(log_factors=HALF, cost=1.0)])
    assert skill.metadata_ == {"good": 1}
    np.testing.assert_array_equal(skill.regressor_.y_, before)
    assert (once.metadata_["practice_trials"], twice.metadata_["practice_trials"]) == (2, 3)


def test_an_updated_skill_acts_the_same_after_saving_and_loading(skill, tmp_path):
    measured = np.array([5.0, 3.0, 2.0, 0.01, 0.02, 0.0, -0.008])
    features, P = skill.features_.transform(measured[None])[0], skill.state_probabilities(measured[None])
    faster = np.log([1.0, 1.5])
    rollouts = [
        Rollout(np.tile(features, (9, 1)), np.tile(P, (9, 1)), np.tile(t, (9, 1)), np.append(np.zeros(8), cost))
        for t, cost in ((faster, 1.0), (-faster, 2.0))
    ]
    updated = advantage_weighted_update(skill, rollouts)
    updated.save(tmp_path / "practised.npz")
    loaded = ManipulationSkill.load(tmp_path / "practised.npz")
    assert loaded.act(measured).feed == updated.act(measured).feed
    assert loaded.act(measured).feed < skill.act(measured).feed < 0
    np.testing.assert_allclose(loaded.act(measured).turn, skill.act(measured).turn)


def test_an_update_without_rollouts_or_without_a_suitable_regressor_is_an_error():
    with pytest.raises(ValueError, match="at least one practice trial"):
        advantage_weighted_update(make_skill(), [])
    skill = make_skill()
    skill.regressor_ = LinearRegression()
    with pytest.raises(ValueError, match="LinearRegression"):
        advantage_weighted_update(skill, [make_rollout(log_factors=HALF, cost=1.0)])


def test_the_correction_of_an_action_is_that_at_its_own_features():
    """The regressor stores scaled features; the rollouts hold unscaled ones."""
    skill = make_skill(x=3.0, feature_scale=[2.0])
    near = [make_rollout(log_factors=DOUBLE, cost=1.0, x=3.0), make_rollout(log_factors=HALF, cost=3.0, x=3.0)]
    far = [make_rollout(log_factors=f, cost=2.0, x=x) for f in (DOUBLE, HALF) for x in (6.0, 12.0)]
    updated = advantage_weighted_update(skill, near + far)
    assert action_of(updated, 3.0)[0] > 1.2 * action_of(skill, 3.0)[0]
