"""Steps servo and simulation in turn in one process, without a clock: the same every time."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

from experiments.demonstration_run import DemonstrationRun
from skill.data.outcome import Ending
from systems.servo.local_contact import LocalContact
from systems.servo.probe import Probe
from systems.servo.served_environment import ServedEnvironment
from systems.servo.servo_diagram import Servo


def lockstep(
    servo: Servo, run: DemonstrationRun, environment: ServedEnvironment, *, time_step: float, delay: int = 0
) -> Iterator[tuple[Probe, Ending | None]]:
    """Yields the probe before each tick, and how the demonstration ended, if it did.

    The simulation takes the probe at the start of each contact step, and simulates the step while its time passes. Its
    model of the contact reaches the servo ``delay`` ticks after the end of the step, or before it if that is negative.

    Args:
        servo: started.
        run: of the environment.
        environment: of the same scenario as the servo.
        time_step: of the contact, s; a multiple of the servo's period.
        delay: number of ticks.

    Raises:
        ValueError: if the delay is shorter than a step.
    """
    ticks = round(time_step / servo.period)
    if delay < -ticks:
        raise ValueError(f"delay is {delay}, expected at least {-ticks}: a model cannot arrive before its step begins")
    waiting: list[tuple[int, LocalContact]] = []
    ending = None
    for k in count():
        probe = servo.probe()
        yield probe, ending
        if ending is not None:
            return
        if k % ticks == 0:
            context = run.simulator.get_mutable_context()
            environment.set_probe(context, probe)
            ending = run.advance((k + ticks) * servo.period)
            waiting.append((k + ticks + delay, environment.local_contact(context, (k + ticks) * servo.period)))
        while waiting and waiting[0][0] <= k:
            servo.set_contact(waiting.pop(0)[1])
        servo.tick()
