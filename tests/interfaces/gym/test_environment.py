"""The environment against the interface of Gymnasium, and against itself."""

import gc
import warnings
import weakref

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from experiments.trial.trial_set import TrialSet, trial_scenario
from interfaces.gym.environment import FIRST_DRAWN, InsertionEnv
from models.contact_bodies import ContactLabel
from models.scenario import Scenario

TRIAL = 88000  # the tests judge nothing with the trials from 88000 on
PUSH = np.array([0.0, 0.0, -0.02])


def steps(env, action, number):
    """The observations, rewards, ends and infos of some steps."""
    return [env.step(action) for _ in range(number)]


@pytest.mark.slow
def test_the_checker_of_gymnasium_finds_nothing(make):
    env = make()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)


def test_a_policy_adds_its_estimates_and_the_support(make, skill):
    env = make(policy=skill)
    observation, _ = env.reset(seed=TRIAL)
    assert observation in env.observation_space
    assert observation["probabilities"].shape == (skill.n_states,)
    assert observation["probabilities"].sum() == pytest.approx(1.0)
    assert env.action_space.shape == (4,)


def test_a_seed_is_the_number_of_a_trial(make, quick_scenario):
    env = make("PegInHole-Hard-v0")
    for call in ({"seed": TRIAL + 1}, {"options": {"trial": TRIAL + 1}}, {"seed": 1, "options": {"trial": TRIAL + 1}}):
        _, info = env.reset(**call)
        assert info["trial_number"] == TRIAL + 1
    tilt = trial_scenario(quick_scenario, number=TRIAL + 1, trial_set=TrialSet.HARD).start.tilt
    assert env.unwrapped._run.ended().result.tilt == tuple(tilt)


def test_resets_without_a_seed_draw_trials_that_no_evaluation_uses(make):
    env = make()
    env.reset(seed=5)
    drawn = [env.reset()[1]["trial_number"] for _ in range(3)]
    assert len(set(drawn)) == 3
    assert min(drawn) >= FIRST_DRAWN
    env.reset(seed=5)
    assert [env.reset()[1]["trial_number"] for _ in range(3)] == drawn


def test_returned_observations_are_not_shared(make):
    env = make()
    first, _ = env.reset(seed=TRIAL)
    first["wrench"][:] = 1e3
    env.step(PUSH)[0]["depth"][:] = 1e3
    assert env.step(PUSH)[0]["depth"] < 1.0


def test_the_feed_moves_the_peg_and_the_turn_the_hole(make):
    env = make()
    before, _ = env.reset(seed=TRIAL)
    assert before["depth"][0] == pytest.approx(-0.001, abs=1e-5)
    after = steps(env, np.array([0.05, -0.02, 0.0]), 3)[-1][0]
    # Turning the peg relative to the hole by an angle turns the hole by minus that angle.
    assert after["angles"] == pytest.approx([-0.05 * 0.06, 0.02 * 0.06], rel=0.1)
    deeper = steps(env, np.array([0.0, 0.0, 0.01]), 5)[-1][0]
    assert deeper["depth"][0] < -0.0012
    assert deeper["feed"][0] == pytest.approx(0.01)


def test_a_clocking_stage_adds_a_turn_about_the_axis(make, quick_scenario):
    quick_scenario.geometry.section, quick_scenario.rig.clocking_stage = "square", True
    env = make()
    assert env.action_space.shape == (4,)
    assert env.observation_space["angles"].shape == (3,)
    env.reset(seed=TRIAL)
    after = steps(env, np.array([0.0, 0.0, 0.05, 0.0]), 3)[-1][0]
    assert after["angles"] == pytest.approx([0.0, 0.0, -0.05 * 0.06], rel=0.1)
    assert steps(env, np.array([0.0, 0.0, 0.0, 0.01]), 5)[-1][0]["feed"][0] == pytest.approx(0.01)


def test_the_controller_limits_an_action_outside_the_space(make):
    env = make()
    env.reset(seed=TRIAL)
    observation = steps(env, np.array([0.0, 0.0, 5.0]), 2)[-1][0]
    assert observation["feed"][0] == pytest.approx(0.03)
    assert observation in env.observation_space


