"""What a policy receives in place of the measured wrench: by hand, and in trials."""

import copy
import math

import numpy as np
import pandas as pd
import pytest

from benchmarks.rig.control_laws import MomentCompliance, StraightPush
from experiments.trial.diagram_trial import run_rig
from experiments.trial.run_trial import run_trial
from models.control import WRENCHES, wrench_factor
from models.scenario import TRIAL_STREAM, resolve_scenario
from skill.replaced_wrench import READINGS, ReplacedWrench
from skill.states.estimate import estimates
from systems.rig import MakeRig

LEVER = 0.01
REPLACED = [*WRENCHES[1:], "scaled:0.5", "scaled:-1"]


def replaced(use, policy=None):
    return ReplacedWrench(policy or StraightPush(0.02), use, wrench_factor(use), LEVER)


def received(use, wrenches):
    """The wrenches (n, 6) that a policy receives for measured ones."""
    observed = np.column_stack([wrenches, np.zeros(len(wrenches))])
    return np.array([estimate.measured[:6] for estimate in estimates(replaced(use).estimator(), observed)])


def numbered(n):
    """Wrenches (n, 6) whose first element is their number."""
    return np.arange(n)[:, None] * np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def test_zero_and_scaled_need_no_memory():
    wrench = np.array([1.0, -2.0, 3.0, 0.1, 0.2, -0.3])
    for use, expected in (("zero", 0.0 * wrench), ("scaled:0.5", 0.5 * wrench), ("scaled:-1", -wrench)):
        np.testing.assert_array_equal(received(use, [wrench, wrench]), [expected, expected])


@pytest.mark.parametrize("touch", [[0.0, 0.0, 3.1, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, -0.031, 0.0]])
def test_a_frozen_wrench_is_measured_until_the_first_touch_and_then_that_of_the_touch(touch):
    free = [0.1, -0.2, 2.9, 0.0, 0.001, 0.0]
    measured = np.array([free, touch, np.multiply(4.0, touch), np.zeros(6), free])
    np.testing.assert_array_equal(received("frozen", measured), [free, touch, touch, touch, touch])


def test_a_shuffled_wrench_is_one_of_the_past_and_each_of_them_is_as_likely():
    assert received("shuffled", numbered(1) + 4.0)[0, 0] == 4.0  # the first has no past
    noise = np.random.default_rng(0).uniform(0.0, 0.1, (600, 6, 6))
    drawn = np.array([received("shuffled", numbered(6) + added)[:, 0] for added in noise])
    for k in range(1, 6):
        counts = np.bincount(drawn[:, k].astype(int), minlength=k)
        assert len(counts) == k  # never the present one, nor a later one
        assert np.abs(counts - 600 / k).max() < 4.0 * math.sqrt(600 / k)


def test_readings_that_no_longer_fit_are_kept_with_equal_probability():
    shuffled, n, times = READINGS["shuffled"], 3 * READINGS["shuffled"], 10
    kept, policy = np.zeros(n), replaced("shuffled")
    for seed in range(times):
        state = np.zeros(1 + 6 * shuffled)
        for wrench in numbered(n) + np.random.default_rng(seed).uniform(0.0, 0.1, (n, 6)):
            state = policy.remembered(state, wrench)
        numbers = state[1:].reshape(-1, 6)[:, 0].astype(int)
        assert len(set(numbers)) == shuffled
        kept[numbers] += 1
    thirds = kept.reshape(3, -1).sum(axis=1) / (times * shuffled)
    np.testing.assert_allclose(thirds, 1 / 3, atol=0.03)


@pytest.fixture
def scenario(quick_scenario):
    quick_scenario.contact.engine = "exact"
    quick_scenario.start.tilt = [0.04, -0.03]
    quick_scenario.trial.time_limit = 0.6
    return quick_scenario


def resolved(scenario, use, seed=1):
    chosen = copy.deepcopy(scenario)
    chosen.controller.wrench = use
    return resolve_scenario(chosen, seed=seed, stream=TRIAL_STREAM)


def test_a_policy_that_ignores_force_shows_it(scenario):
    result, run = run_trial(resolved(scenario, "true"), StraightPush(0.02), seed=1)
    assert result.peak_load > 5.0
    for use in REPLACED:
        other, blind = run_trial(resolved(scenario, use), StraightPush(0.02), seed=1)
        pd.testing.assert_frame_equal(run.samples, blind.samples, check_exact=True)
        assert result == other


def test_a_policy_that_uses_force_shows_it(scenario, skill):
    for policy in (skill, MomentCompliance()):
        runs = {use: run_trial(resolved(scenario, use), policy, seed=1)[1].samples for use in ("true", *REPLACED)}
        for use in REPLACED:
            n = min(len(runs[use]), len(runs["true"]))
            assert (runs[use][["pitch", "yaw"]][:n] != runs["true"][["pitch", "yaw"]][:n]).to_numpy().any(), use


def test_another_trial_in_the_same_diagram_shuffles_as_a_new_one_does(scenario, skill):
    first, other = (resolved(scenario, "shuffled", seed=seed) for seed in (1, 2))
    used, fresh = (run_rig(MakeRig(built, skill), other, seed=2) for built in (first, other))
    pd.testing.assert_frame_equal(used.samples, fresh.samples, check_exact=True)
