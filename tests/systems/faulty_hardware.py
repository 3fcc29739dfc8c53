"""Faults of the rig's hardware: subclasses of the hardware that misbehave, put into the rig for one trial."""

from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from unittest.mock import patch

import numpy as np

from systems import rig as rig_module
from systems.law import wiring as law_module
from systems.law.dc_motor import DcMotor
from systems.law.depth_encoder import DepthEncoder
from systems.law.faults import Fault
from systems.law.part import TIME
from systems.law.stepper_motor import StepperMotor
from systems.law.wrench_sensor import WrenchSensor


@contextmanager
def injected(name, onset):
    """Lets `systems.rig` build rigs with a fault of `KINDS` that begins at a time, s."""
    with ExitStack() as stack:
        for replacement in KINDS[name].make(onset):
            base = replacement.__bases__[0].__name__
            module = law_module if hasattr(law_module, base) else rig_module
            stack.enter_context(patch.object(module, base, replacement))
        yield


@dataclass(frozen=True)
class Kind:
    """A kind of fault: makes classes for a fault that begins at a time (s), and how the rig may name it."""

    make: object
    named: frozenset = field(default_factory=frozenset)


def sensor(change):
    """A sensor whose reading is changed: ``change`` takes it, the time since the fault (s), and a memory."""

    def make(onset):
        memory = {"rng": np.random.default_rng(42)}

        class FaultySensor(WrenchSensor):
            def _calc_wrench(self, context, output):
                super()._calc_wrench(context, output)
                changed(output, context, onset, change, memory)

        return [FaultySensor]

    return make


def encoder(change):
    """Likewise a depth encoder."""

    def make(onset):
        memory = {}

        class FaultyEncoder(DepthEncoder):
            def _calc(self, context, output):
                super()._calc(context, output)
                changed(output, context, onset, change, memory)

        return [FaultyEncoder]

    return make


def changed(output, context, onset, change, memory):
    since = context.get_time() - onset
    if since >= -1e-9:
        output.SetFromVector(np.atleast_1d(change(output.value().copy(), since, memory)))


def runaway(speed):
    """A feed drive that follows a speed (m/s) of its own."""

    def make(onset):
        class FaultyMotor(DcMotor):
            def _update(self, context, discrete_state):
                own = self._step
                if context.get_time() >= onset - 1e-9:
                    self._step = lambda state, command, *others: own(state, speed, *others)
                super()._update(context, discrete_state)
                self._step = own

        return [FaultyMotor]

    return make


def dead_feed(onset):
    """A feed drive whose amplifier gives no current; the brake relay still works."""

    class DeadMotor(DcMotor):
        def _update(self, context, discrete_state):
            super()._update(context, discrete_state)
            if context.get_time() >= onset - 1e-9 and self.GetInputPort("enabled").Eval(context)[0]:
                discrete_state.get_mutable_vector(self._state).SetFromVector([0.0, 0.0])

    return [DeadMotor]


def blocked_stepper(onset):
    """The first stepper of a rig, that of pitch, does not turn from the onset on."""
    blocked = {}  # the stepper, and the angle at which it is held

    class FaultyStepper(StepperMotor):
        def declare_output(self, name, size, calc, *reads):
            if name == "equilibrium_angle" and blocked.setdefault("stepper", self) is self:
                turn = calc
                calc = lambda state, time: turn(state) if time < onset else blocked.setdefault("angle", turn(state))  # noqa: E731
                reads = [TIME]
            super().declare_output(name, size, calc, *reads)

    return [FaultyStepper]


def noise(force, torque):
    sigma = np.repeat([force, torque], 3)
    return lambda wrench, since, memory: wrench + sigma * memory["rng"].standard_normal(6)


def frozen(reading, since, memory):
    return memory.setdefault("first", reading)


def frozen_with_noise(wrench, since, memory):
    return noise(0.02, 5e-4)(frozen(wrench, since, memory), since, memory)


def spikes(period):
    """A spike of 100 N on fz for 1 ms in every period (s)."""
    return lambda wrench, since, memory: wrench + np.eye(6)[2] * (100.0 if since % period < 1e-3 - 1e-9 else 0.0)


BIAS = np.repeat([15.0, 1.0], 3)

KINDS = {
    "sensor disconnected": Kind(sensor(lambda w, t, m: np.full(6, np.nan)), {Fault.SENSOR_DISCONNECTED}),
    "sensor saturated": Kind(sensor(lambda w, t, m: np.array([*w[:2], 290.0, *w[3:]])), {Fault.SENSOR_SATURATED}),
    "sensor stuck": Kind(sensor(frozen), {Fault.SENSOR_STUCK}),
    "sensor frozen, with noise": Kind(sensor(frozen_with_noise), {Fault.MOTOR_STALLED}),
    "sensor bias 15 N, 1 N m": Kind(sensor(lambda w, t, m: w + BIAS), {Fault.SENSOR_BIASED}),
    "sensor noise 5 N, 0.1 N m": Kind(sensor(noise(5.0, 0.1)), {Fault.SENSOR_NOISY}),
    "sensor spikes, ten a second": Kind(sensor(spikes(0.1)), {Fault.SENSOR_SPIKES}),
    "sensor, one spike": Kind(sensor(spikes(1e3))),
    "encoder disconnected": Kind(encoder(lambda d, t, m: np.array([np.nan])), {Fault.ENCODER_DISCONNECTED}),
    "encoder jumped by 4 mm": Kind(encoder(lambda d, t, m: d + 4e-3), {Fault.ENCODER_JUMPED}),
    "encoder stuck": Kind(encoder(frozen), {Fault.ENCODER_STUCK}),
    "encoder drift 2 mm/s": Kind(encoder(lambda d, t, m: d + 2e-3 * t), {Fault.ENCODER_STUCK}),
    "feed runs away into the hole": Kind(runaway(-1.0), {Fault.FEED_RUNS_AWAY, Fault.LOWER_TRAVEL_LIMIT}),
    "feed runs away upwards": Kind(runaway(1.0), {Fault.FEED_RUNS_AWAY}),
    "feed dead": Kind(dead_feed, {Fault.FEED_DEAD}),
    "pitch blocked": Kind(blocked_stepper, {Fault.PITCH_STEPS_LOST}),
}