def test_the_label_is_that_of_the_true_pose(make):
    env = make()
    _, info = env.reset(seed=TRIAL)
    assert (info["contact_label"], info["contact"]) == (ContactLabel.FREE, "free")
    infos = [step[-1] for step in steps(env, PUSH, 12)]
    assert infos[-1]["load"] > 2.0
    assert (infos[-1]["contact_label"], infos[-1]["contact"]) == (ContactLabel.TIP, "one point at the tip")
    assert "contact" not in make(labels=False).reset(seed=TRIAL)[1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"trial_set": "harder"}, "'harder' is not a valid TrialSet"),
        ({"reward": "big"}, r"reward is 'big', expected one of \('dense', 'sparse'\)"),
        ({"scenario": "nowhere"}, "no such file"),
        ({"render_mode": "film"}, "render_mode is 'film'"),
    ],
)
def test_a_wrong_choice_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        InsertionEnv(**arguments)


@pytest.mark.parametrize("policy", [3, "skill.npz"])
def test_a_policy_that_is_none_is_named(policy):
    with pytest.raises(TypeError, match=f"policy is {policy!r}, expected a policy such as a ManipulationSkill"):
        InsertionEnv(policy=policy)


@pytest.mark.parametrize(
    "action",
    [np.zeros(4), np.array([0.0, np.nan, 0.0]), [0.0, np.inf, 0.0], None],
    ids=repr,
)
def test_a_wrong_action_is_named(make, action):
    env = make().unwrapped
    env.reset(seed=TRIAL)
    with pytest.raises(ValueError, match="expected 3 finite numbers"):
        env.step(action)


def test_a_reset_keeps_the_diagram_and_frees_the_simulation_before(make):
    env = make().unwrapped
    env.reset(seed=TRIAL)
    env.step(PUSH)
    rig, freed = env._rig, weakref.ref(env._run.simulator)
    env.reset(seed=TRIAL + 1)
    gc.collect()
    assert env._rig is rig
    assert freed() is None


def test_a_broken_simulation_shows_the_last_sound_observation(make, quick_scenario):
    """The peg is so stiff that its contact forces are close to overflow."""
    quick_scenario.contact.modulus = 1e300
    quick_scenario.start.height = 1e-4
    env = make(labels=False)
    before, _ = env.reset(seed=TRIAL)
    terminated = False
    while not terminated:
        shown, (before, reward, terminated, truncated, info) = before, env.step(PUSH)
        assert not truncated
    assert info["trial"]["reason"].startswith("diverged")
    assert np.isfinite(reward)
    for name, values in before.items():
        np.testing.assert_array_equal(values, shown[name])


def test_a_step_needs_an_episode(make):
    env = make().unwrapped
    env.reset(seed=TRIAL)
    env.close()
    with pytest.raises(gymnasium.error.ResetNeeded, match="call reset"):
        env.step(PUSH)


@pytest.mark.nightly
@pytest.mark.slow
def test_environments_run_in_spawned_processes(quick_scenario):
    envs = gymnasium.make_vec(
        "interfaces.gym:PegInHole-v0",
        num_envs=2,
        vectorization_mode="async",
        vector_kwargs={"context": "spawn"},
        scenario=quick_scenario,
        labels=False,
    )
    try:
        _, infos = envs.reset(seed=[TRIAL, TRIAL + 1])
        assert list(infos["trial_number"]) == [TRIAL, TRIAL + 1]
        observations, *_ = envs.step(np.tile(PUSH, (2, 1)))
        assert observations["wrench"].shape == (2, 6)
    finally:
        envs.close()


@pytest.mark.slow
def test_the_picture_follows_the_peg(make):
    env = make(render_mode="rgb_array", labels=False)
    env.reset(seed=TRIAL)
    above = env.render()
    assert above.shape == (480, 480, 3)
    assert above.dtype == np.uint8
    steps(env, PUSH, 4)
    assert not np.array_equal(above, env.render())


def test_the_default_scenario_has_the_default_spaces():
    env, controller = gymnasium.make("interfaces.gym:PegInHole-v0"), Scenario().controller
    assert list(env.observation_space) == ["angles", "control", "depth", "feed", "wrench"]
    largest = np.array([controller.max_turn_rate] * 2 + [controller.max_feed_speed])
    np.testing.assert_array_equal([env.action_space.high, -env.action_space.low], [largest] * 2)
    assert env.metadata["render_fps"] == 50
