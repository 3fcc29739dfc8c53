import numpy as np
import pytest

from skill.features.measurement import measurement
from skill.states.estimate import estimates
from systems.law.estimator import READINGS, PolicyEstimator
from tests.stepping import fixed_context, update

PERIOD = 0.02


def set_inputs(dut, context, wrench, depth):
    dut.GetInputPort("wrench").FixValue(context, wrench)
    dut.GetInputPort("depth").FixValue(context, [depth])


def readings(dut, context):
    return {name: dut.GetOutputPort(name).Eval(context)[0] for name in READINGS}


@pytest.fixture
def series(demonstrations):
    """Wrenches (n, 6) and depths (n,) of a demonstrated insertion."""
    samples = demonstrations[0].samples.iloc[::5]
    wrenches = samples[["fx", "fy", "fz", "mx", "my", "mz"]].to_numpy()
    return wrenches, -samples["z"].to_numpy()


def test_the_estimate_equals_that_of_the_policys_own_estimator(skill, series):
    dut = PolicyEstimator(estimator=skill.estimator(), period=PERIOD)
    context = dut.CreateDefaultContext()
    observed = measurement(*series)
    for inputs, expected in zip(zip(*series, strict=True), estimates(skill.estimator(), observed), strict=True):
        set_inputs(dut, context, *inputs)
        found = dut.GetOutputPort("estimate").Eval(context)  # uses this measurement, before the update
        np.testing.assert_array_equal(found.states, expected.states)
        np.testing.assert_array_equal(found.memory, expected.memory)
        assert readings(dut, context) == {"state": float(expected.state), "known": float(expected.known)}
        update(dut, context, period=PERIOD)


def test_a_policy_without_estimator_has_one_state_for_certain():
    dut = PolicyEstimator(estimator=None, period=PERIOD)
    context = fixed_context(dut)
    assert context.num_discrete_state_groups() == 0
    assert readings(dut, context) == {"state": 0.0, "known": 1.0}
