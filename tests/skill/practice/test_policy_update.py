import numpy as np
import pytest
from sklearn.linear_model import LinearRegression

from skill.manipulation_skill import ManipulationSkill
from skill.practice.exploration import Rollout
from skill.practice.policy_update import AdvantageWeighting, advantage_weighted_update, advantages
from skill.regression.locally_weighted_regression import LWRegressor

TWOFOLD, HALF = np.log([2.0, 1.0]), np.log([0.5, 1.0])  # of the turn; the feed is left as it is


def make_skill(x=0.0, action=(0.3, -0.1, -1.0), n=4):
    """One state, n samples of the same feature and action, and a kernel mean over all that is near."""
    skill = ManipulationSkill()
    skill.regressor_ = LWRegressor(bandwidth=1.0, degree=0, n_neighbors=None).fit(
        np.full((n, 1), x), np.tile(action, (n, 1)), memberships=np.ones((n, 1))
    )
    skill.metadata_ = {"good": 1}
    return skill


def make_experience(*, tried, cost, x=0.0, n=2):
    """The whole cost falls due at the end, so that every row has it before it."""
    return Rollout(
        features=np.full((n, 1), x),
        memberships=np.ones((n, 1)),
        tried=np.tile(tried, (n, 1)),
        costs=np.append(np.zeros(n - 1), cost),
    )


def action_of(skill, x=0.0):
    return skill.regressor_.predict([[x]], memberships=np.ones((1, 1)))[0]


def test_the_advantage_is_what_was_saved_over_what_is_usual():
    z = advantages(
        [make_experience(tried=TWOFOLD, cost=1.0), make_experience(tried=HALF, cost=3.0)], make_skill().regressor_
    )
    # Four costs 1, 1, 3, 3: mean 2, variance 4 / 3 with one parameter spent, and a quarter more for a new one.
    expected = 1.0 / np.sqrt(4 / 3 * 1.25)
    np.testing.assert_allclose(z, [expected, expected, -expected, -expected], rtol=1e-6)


def test_where_all_cost_the_same_there_is_no_advantage_and_nothing_to_learn():
    tried = [make_experience(tried=t, cost=2.0) for t in (TWOFOLD, HALF, HALF)]
    np.testing.assert_allclose(advantages(tried, make_skill().regressor_), 0.0, atol=1e-9)
    np.testing.assert_allclose(
        action_of(advantage_weighted_update(make_skill(), tried, AdvantageWeighting())),
        action_of(make_skill()),
        rtol=1e-6,
    )


def test_the_action_moves_by_the_weighted_mean_of_what_was_tried_less_the_plain_one():
    tried = [make_experience(tried=TWOFOLD, cost=1.0), make_experience(tried=HALF, cost=3.0)]
    z = 1.0 / np.sqrt(4 / 3 * 1.25)
    share = np.exp(z) / (np.exp(z) + np.exp(-z))  # of the one that went well
    factor = np.exp((share - (1 - share)) * np.log(2.0))
    before, after = (
        action_of(make_skill()),
        action_of(
            advantage_weighted_update(
                make_skill(), tried, AdvantageWeighting(inverse_temperature=1.0, advantage_clip=2.0)
            )
        ),
    )
    np.testing.assert_allclose(after, before * [factor, factor, 1.0], rtol=1e-6)
    assert factor > 1.2


def test_a_slow_trial_has_no_say_by_being_long():
    """Ninety rows of the dear way against ten of the cheap: the plain mean that is taken off holds them too."""
    tried = [make_experience(tried=TWOFOLD, cost=1.0, n=10), make_experience(tried=HALF, cost=3.0, n=90)]
    assert (
        action_of(advantage_weighted_update(make_skill(), tried, AdvantageWeighting()))[0] > action_of(make_skill())[0]
    )


def test_no_single_trial_rules():
    """One miracle among a hundred: its z of about ten counts as the half that is allowed."""
    usual = [make_experience(tried=HALF, cost=10.0, n=1) for _ in range(99)]
    learnt = advantage_weighted_update(
        make_skill(), [*usual, make_experience(tried=TWOFOLD, cost=0.0, n=1)], AdvantageWeighting(advantage_clip=0.5)
    )
    grown = np.log(action_of(learnt)[0] / action_of(make_skill())[0])
    weight = np.exp(0.5)
    least, advantage_clip = (w / (w + 99 * np.exp(-0.101)) for w in (1.0, weight))
    assert 0 < grown <= (advantage_clip - 0.01) * 2 * np.log(2.0) * 1.001
    assert least < advantage_clip


def test_far_from_what_was_tried_nothing_is_learnt_there():
    """Two places: in one the turn mattered, in the other nothing did."""
    near = [make_experience(tried=TWOFOLD, cost=1.0), make_experience(tried=HALF, cost=3.0)]
    far = [make_experience(tried=t, cost=2.0, x=100.0) for t in (TWOFOLD, HALF)]
    learnt = advantage_weighted_update(make_skill(x=100.0), near + far, AdvantageWeighting())
    np.testing.assert_allclose(action_of(learnt, 100.0), action_of(make_skill(x=100.0), 100.0), rtol=1e-6)


def test_the_practised_skill_is_another_and_counts_its_practice():
    skill = make_skill()
    before = skill.regressor_.y_.copy()
    once = advantage_weighted_update(
        skill, [make_experience(tried=TWOFOLD, cost=c) for c in (1.0, 2.0)], AdvantageWeighting()
    )
    twice = advantage_weighted_update(once, [make_experience(tried=HALF, cost=1.0)], AdvantageWeighting())
    assert skill.metadata_ == {"good": 1}
    np.testing.assert_array_equal(skill.regressor_.y_, before)
    assert (once.metadata_["practice_trials"], twice.metadata_["practice_trials"]) == (2, 3)


def test_a_practised_skill_is_saved_and_acts_as_it_learnt(skill, tmp_path):
    measured = np.array([5.0, 3.0, 2.0, 0.01, 0.02, 0.0, -0.008])
    features, P = skill.features_.transform(measured[None])[0], skill.state_probabilities(measured[None])
    faster = np.log([1.0, 1.5])
    tried = [
        Rollout(np.tile(features, (9, 1)), np.tile(P, (9, 1)), np.tile(t, (9, 1)), np.append(np.zeros(8), cost))
        for t, cost in ((faster, 1.0), (-faster, 2.0))
    ]
    learnt = advantage_weighted_update(skill, tried, AdvantageWeighting())
    learnt.save(tmp_path / "practised.npz")
    again = ManipulationSkill.load(tmp_path / "practised.npz")
    assert again.act(measured).feed == learnt.act(measured).feed
    assert again.act(measured).feed < skill.act(measured).feed < 0
    np.testing.assert_allclose(again.act(measured).turn, skill.act(measured).turn)


def test_nothing_to_learn_from_and_nothing_to_learn_with():
    with pytest.raises(ValueError, match="at least one practice trial"):
        advantage_weighted_update(make_skill(), [], AdvantageWeighting())
    skill = make_skill()
    skill.regressor_ = LinearRegression()
    with pytest.raises(ValueError, match="LinearRegression"):
        advantage_weighted_update(skill, [make_experience(tried=HALF, cost=1.0)], AdvantageWeighting())
