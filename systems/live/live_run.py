"""The demonstration of a live session in progress: in one process, or with the servo in a process of its own."""

from __future__ import annotations

import time
from typing import Protocol

from pydrake.math import RigidTransform

from models.hardware import DEVICE_PRESETS
from models.scenario import Scenario
from skill.data.outcome import Ending
from systems.live.clock import Clock, Deadlines
from systems.runs.demonstration_run import DemonstrationRun
from systems.servo.served_run import ServedRun
from systems.servo.servo_client import ServoClient
from systems.virtual_environment import PegEnvironment, ProbeEnergy, RenderedWrench, VirtualEnvironment


class LiveRun(Protocol):
    """A demonstration that follows the wall's clock."""

    @property
    def run(self) -> DemonstrationRun:
        """The demonstration."""

    @property
    def environment(self) -> PegEnvironment:
        """What is simulated."""

    @property
    def time(self) -> float:
        """Simulated time, s."""

    @property
    def deadlines(self) -> Deadlines:
        """The deadlines that were missed so far."""

    def advance(self) -> Ending | None:
        """Simulates a period of the recorder, or until the demonstration ends; returns how it ended, or None."""

    def rendered(self) -> RenderedWrench:
        """Returns what the device renders now."""

    def energy(self) -> ProbeEnergy:
        """Returns the energy that the hand has put in."""

    def hand(self) -> RigidTransform:
        """Returns the pose X_HD of the probe."""

    def end(self) -> None:
        """Ends the demonstration."""


class InProcessRun:
    """A demonstration by sliders, keys and gamepad of the page: everything is in one diagram and one thread.

    Args:
        scenario: resolved.
        environment: of the scenario, whose operator reads the page.
        run: of the environment.

    Attributes:
        environment, run: see `LiveRun`.
    """

    def __init__(self, scenario: Scenario, environment: VirtualEnvironment, run: DemonstrationRun) -> None:
        self.environment, self.run = environment, run
        period = DEVICE_PRESETS[scenario.device].servo_period
        ticks_per_step = max(1, round(scenario.contact.time_step / period))
        self._ticks = round(scenario.recorder.period / period)
        self._clock = Clock(period=period, ticks_per_step=ticks_per_step, start=time.monotonic())

    @property
    def time(self) -> float:
        """See `LiveRun`."""
        return self._clock.time

    @property
    def deadlines(self) -> Deadlines:
        """See `LiveRun`."""
        return self._clock.deadlines

    def advance(self) -> Ending | None:
        """See `LiveRun`."""
        for _ in range(self._ticks):
            ending = self.run.advance(self._clock.next_time)
            self._clock.end_tick()
            if ending is not None:
                return ending
        return None

    def rendered(self) -> RenderedWrench:
        """See `LiveRun`."""
        return self.environment.rendered_wrench(self.run.simulator.get_context())

    def energy(self) -> ProbeEnergy:
        """See `LiveRun`."""
        return self.environment.energy(self.run.simulator.get_context())

    def hand(self) -> RigidTransform:
        """See `LiveRun`."""
        return self.environment.probe_pose(self.run.simulator.get_context())

    def end(self) -> None:
        """Does nothing."""


class ServoRun:
    """A demonstration with a device, which the servo's process drives at 1 kHz.

    Args:
        scenario: resolved.
        servo: of the device.

    Attributes:
        environment, run: see `LiveRun`.

    Raises:
        OSError: here and from `advance` and `end`, if the servo or its device is lost.
    """

    def __init__(self, scenario: Scenario, servo: ServoClient) -> None:
        self._servo, self._served = servo, ServedRun(scenario, servo)
        self.environment, self.run = self._served.environment, self._served.run
        self._steps = max(1, round(scenario.recorder.period / scenario.contact.time_step))

    @property
    def time(self) -> float:
        """See `LiveRun`."""
        return self._served.time

    @property
    def deadlines(self) -> Deadlines:
        """See `LiveRun`."""
        served = self._served
        return Deadlines(served.late_steps, served.steps, served.probe.late, served.probe.ticks)

    def advance(self) -> Ending | None:
        """See `LiveRun`."""
        for _ in range(self._steps):
            ending = self._served.step()
            if ending is not None:
                return ending
        return None

    def rendered(self) -> RenderedWrench:
        """See `LiveRun`."""
        return RenderedWrench(self._served.probe.wrench, self._served.probe.load)

    def energy(self) -> ProbeEnergy:
        """See `LiveRun`."""
        return ProbeEnergy(self._served.probe.energy, self._served.probe.min_energy)

    def hand(self) -> RigidTransform:
        """See `LiveRun`."""
        return self._served.probe.X_HD

    def end(self) -> None:
        """Ends the ticks: the device is without force until the next demonstration."""
        self._servo.end()
