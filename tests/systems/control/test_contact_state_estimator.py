import numpy as np
import pytest

from systems.control.contact_state_estimator import ContactStateEstimator
from tests.stepping import fixed_context, update

PERIOD = 0.02


@pytest.fixture
def measurements(demonstrations):
    """Every fifth measurement of a demonstrated insertion, (n, 7)."""
    samples = demonstrations[0].samples
    return samples[["fx", "fy", "fz", "mx", "my", "mz", "z"]].to_numpy()[::5]


def set_measurement(dut, context, row):
    dut.GetInputPort("wrench").FixValue(context, row[:6])
    dut.GetInputPort("depth").FixValue(context, [-row[6]])


def probabilities(dut, context):
    return dut.GetOutputPort("probabilities").Eval(context).copy()


def test_the_estimate_equals_that_of_the_skills_own_filter(skill, measurements):
    dut = ContactStateEstimator(policy=skill, period=PERIOD)
    context = fixed_context(dut, wrench=measurements[0][:6], depth=[0.0])
    reference = skill.state_filter()
    belief = reference.initial_log_belief()
    for row in measurements:
        set_measurement(dut, context, row)
        expected = reference.step(belief, skill.measured_features(row))
        found = probabilities(dut, context)  # uses this measurement, before the update
        np.testing.assert_allclose(found, expected.probabilities, atol=1e-12)
        assert found.sum() == pytest.approx(1.0)
        assert dut.GetOutputPort("state").Eval(context)[0] == np.argmax(expected.probabilities)
        update(dut, context, period=PERIOD)
        belief = expected.log_belief


def test_the_belief_depends_on_past_measurements(skill, measurements):
    dut = ContactStateEstimator(policy=skill, period=PERIOD)
    one, other = fixed_context(dut), fixed_context(dut)
    for context, rows in ((one, measurements[:4]), (other, measurements[-4:])):
        for row in rows:
            set_measurement(dut, context, row)
            update(dut, context, period=PERIOD)
        set_measurement(dut, context, measurements[len(measurements) // 2])
    assert not np.array_equal(
        one.get_discrete_state(0).value(),
        other.get_discrete_state(0).value(),
    )


def test_the_belief_is_stored_in_the_context(skill, measurements):
    dut = ContactStateEstimator(policy=skill, period=PERIOD)

    def alone(rows):
        context = fixed_context(dut)
        for row in rows:
            set_measurement(dut, context, row)
            update(dut, context, period=PERIOD)
        return context.get_discrete_state(0).value().copy()

    forwards, backwards = alone(measurements), alone(measurements[::-1])
    a, b = fixed_context(dut), fixed_context(dut)
    for up, down in zip(measurements, measurements[::-1], strict=True):
        set_measurement(dut, a, up)
        set_measurement(dut, b, down)
        update(dut, a, period=PERIOD)
        update(dut, b, period=PERIOD)
    np.testing.assert_array_equal(a.get_discrete_state(0).value(), forwards)
    np.testing.assert_array_equal(b.get_discrete_state(0).value(), backwards)
