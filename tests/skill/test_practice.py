from types import SimpleNamespace

import numpy as np
import pytest
from sklearn.linear_model import LinearRegression

from skill import practice
from skill.data.rig_run import RigRun
from skill.manipulation_skill import ManipulationSkill
from skill.policy.rig_policy import Action
from skill.practice import (
    Perturbation,
    PerturbedPolicy,
    Rollout,
    advantage_weighted_update,
    advantages,
    draw_perturbation,
    interpolated,
    rollout_of,
    step_costs,
)
from skill.regression.locally_weighted_regression import LWRegressor
from skill.states.estimate import Estimate
from tests.trajectories import GEOMETRY, make_rig_run

PERTURBATION = Perturbation(np.array([0.0, 0.01]), np.log([1.0, 4.0]), np.log([1.0, 0.25]))


def run_of(samples, **result):
    return RigRun(samples, {"seed": 7, "inserted": True, **result}, {"geometry": GEOMETRY})


@pytest.mark.parametrize(
    ("depth", "turn", "feed"), [(-0.002, 1, 1), (0.0, 1, 1), (0.005, 2, 0.5), (0.01, 4, 0.25), (0.02, 4, 0.25)]
)
def test_log_factors_are_linear_between_knots_and_constant_beyond(depth, turn, feed):
    np.testing.assert_allclose(np.exp(PERTURBATION.log_factors(depth)), [turn, feed])
    np.testing.assert_allclose(np.exp(PERTURBATION.opposite().log_factors(depth)), [1 / turn, 1 / feed])


def test_log_factors_are_drawn_within_their_limits_with_mean_zero():
    rng = np.random.default_rng(0)
    drawn = [draw_perturbation(rng, 0.0247) for _ in range(2000)]
    for part, limit in (("turn", 2.5), ("feed", 1.5)):
        logs = np.array([getattr(v, part) for v in drawn])
        assert np.abs(logs).max() <= np.log(limit)
        assert np.abs(logs).max() > 0.99 * np.log(limit)
        assert abs(logs.mean()) < 4 * np.log(limit) / np.sqrt(3 * logs.size)


class FixedPolicy:
    """A minimal policy that is not a skill; its action has little support."""

    period_ = 0.02
    metadata_ = {"geometry": GEOMETRY}

    def state_names(self):
        return ["free", "contact"]

    def estimator(self):
        return "estimator"

    def act(self, measured, estimate=None):
        return Action(turn=np.array([0.1, -0.2]), feed=-1e-3, support=0.3)


def test_factors_are_interpolated_as_by_numpy():
    places, values = np.array([0.0, 0.3, 0.7, 1.0]), np.array([1.0, -2.0, 0.5, 4.0])
    x = np.array([-1.0, *places, *np.linspace(0.01, 0.99, 40), 2.0])
    np.testing.assert_array_equal([interpolated(value, places, values) for value in x], np.interp(x, places, values))


def test_a_perturbed_policy_multiplies_the_action_by_the_factors_at_the_depth_that_is_measured_last():
    policy = PerturbedPolicy(FixedPolicy(), PERTURBATION)
    action = policy.act(np.array([5.0, 3.0, 2.0, 0.01, 0.02, 0.03, -0.005]), None)
    np.testing.assert_allclose(action.turn, [0.2, -0.4])
    assert action.feed == pytest.approx(-5e-4)
    assert action.support == 0.3
    assert (policy.period_, policy.metadata_) == (0.02, {"geometry": GEOMETRY})
    assert (policy.state_names(), policy.estimator()) == (["free", "contact"], "estimator")


@pytest.mark.parametrize(("full_depth", "knots"), [(0.001, 2), (0.004, 2), (0.012, 3), (0.024, 6)])
def test_knots_are_about_the_spacing_apart(full_depth, knots):
    drawn = draw_perturbation(np.random.default_rng(0), full_depth)
    np.testing.assert_allclose(drawn.depths, np.linspace(0.0, full_depth, knots))
    assert drawn.turn.shape == drawn.feed.shape == (knots,)


