import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from models.scenario import TRIAL_STREAM, resolve_scenario
from skill.data.rig_run import CONTEXT_COLUMNS
from skill.features.measurement import measurement
from skill.features.responses import ResponseFeatures, rig_observations
from skill.features.wrench_features import MEASURED, CanonicalFeatures
from skill.states.context_filter import ContextEstimate, ContextFilter, SingleContext
from skill.states.context_mixture import ContextMixture
from systems.control.context_estimator import ContextEstimator, readings_of
from systems.rig import MakeRig
from tests.stepping import fixed_context, update

PERIOD = 0.02


@pytest.fixture(scope="module")
def mixture():
    """Two contexts in which the lateral force answers to a turn with opposite signs."""
    rng = np.random.default_rng(0)
    group = np.repeat(np.arange(12), 30)
    U = rng.normal(0.0, [3e-3, 3e-3, 3e-4], (360, 3))
    Y = rng.normal(0.0, 0.2, (360, 5))
    Y[:, 0] += 1e3 * np.where(group % 2 == 0, 1.0, -1.0) * U[:, 1]
    measured = rng.normal([6, 0, 1, 0, 0, 0, -0.002], [1, 1, 1, 0.01, 0.01, 0, 1e-4], (360, 7))
    X = CanonicalFeatures().fit_transform(measured)
    return ContextMixture(n_contexts=2, n_init=4).fit(X, Y, inputs=U, groups=group)


class Policy:
    """What the estimator needs of a policy."""

    def __init__(self, follower):
        self.context_filter = lambda: follower


@pytest.fixture
def follower(mixture):
    return ContextFilter(mixture, ResponseFeatures(CanonicalFeatures(), 0.01), PERIOD)


@pytest.fixture
def series():
    """Wrenches (n, 6), depths and commanded angles (n, 2): a loaded peg whose force grows with the yaw of the hole."""
    rng = np.random.default_rng(1)
    targets = np.cumsum(rng.normal(0.0, 2e-3, (30, 2)), axis=0)
    wrenches = np.column_stack([6.0 + 1e3 * targets[:, 1], rng.normal(0.0, 0.1, (30, 5)) * [1, 1, 0.01, 0.01, 0.01]])
    return wrenches, np.full(30, 0.002), targets


def set_inputs(dut, context, wrench, depth, target):
    dut.GetInputPort("wrench").FixValue(context, wrench)
    dut.GetInputPort("depth").FixValue(context, [depth])
    for name, angle in zip(("target_pitch", "target_yaw"), target, strict=True):
        dut.GetInputPort(name).FixValue(context, [angle])


def outputs(dut, context, *names):
    return [dut.GetOutputPort(name).Eval(context).copy() for name in names]


def test_the_estimate_equals_that_of_the_policys_own_filter(follower, series):
    dut = ContextEstimator(policy=Policy(follower), period=PERIOD)
    context = dut.CreateDefaultContext()
    memory = follower.initial_memory()
    for wrench, depth, target in zip(*series, strict=True):
        set_inputs(dut, context, wrench, depth, target)
        expected = follower.step(memory, rig_observations(measurement(wrench, depth), target))
        contexts, *readings = outputs(dut, context, "contexts", *CONTEXT_COLUMNS)  # before the update
        np.testing.assert_array_equal(contexts, expected.probabilities)
        np.testing.assert_array_equal(np.ravel(readings), readings_of(expected))
        update(dut, context, period=PERIOD)
        memory = expected.memory
    # The force grows with the yaw of the hole, so it falls with the turn of the peg: the context of the odd groups.
    assert contexts[follower._mixture.responsibilities_[1].argmax()] > 0.99


def test_the_memory_is_stored_in_the_context(follower, series):
    dut = ContextEstimator(policy=Policy(follower), period=PERIOD)
    one, other = dut.CreateDefaultContext(), dut.CreateDefaultContext()
    for wrench, depth, target in zip(*series, strict=True):
        set_inputs(dut, one, wrench, depth, target)
        set_inputs(dut, other, wrench, depth, -target)
        for context in (one, other):
            update(dut, context, period=PERIOD)
    (of_one,), (of_other,) = outputs(dut, one, "contexts"), outputs(dut, other, "contexts")
    assert of_one.argmax() != of_other.argmax()


def test_a_policy_without_contexts_has_one():
    dut = ContextEstimator(policy=Policy(SingleContext()), period=PERIOD)
    context = fixed_context(dut, wrench=np.zeros(6), depth=[0.0], target_pitch=[0.0], target_yaw=[0.0])
    update(dut, context, period=PERIOD)
    assert outputs(dut, context, "contexts", *CONTEXT_COLUMNS) == [[1.0], [0.0], [1.0], [0.0]]


def test_the_evidence_is_that_of_the_leading_context_against_the_next():
    estimate = ContextEstimate(np.zeros(1), np.array([0.2, 0.5, 0.3]), np.array([1.0, -2.0, 0.5]))
    assert readings_of(estimate) == [1.0, 0.5, -2.5]


def test_the_rig_records_what_the_filter_finds_from_its_record(quick_scenario, skill, mixture, monkeypatch):
    """The recorded contexts follow from the recorded measurements and commands alone."""
    follower = ContextFilter(mixture, ResponseFeatures(CanonicalFeatures(), 0.01), PERIOD)
    monkeypatch.setattr(type(skill), "context_filter", lambda self: follower)
    act = type(skill).act
    monkeypatch.setattr(type(skill), "act", lambda self, measured, states, _: act(self, measured, states))
    scenario = quick_scenario
    scenario.start.height, scenario.start.tilt = 2e-4, [0.04, -0.03]
    rig = MakeRig(resolve_scenario(scenario, seed=1, stream=TRIAL_STREAM), skill)
    simulator = Simulator(rig.diagram)
    rig.set_start(simulator.get_mutable_context())
    simulator.AdvanceTo(0.5)
    samples = rig.recorder.samples(simulator.get_context())
    measured = measurement(samples[list(MEASURED[:6])].to_numpy(), samples["depth"].to_numpy())
    memory, found = follower.initial_memory(), []
    for row in rig_observations(measured, samples[["target_pitch", "target_yaw"]].to_numpy()):
        estimate = follower.step(memory, row)
        memory = estimate.memory
        found.append(readings_of(estimate))
    # A row is recorded just before the update, which may use a newer sample of the sensor.
    np.testing.assert_allclose(samples["context_probability"], np.array(found)[:, 1], atol=2e-3)
    assert samples["context_evidence"].abs().max() > 0.0
