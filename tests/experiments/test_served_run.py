"""The simulation's side of the servo, with a servo whose clock the test sets."""

import numpy as np
import pytest

from experiments.demonstration_run import MAX_DELAY, ServedRun
from models.scenario import LIVE_STREAM, load_scenario, resolve_scenario
from systems.servo.probe import Probe
from systems.virtual_environment import start_pose


class LateServo:
    """Answers with a probe that is so much later than it was asked for."""

    def __init__(self, scenario):
        self.X_HD = start_pose(scenario)
        self.delay, self.asked, self.published = 0.0, [], []

    def begin(self, scenario):
        self.scenario = scenario

    def probe_at(self, servo_time):
        self.asked.append(servo_time)
        time = servo_time + self.delay
        return Probe(time, self.X_HD, np.zeros(6), np.zeros(6), 0.0, 0.0, 0.0, 1.0, 0.0, ticks=40, late=3)

    def publish(self, contact):
        self.published.append(contact.time)


@pytest.fixture
def served():
    scenario = resolve_scenario(load_scenario("live"), seed=1, stream=LIVE_STREAM)
    servo = LateServo(scenario)
    return ServedRun(scenario, servo), servo, scenario.contact.time_step


def test_a_step_simulates_one_period_and_publishes_for_its_end(served):
    run, servo, period = served
    for k in range(1, 4):
        assert run.step() is None
        assert (run.steps, run.time) == (k, pytest.approx(k * period))
        assert run.run.simulator.get_context().get_time() == pytest.approx(k * period)
    assert servo.asked == pytest.approx([0.0, 0.0, period, 2 * period])  # the first one starts the run
    assert servo.published == pytest.approx([period, 2 * period, 3 * period])
    assert (run.late_steps, run.steps) == (0, 3)
    assert (run.probe.late, run.probe.ticks) == (3, 40)


def test_a_short_delay_is_made_up_for_and_counted_when_longer_than_a_step(served):
    run, servo, period = served
    servo.delay = 0.5 * period
    run.step()
    servo.delay = 1.5 * period
    run.step()
    servo.delay = 0.0
    run.step()
    assert run.late_steps == 1
    assert servo.asked[1:] == pytest.approx([0.0, period, 2 * period])  # on the clock of before
    assert servo.published == pytest.approx([1.5 * period, 3.5 * period, 3 * period])


def test_after_a_long_delay_the_simulation_goes_on_from_the_present(served):
    run, servo, period = served
    servo.delay = MAX_DELAY + 0.01
    run.step()
    servo.delay = 0.0
    run.step()
    assert servo.asked[1:] == pytest.approx([0.0, period + MAX_DELAY + 0.01])
    assert run.time == pytest.approx(2 * period)
    assert run.late_steps == 1
