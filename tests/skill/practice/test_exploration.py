from types import SimpleNamespace

import numpy as np
import pytest

from skill.data.rig_run import RigRun
from skill.policy import Action
from skill.practice.exploration import (
    Perturbation,
    PerturbedPolicy,
    draw_perturbation,
    rollout_of,
    step_costs,
)
from skill.states.estimate import Estimate, estimates
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
    np.testing.assert_allclose(drawn[0].depths, np.linspace(0.0, 0.0247, 6))
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


def test_a_perturbed_policy_changes_nothing_but_the_action():
    policy, measured = FixedPolicy(), np.arange(7.0)
    perturbed = PerturbedPolicy(policy, PERTURBATION)
    assert (perturbed.period_, perturbed.metadata_) == (0.02, {"geometry": GEOMETRY})
    assert perturbed.state_names() == policy.state_names()
    assert perturbed.estimator() == policy.estimator()
    assert perturbed.act(measured, None).support == policy.act(measured).support


def test_the_cost_of_a_trial_grows_with_lateral_force_and_failure():
    samples = make_rig_run().samples.assign(fx=15.0, fy=-20.0)
    duration = samples["time"].iloc[-1] - samples["time"].iloc[0]
    assert step_costs(run_of(samples)).sum() == pytest.approx(2 * duration)
    for depth, missing in ((0.025, 0.0), (0.010, 0.6), (-0.003, 1.0)):
        failed = run_of(samples.assign(depth=depth), inserted=False)
        assert step_costs(failed).sum() == pytest.approx(2 * duration + 5 * (1 + missing))
    samples["depth"] = 0.025
    samples.loc[samples.index[-1], "depth"] = 0.010  # the depth at the end counts
    assert step_costs(run_of(samples, inserted=False)).sum() == pytest.approx(2 * duration + 5 * 1.6)


def test_a_rollout_holds_the_features_and_factors_of_each_row(skill):
    run = run_of(make_rig_run().samples.assign(back_off=0.0))
    rollout = rollout_of(run, PerturbedPolicy(skill, PERTURBATION))
    n, k = len(run.samples), 61
    assert len(rollout.features) == len(rollout.costs) == n
    row = run.samples.iloc[k]
    measured = np.array([*row[["fx", "fy", "fz", "mx", "my", "mz"]], -row["depth"]])
    np.testing.assert_allclose(rollout.features[k], skill.features_.transform(measured[None])[0])
    np.testing.assert_allclose(rollout.log_factors[k], PERTURBATION.log_factors(row["depth"]))
    wrench, opposite = run.samples[["fx", "fy", "fz", "mx", "my", "mz"]], ["depth", "target_pitch", "target_yaw"]
    observed = np.column_stack([wrench, -run.samples[opposite]])
    expected = list(estimates(skill.estimator(), observed[: k + 1]))[-1]
    np.testing.assert_allclose(rollout.memberships[k], expected.states)
    np.testing.assert_allclose(rollout.costs, step_costs(run), atol=1e-12)
    assert rollout.costs_to_go[0] == pytest.approx(step_costs(run).sum())


def test_rows_of_a_back_off_are_left_out_and_their_costs_added_to_the_row_before(skill):
    """The back-off of a row is the command that responded to the row before."""
    samples = make_rig_run().samples.assign(back_off=0.0)
    samples.loc[[40, 41], "back_off"] = 1.0
    run = run_of(samples)
    rollout = rollout_of(run, PerturbedPolicy(skill, PERTURBATION))
    costs = step_costs(run)
    assert len(rollout.costs) == len(costs) - 2
    assert rollout.costs[38] == pytest.approx(costs[38:41].sum())
    assert rollout.costs.sum() == pytest.approx(costs.sum())


def test_a_perturbed_policy_takes_the_factors_at_the_depth_that_is_measured_last():
    measured = np.array([5.0, 3.0, 2.0, 0.01, 0.02, 0.03, -0.005])
    action = PerturbedPolicy(FixedPolicy(), PERTURBATION).act(measured, None)
    np.testing.assert_allclose(action.turn, [0.2, -0.4])
    assert action.feed == pytest.approx(-5e-4)


@pytest.mark.parametrize(("full_depth", "knots"), [(0.001, 2), (0.004, 2), (0.012, 3), (0.024, 6)])
def test_knots_are_about_the_spacing_apart(full_depth, knots):
    drawn = draw_perturbation(np.random.default_rng(0), full_depth)
    np.testing.assert_allclose(drawn.depths, np.linspace(0.0, full_depth, knots))
    assert drawn.turn.shape == drawn.feed.shape == (knots,)


def short_run(**result):
    """Five rows, one second apart, of which the third and the last hold a back-off."""
    samples = make_rig_run().samples.head(5).assign(
        time=[1.0, 2.0, 3.0, 4.0, 6.0],
        fx=[0.0, 15.0, 0.0, 30.0, 90.0],
        fy=[0.0, 20.0, 0.0, 40.0, 90.0],
        depth=[0.0, 0.005, 0.005, 0.010, 0.030],
        back_off=[0.0, 0.0, 1.0, 0.0, 1.0],
    )  # fmt: skip
    return run_of(samples, **result)


def test_the_cost_of_a_step_is_that_of_the_force_at_its_start():
    """The forces are 0, 25, 0 and 50 N, the last step takes 2 s, and the force in the last row has no step."""
    np.testing.assert_allclose(step_costs(short_run()), [1.0, 2.0, 1.0, 10.0, 0.0])
    # The tip is deeper than the hole, so nothing of the depth is missing.
    np.testing.assert_allclose(step_costs(short_run(inserted=False)), [1.0, 2.0, 1.0, 10.0, 5.0])


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
