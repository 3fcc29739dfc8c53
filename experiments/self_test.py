"""A second's test of a machine before a live session, and the rule by which the session holds real time there.

The rule: the contact step of the scenario, if the machine simulates contact at least `MARGIN` times as fast as time
passes; else `LONG_STEP`, if that does, or is faster. The margin is for what else runs in a session: the page, its
browser, and the contacts that take longer than those of the test.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from experiments.demonstration_run import DemonstrationRun
from models.hardware import DEVICE_PRESETS
from models.scenario import LIVE_STREAM, Scenario, resolve_scenario
from models.validation import copied, is_multiple
from systems.math.rotation import from_rotation_vector
from systems.operators.device_operator import DeviceOperator
from systems.operators.loopback_device import LoopbackDevice
from systems.servo.multirate_margins import require_multirate_margins
from systems.servo.probe import Probe
from systems.servo.served_environment import MakeServedEnvironment
from systems.servo.servo_diagram import MakeServo
from systems.servo.servo_process import REST

MARGIN = 1.25
"""Rate of the self-test over real time that a session needs."""

LONG_STEP = 0.004
"""Longest contact step that the rule chooses, s: that of the scenario ``live``."""

DURATION = 0.5
"""Time of the test of a contact step, s."""

SETTLING = 0.1
"""Simulated time, s, after which the pressed peg is in contact."""

PRESS = RigidTransform(from_rotation_vector(np.array([0.0, math.radians(3.0), 0.0])), np.array([0.002, 0.0, -0.012]))
"""Motion of the probe that presses a peg against the hole."""


@dataclass(frozen=True)
class HeldPace:
    """What a session does on this machine.

    Attributes:
        scenario: with the contact step of the session.
        rate: simulated time over wall-clock time in contact, in the test.
        note: what was chosen and why, in a line.
    """

    scenario: Scenario
    rate: float
    note: str


def hold_pace(scenario: Scenario, rate_of: Callable[[Scenario], float] | None = None) -> HeldPace:
    """Tests the machine and applies the rule of this module.

    Args:
        scenario: of a live session, with ranges.
        rate_of: measures the rate of a scenario; None is `real_time_rate`.
    """
    measure = rate_of or real_time_rate
    asked = 1e3 * scenario.contact.time_step
    rate, slower = measure(scenario), with_long_step(scenario)
    note = f"self-test: contact every {asked:g} ms runs at {rate:.2f} times real time"
    if rate < MARGIN and slower is not None:
        lowered = measure(slower)
        if lowered > rate:
            note = (
                f"self-test: contact every {1e3 * LONG_STEP:g} ms, at {lowered:.2f} times real time, in place of"
                f" {asked:g} ms, at {rate:.2f} (expected {MARGIN:g})"
            )
            scenario, rate = slower, lowered
    if rate < 1.0:
        note += "; this machine is too slow: forces come late. Close other programs"
    return HeldPace(scenario, rate, note)


def with_long_step(scenario: Scenario) -> Scenario | None:
    """Returns the scenario with `LONG_STEP`; None if its step is as long, or coupling or sampling do not permit it."""
    if scenario.contact.time_step >= LONG_STEP or not is_multiple(scenario.recorder.period, LONG_STEP):
        return None
    slower: Scenario = copied(scenario)
    slower.contact.time_step = LONG_STEP
    try:
        require_multirate_margins(slower)
    except ValueError:
        return None
    return slower


def real_time_rate(scenario: Scenario) -> float:
    """Returns simulated time over wall-clock time of a peg that is pressed against the hole, the slower of two.

    One is that of contact steps, with the local model of the contact; the other that of ticks of the servo, with the
    shortest sleep of each, which includes how late this machine wakes up.
    """
    resolved = resolve_scenario(scenario, seed=0, stream=LIVE_STREAM)
    environment = MakeServedEnvironment(resolved)
    run, step = DemonstrationRun(resolved, environment), resolved.contact.time_step
    context, start = run.simulator.get_mutable_context(), environment.X_HP_start
    pressed = RigidTransform(start.rotation() @ PRESS.rotation(), PRESS.translation())
    none = np.zeros(6)
    environment.set_probe(context, Probe(0.0, pressed, none, none, load=0, energy=0, min_energy=0, gain=1, age=0))
    run.advance(SETTLING)
    steps, began = 0, time.monotonic()
    while time.monotonic() - began < DURATION:
        steps += 1
        end = SETTLING + steps * step
        run.advance(end)
        contact = environment.local_contact(context, end)
    of_steps = steps * step / (time.monotonic() - began)

    period = DEVICE_PRESETS[resolved.device].servo_period
    operator = DeviceOperator(device=LoopbackDevice(lambda elapsed: none), period=period, X_HD_start=start)
    servo = MakeServo(resolved, operator=operator, X_HP_start=start)
    servo.start(start)
    servo.set_contact(contact)
    servo.tick()  # the first one is slow
    ticks, began = 0, time.monotonic()
    while time.monotonic() - began < 0.5 * DURATION:
        ticks += 1
        servo.tick()
        servo.probe().as_vector()
        time.sleep(REST)
    return min(of_steps, ticks * period / (time.monotonic() - began))
