"""What a policy receives in place of the measured wrench: by hand, in the diagram, and in trials."""

import copy
import math

import numpy as np
import pandas as pd
import pytest

from benchmarks.rig.control_laws import MomentCompliance, StraightPush
from experiments.trial.diagram_trial import run_rig
from experiments.trial.run_trial import run_trial
from models.control import WRENCHES
from models.scenario import TRIAL_STREAM, resolve_scenario
from systems.control.policy_wrench import PolicyWrench
from systems.rig import MakeRig
from systems.steps.policy_wrench import SHUFFLED, initial_state, policy_wrench, policy_wrench_step
from tests.stepping import fixed_context, update

LEVER, PERIOD = 0.01, 0.02
REPLACED = [*WRENCHES[1:], "scaled:0.5", "scaled:-1"]


def received(use, wrenches, seed=0):
    """The wrenches (n, 6) that the system passes on for measured ones."""
    dut = PolicyWrench(use=use, period=PERIOD, lever=LEVER, seed=seed)
    context = fixed_context(dut, wrench=np.zeros(6))
    found = []
    for wrench in wrenches:
        dut.GetInputPort("wrench").FixValue(context, wrench)
        found.append(dut.GetOutputPort("policy_wrench").Eval(context).copy())
        update(dut, context, period=PERIOD)
    return np.array(found)


def numbered(n):
    """Wrenches (n, 6) whose first element is their number."""
    return np.arange(n)[:, None] * np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def test_zero_and_scaled_need_no_memory():
    wrench = np.array([1.0, -2.0, 3.0, 0.1, 0.2, -0.3])
    for use, expected in (("zero", 0.0 * wrench), ("scaled:0.5", 0.5 * wrench), ("scaled:-1", -wrench)):
        state = initial_state(use)
        np.testing.assert_array_equal(policy_wrench(use, state, wrench, 0.3), expected)
        np.testing.assert_array_equal(received(use, [wrench, wrench]), [expected, expected])


@pytest.mark.parametrize("touch", [[0.0, 0.0, 3.1, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, -0.031, 0.0]])
def test_a_frozen_wrench_is_measured_until_the_first_touch_and_then_that_of_the_touch(touch):
    free = [0.1, -0.2, 2.9, 0.0, 0.001, 0.0]
    measured = np.array([free, touch, np.multiply(4.0, touch), np.zeros(6), free])
    np.testing.assert_array_equal(received("frozen", measured), [free, touch, touch, touch, touch])


def test_a_shuffled_wrench_is_one_of_the_past_and_each_of_them_is_as_likely():
    assert received("shuffled", numbered(1) + 4.0)[0, 0] == 4.0  # the first has no past
    drawn = np.array([received("shuffled", numbered(6), seed)[:, 0] for seed in range(600)])
    for k in range(1, 6):
        counts = np.bincount(drawn[:, k].astype(int), minlength=k)
        assert len(counts) == k  # never the present one, nor a later one
        assert np.abs(counts - 600 / k).max() < 4.0 * math.sqrt(600 / k)


def test_readings_that_no_longer_fit_are_kept_with_equal_probability():
    rng, n, times = np.random.default_rng(1), 3 * SHUFFLED, 10
    kept = np.zeros(n)
    for _ in range(times):
        state = initial_state("shuffled")
        for wrench in numbered(n):
            state = policy_wrench_step("shuffled", state, wrench, rng.uniform(), LEVER)
        numbers = state[1:].reshape(-1, 6)[:, 0].astype(int)
        assert len(set(numbers)) == SHUFFLED
        kept[numbers] += 1
    thirds = kept.reshape(3, -1).sum(axis=1) / (times * SHUFFLED)
    np.testing.assert_allclose(thirds, 1 / 3, atol=0.03)


def test_shuffling_depends_on_the_seed_only():
    one, same, other = (received("shuffled", numbered(60), seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one, same)
    assert (one != other).any()


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


def sources(diagram):
    """(system, port) behind each input (system, port) of a diagram."""
    return {
        (system.get_name(), system.get_input_port(i).get_name()): (
            source.get_name(),
            source.get_output_port(o).get_name(),
        )
        for (system, i), (source, o) in diagram.connection_map().items()
    }


def test_only_the_policy_and_its_estimator_receive_the_replaced_wrench(scenario, skill):
    measured, replaced = (sources(MakeRig(resolved(scenario, use), skill).diagram) for use in ("true", "zero"))
    assert "policy_wrench" not in {system for system, _ in measured}
    changed = {port: source for port, source in replaced.items() if measured.get(port) != source}
    assert changed == {
        ("policy_wrench", "wrench"): ("sensor_monitor", "wrench"),
        ("policy_estimator", "wrench"): ("policy_wrench", "policy_wrench"),
        ("policy_controller", "policy_wrench"): ("policy_wrench", "policy_wrench"),
    }
    kept = {system for (system, _), source in replaced.items() if source == ("sensor_monitor", "wrench")}
    assert kept == {"policy_wrench", "policy_controller", "force_guard", "drive_monitor", "run_row"}


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


def test_scaled_by_one_is_the_measured_wrench(scenario, skill):
    (result, run), (other, scaled) = (run_trial(resolved(scenario, use), skill, seed=1) for use in ("true", "scaled:1"))
    pd.testing.assert_frame_equal(run.samples, scaled.samples, check_exact=True)
    assert result.reason == other.reason


def test_another_trial_in_the_same_diagram_shuffles_as_a_new_one_does(scenario, skill):
    first, other = (resolved(scenario, "shuffled", seed=seed) for seed in (1, 2))
    used, fresh = (run_rig(MakeRig(built, skill), other, seed=2) for built in (first, other))
    pd.testing.assert_frame_equal(used.samples, fresh.samples, check_exact=True)
