"""The self-test of a live session, and the rule that chooses its contact step."""

import time

import pytest

from experiments import self_test
from experiments.self_test import LONG_STEP, MARGIN, hold_pace, real_time_rate, with_long_step
from models.scenario import load_scenario
from systems.servo.multirate_margins import require_multirate_margins


def by_step(**rates):
    """Rates by the contact step in ms."""
    return lambda scenario: rates[f"ms{1e3 * scenario.contact.time_step:g}"]


@pytest.mark.parametrize(
    ("name", "rates", "step", "rate", "says"),
    [
        ("device", {"ms2": 2.0}, 0.002, 2.0, "contact every 2 ms runs at 2.00 times real time"),
        ("device", {"ms2": MARGIN}, 0.002, MARGIN, "contact every 2 ms runs at 1.25 times"),
        ("device", {"ms2": 0.65, "ms4": 1.3}, LONG_STEP, 1.3, "every 4 ms, at 1.30 times real time, in place of 2 ms"),
        ("device", {"ms2": 1.1, "ms4": 2.1}, LONG_STEP, 2.1, "at 2.10 times real time, in place of 2 ms, at 1.10"),
        ("device", {"ms2": 0.3, "ms4": 0.6}, LONG_STEP, 0.6, "too slow"),
        ("device", {"ms2": 0.6, "ms4": 0.6}, 0.002, 0.6, "too slow"),  # the servo is what is slow
        ("live", {"ms4": 1.1}, LONG_STEP, 1.1, "contact every 4 ms runs at 1.10 times real time"),
        ("live", {"ms4": 0.9}, LONG_STEP, 0.9, "0.90 times real time; this machine is too slow"),
    ],
)
def test_the_rule(name, rates, step, rate, says):
    asked = load_scenario(name)
    found = hold_pace(asked, by_step(**rates))
    assert found.scenario.contact.time_step == step
    assert found.rate == rate
    assert says in found.note
    assert ("too slow" in found.note) == (rate < 1.0)
    require_multirate_margins(found.scenario)


def test_a_coupling_that_a_long_step_makes_unstable_keeps_its_step():
    scenario = load_scenario("device")
    scenario.coupling.angular_damping *= 2.0
    require_multirate_margins(scenario)
    assert with_long_step(scenario) is None
    assert hold_pace(scenario, by_step(ms2=0.7)).scenario.contact.time_step == 0.002


def test_a_record_whose_samples_are_not_whole_steps_keeps_its_step():
    scenario = load_scenario("device")
    scenario.recorder.period = 0.006
    assert with_long_step(scenario) is None


def test_the_machine_is_measured_in_contact(monkeypatch):
    """A step that takes 50 ms longer is seen, and the peg touches the hole in each."""
    monkeypatch.setattr(self_test, "DURATION", 0.2)
    pressed = []
    real = self_test.MakeServedEnvironment

    def slow(scenario):
        environment = real(scenario)
        contact = type(environment).local_contact

        def local_contact(self, context, at):
            found = contact(self, context, at)
            pressed.append(len(found.springs.forces))
            time.sleep(0.05)
            return found

        monkeypatch.setattr(type(environment), "local_contact", local_contact)
        return environment

    monkeypatch.setattr(self_test, "MakeServedEnvironment", slow)
    rate = real_time_rate(load_scenario("live"))
    assert 0.0 < rate < 0.004 / 0.05
    assert min(pressed) > 0