def short_run():
    """Five rows, one second apart, of which the third and the last hold a back-off."""
    samples = make_rig_run().samples.head(5).assign(
        time=[1.0, 2.0, 3.0, 4.0, 6.0],
        fx=[0.0, 15.0, 0.0, 30.0, 90.0],
        fy=[0.0, 20.0, 0.0, 40.0, 90.0],
        depth=[0.0, 0.005, 0.005, 0.010, 0.030],
        back_off=[0.0, 0.0, 1.0, 0.0, 1.0],
    )  # fmt: skip
    return run_of(samples)


@pytest.mark.parametrize(("depth", "failure"), [(0.030, 5.0), (0.010, 8.0), (-0.003, 10.0)])
def test_the_cost_of_a_step_is_that_of_the_force_at_its_start(depth, failure):
    """The forces are 0, 25, 0 and 50 N, the last step takes 2 s, and the force in the last row has no step.

    A failure costs 5 s, and 5 s times the share of the 25 mm that is missing at the end.
    """
    np.testing.assert_allclose(step_costs(short_run()), [1.0, 2.0, 1.0, 10.0, 0.0])
    samples = short_run().samples
    samples.loc[samples.index[-1], "depth"] = depth
    np.testing.assert_allclose(step_costs(run_of(samples, inserted=False)), [1.0, 2.0, 1.0, 10.0, failure])


class CountingSkill(FixedPolicy):
    """A skill with one state, whose estimator counts the measurements; its features are twice the measurements."""

    features_ = SimpleNamespace(transform=lambda X: 2.0 * X)

    def estimator(self):
        def step(memory, observation):
            return Estimate(memory + observation[1], memory=memory + 1.0)

        return SimpleNamespace(initial=lambda: Estimate(memory=np.array([10.0])), step=step)


def test_the_rollout_of_a_short_run_by_hand():
    """The commands of the third and the last row respond to the second and the fourth; nothing responds to the last."""
    rollout = rollout_of(short_run(), PerturbedPolicy(CountingSkill(), PERTURBATION))
    np.testing.assert_allclose(rollout.costs, [3.0, 11.0])
    np.testing.assert_allclose(rollout.memberships, [[10.0], [12.0]])  # no force along y in these rows
    np.testing.assert_allclose(rollout.features[:, 6], [0.0, -0.010])
    np.testing.assert_allclose(rollout.log_factors, np.log([[1.0, 1.0], [2.0, 0.5]]))


# ------------------------------------------------------------------- update

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


def test_costs_that_hardly_vary_give_a_small_advantage():
    """The standard deviation of the costs, about 1e-5 s, is below its lower bound of 1e-3 s."""
    rollouts = [make_rollout(log_factors=DOUBLE, cost=2.0), make_rollout(log_factors=HALF, cost=2.00002)]
    z = advantages(rollouts, make_skill().regressor_)
    np.testing.assert_allclose(z, [0.01, 0.01, -0.01, -0.01], rtol=1e-6)


@pytest.mark.parametrize("largest", [2.0, 0.3])
def test_the_weights_are_the_exponential_of_the_clipped_advantage(monkeypatch, largest):
    monkeypatch.setattr(practice, "LARGEST_ADVANTAGE", largest)
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


def test_the_update_returns_a_new_skill_that_counts_its_practice_trials():
    skill = make_skill()
    before = skill.regressor_.y_.copy()
    once = advantage_weighted_update(skill, [make_rollout(log_factors=DOUBLE, cost=c) for c in (1.0, 2.0)])
    twice = advantage_weighted_update(once, [make_rollout(log_factors=HALF, cost=1.0)])
    assert skill.metadata_ == {"good": 1}
    np.testing.assert_array_equal(skill.regressor_.y_, before)
    assert (once.metadata_["practice_trials"], twice.metadata_["practice_trials"]) == (2, 3)


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
