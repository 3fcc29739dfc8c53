import numpy as np
import pytest

from skill.data.rig_run import RigRun
from skill.practice.exploration import Cost, ExplorationNoise, Perturbation, PerturbedPolicy, rollout_of
from tests.trajectories import GEOMETRY, make_rig_run

DOUBLED = Perturbation(np.array([0.0, 0.01]), np.log([1.0, 4.0]), np.log([1.0, 0.25]))


def run_of(samples, **result):
    return RigRun(samples, {"seed": 7, "inserted": True, **result}, {"geometry": GEOMETRY})


@pytest.mark.parametrize(
    ("depth", "turn", "feed"), [(-0.002, 1, 1), (0.0, 1, 1), (0.005, 2, 0.5), (0.01, 4, 0.25), (0.02, 4, 0.25)]
)
def test_factors_run_evenly_in_their_logarithm_and_hold_beyond_the_knots(depth, turn, feed):
    np.testing.assert_allclose(np.exp(DOUBLED.log_factors(depth)), [turn, feed])
    np.testing.assert_allclose(np.exp(DOUBLED.opposite().log_factors(depth)), [1 / turn, 1 / feed])


def test_curiosity_stays_within_its_limits_and_prefers_no_direction():
    rng = np.random.default_rng(0)
    drawn = [ExplorationNoise(turn=3.0, feed=1.5).draw(rng, 0.0247) for _ in range(2000)]
    np.testing.assert_allclose(drawn[0].depths, np.linspace(0.0, 0.0247, 6))
    for part, limit in (("turn", 3.0), ("feed", 1.5)):
        logs = np.array([getattr(v, part) for v in drawn])
        assert np.abs(logs).max() <= np.log(limit)
        assert np.abs(logs).max() > 0.99 * np.log(limit)
        assert abs(logs.mean()) < 4 * np.log(limit) / np.sqrt(3 * logs.size)


def test_a_varied_skill_acts_like_the_other_times_its_factors(skill):
    measured = np.array([5.0, 3.0, 2.0, 0.01, 0.02, 0.0, -0.005])
    plain = skill.act(measured)
    varied = PerturbedPolicy.of(skill, DOUBLED).act(measured)
    np.testing.assert_allclose(varied.turn, 2.0 * plain.turn)
    assert varied.feed == pytest.approx(0.5 * plain.feed)
    np.testing.assert_array_equal(varied.probabilities, plain.probabilities)
    assert skill.act(measured).feed == plain.feed


def test_a_trial_under_the_reference_force_costs_twice_its_time_and_failing_costs_extra():
    samples = make_rig_run().samples.assign(fx=15.0, fy=-20.0)
    cost = Cost(force=25.0, failure=5.0)
    duration = samples["time"].iloc[-1] - samples["time"].iloc[0]
    assert cost.of_run(run_of(samples)) == pytest.approx(2 * duration)
    for depth, lacks in ((0.025, 0.0), (0.010, 0.6), (-0.003, 1.0)):
        failed = run_of(samples.assign(depth=depth), inserted=False)
        assert cost.of_run(failed) == pytest.approx(2 * duration + 5 * (1 + lacks))
    assert cost.of_run(run_of(samples.assign(fx=0.0, fy=0.0))) == pytest.approx(duration)


def test_an_experience_is_what_the_skill_felt_and_tried(skill):
    run = run_of(make_rig_run().samples.assign(guard=0.0))
    e = rollout_of(run, PerturbedPolicy.of(skill, DOUBLED), Cost())
    n, k = len(run.samples), 61
    assert len(e.features) == len(e.costs) == n
    row = run.samples.iloc[k]
    measured = np.array([*row[["fx", "fy", "fz", "mx", "my", "mz"]], -row["depth"]])
    np.testing.assert_allclose(e.features[k], skill.features_.transform(measured[None])[0])
    np.testing.assert_allclose(e.tried[k], DOUBLED.log_factors(row["depth"]))
    np.testing.assert_allclose(e.memberships.sum(axis=1), 1.0)
    np.testing.assert_allclose(e.costs, Cost().of_steps(run), atol=1e-12)
    assert e.costs_to_go[0] == pytest.approx(Cost().of_run(run))


def test_what_the_guard_did_is_not_tried_but_paid_for(skill):
    """The guard of a row is the command that answered the row before."""
    samples = make_rig_run().samples.assign(guard=0.0)
    samples.loc[[40, 41], "guard"] = 1.0
    run = run_of(samples)
    e = rollout_of(run, PerturbedPolicy.of(skill, DOUBLED), Cost())
    paid = Cost().of_steps(run)
    assert len(e.costs) == len(paid) - 2
    assert e.costs[38] == pytest.approx(paid[38:41].sum())
    assert e.costs.sum() == pytest.approx(paid.sum())
