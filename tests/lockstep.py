"""Steps servo and simulation in turn in one process, without a clock: the same every time."""

from itertools import count


def lockstep(servo, run, environment, *, time_step):
    """Yields the probe before each tick until the demonstration ends.

    The simulation takes the probe at the start of each contact step, and simulates the step while its time passes. Its
    model of the contact reaches the servo a tick before the end of the step: a step is simulated in less than its time.

    Args:
        servo: started.
        run: of the environment.
        environment: of the same scenario as the servo.
        time_step: of the contact, s; a multiple of the servo's period.
    """
    ticks = round(time_step / servo.period)
    for k in count():
        probe = servo.probe()
        yield probe
        if k % ticks == 0:
            environment.set_probe(run.simulator.get_mutable_context(), probe)
            end = (k + ticks) * servo.period
            if run.advance(end) is not None:
                return
            model = environment.local_contact(run.simulator.get_context(), end)
        if k % ticks == ticks - 1:
            servo.set_contact(model)
        servo.tick()
