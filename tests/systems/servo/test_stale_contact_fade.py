"""The gain of the force over the age of the local model of the contact."""

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform

from systems.servo.local_contact import LocalContact, Springs
from systems.servo.stale_contact_fade import FADE, HOLD, RISE, StaleContactFade

H = 1e-3
WRENCH = np.array([0.1, 0.0, 0.0, 0.0, 2.0, -3.0])


@pytest.fixture
def fade():
    return StaleContactFade(period=H)


def gains(fade, times, *, model_time=lambda t: 0.0, closed=lambda t: 1.0):
    context = fade.CreateDefaultContext()
    fade.GetInputPort("virtual_wrench").FixValue(context, WRENCH)
    found = []
    for t in times:
        model = LocalContact(model_time(t), RigidTransform(), np.zeros(6), Springs.none())
        context.SetTime(t)
        fade.GetInputPort("contact").FixValue(context, Value(model))
        fade.GetInputPort("closed").FixValue(context, [closed(t)])
        state = fade.EvalUniquePeriodicDiscreteUpdate(context)
        context.get_mutable_discrete_state().SetFrom(state)
        found.append(fade.GetOutputPort("gain").Eval(context)[0])
        np.testing.assert_allclose(fade.GetOutputPort("faded_wrench").Eval(context), found[-1] * WRENCH)
    return np.array(found)


def test_the_last_model_holds_then_decays(fade):
    times = np.arange(0.0, 0.1, H)
    expected = np.clip(1.0 - (times - HOLD) / FADE, 0.0, 1.0)
    np.testing.assert_allclose(gains(fade, times), expected, atol=1e-12)
    assert expected[-1] == 0.0


def test_the_force_returns_slowly(fade):
    """The simulation goes on after 0.1 s: the gain rises by 1/RISE a second, to one."""
    times = np.arange(0.0, 0.3, H)
    found = gains(fade, times, model_time=lambda t: 0.0 if t < 0.1 else t)
    after = times >= 0.1 - 1e-9
    np.testing.assert_allclose(found[after], np.minimum(1.0, (np.arange(after.sum()) + 1) * H / RISE), atol=1e-9)


def test_a_servo_that_stood_still_takes_the_force_away_at_once(fade):
    times = np.arange(0.0, 0.02, H)
    found = gains(fade, times, model_time=lambda t: t, closed=lambda t: float(abs(t - 0.005) > 1e-9))
    assert found[4] == 1.0
    assert found[5] == 0.0
    assert found[6] == pytest.approx(H / RISE)
