import numpy as np
import pytest

from skill.features.measurement import measurement
from skill.states.estimate import Estimate, estimates
from systems.law.estimator import READINGS, PolicyEstimator
from tests.stepping import fixed_context, update

PERIOD = 0.02


class Counter:
    """An estimator of two states that counts the measurements and keeps the last depth."""

    def initial(self):
        return Estimate(np.array([0.5, 0.5]), False, np.zeros(2))

    def step(self, memory, measured):
        states = np.array([0.3, 0.7]) if measured[0] > 0.0 else np.array([0.9, 0.1])
        return Estimate(states, True, np.array([memory[0] + 1.0, measured[6]]))


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
        assert readings(dut, context) == {name: float(read(expected)) for name, read in READINGS.items()}
        update(dut, context, period=PERIOD)


def test_records_show_the_most_probable_state():
    dut = PolicyEstimator(estimator=Counter(), period=PERIOD)
    context = dut.CreateDefaultContext()
    set_inputs(dut, context, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 0.01)
    assert readings(dut, context) == {"state": 1.0, "known": 1.0}


def test_the_memory_is_stored_in_the_context():
    dut = PolicyEstimator(estimator=Counter(), period=PERIOD)
    one, other = dut.CreateDefaultContext(), dut.CreateDefaultContext()
    for k in range(3):
        set_inputs(dut, one, np.zeros(6), 0.1 * k)
        set_inputs(dut, other, np.zeros(6), -0.1 * k)
        for context in (one, other)[: 2 if k else 1]:
            update(dut, context, period=PERIOD)
    np.testing.assert_allclose(one.get_discrete_state(0).value(), [3.0, -0.2])
    np.testing.assert_allclose(other.get_discrete_state(0).value(), [2.0, 0.2])


def test_a_policy_without_estimator_has_one_state_for_certain():
    dut = PolicyEstimator(estimator=None, period=PERIOD)
    context = fixed_context(dut)
    assert context.num_discrete_state_groups() == 0
    assert readings(dut, context) == {"state": 0.0, "known": 1.0}
