"""A demonstration whose servo has a process of its own, at the pace of the servo's clock."""

from __future__ import annotations

from experiments.demonstration_run import DemonstrationRun
from models.scenario import Scenario
from skill.data.outcome import Ending
from systems.servo.probe import Probe
from systems.servo.served_environment import MakeServedEnvironment
from systems.servo.servo_client import ServoClient

MAX_DELAY = 0.008
"""Longest delay of the simulation, s, that is made up for. After a longer one the simulation goes on from the present,
so that the servo's model of the contact stays younger than `systems.servo.stale_contact_fade.HOLD`."""


class ServedRun:
    """A demonstration in progress.

    Args:
        scenario: resolved.
        servo: of the person's device.

    Attributes:
        environment: that is simulated.
        run: the demonstration.
        probe: the newest that the servo has sent.
        steps: number of contact steps so far.
        late_steps: number of them that began after the end of their time.
    """

    def __init__(self, scenario: Scenario, servo: ServoClient) -> None:
        self.environment = MakeServedEnvironment(scenario)
        self.run = DemonstrationRun(scenario, self.environment)
        self._servo, self._period = servo, scenario.contact.time_step
        self.steps = self.late_steps = 0
        self._start = 0.0  # servo time at which the simulation would have begun without delays
        servo.begin(scenario)
        self.probe: Probe = servo.probe_at(0.0)

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self.steps * self._period

    def step(self) -> Ending | None:
        """Waits for the time of the next contact step and simulates it; returns how the demonstration ended, or None.

        Raises:
            OSError: if the servo is lost.
        """
        self.probe = self._servo.probe_at(self._start + self.time)
        behind = self.probe.time - self._start - self.time
        self.late_steps += int(behind > self._period)
        if behind > MAX_DELAY:
            self._start += behind
        context = self.run.simulator.get_mutable_context()
        self.environment.set_probe(context, self.probe)
        self.steps += 1
        ending = self.run.advance(self.time)
        self._servo.publish(self.environment.local_contact(context, self.probe.time + self._period))
        return ending
