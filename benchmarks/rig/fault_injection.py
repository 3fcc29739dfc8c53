"""Faults of the rig's hardware: subclasses of the hardware that misbehave, put into the rig for one trial.

The product knows none of this: `injected` replaces the classes that `systems.rig` builds, within a ``with`` statement.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any
from unittest.mock import patch

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, InputPort

from skill.arrays import Array
from systems import law as law_module
from systems import rig as rig_module
from systems.hardware.dc_motor import DcMotor
from systems.hardware.depth_encoder import DepthEncoder
from systems.hardware.stepper_motor import StepperMotor
from systems.hardware.wrench_sensor import WrenchSensor
from systems.steps.faults import Fault

Change = Callable[[Array, float, dict[str, Any]], Array]
"""Returns a faulty reading from the sound one, the time since the fault began (s), and a memory of one trial."""


@dataclass(frozen=True)
class Kind:
    """A kind of fault.

    Attributes:
        classes: returns the classes that replace those of `systems.rig`, by their names, for a fault that begins at a
            time (s) and whose random numbers have a seed.
        named: the faults that name it; empty if it must not be reported, because the rig must cope with it.
        built_in: whether it is there from the start, as after a wrong installation; else it begins during the trial.
    """

    classes: Callable[[float, int], dict[str, type]]
    named: frozenset[Fault]
    built_in: bool = False

    def onset(self, seed: int) -> float:
        """Returns the time at which the fault of this seed begins, s."""
        return 0.0 if self.built_in else float(np.random.default_rng([41, seed]).uniform(0.1, 1.0))


@contextmanager
def injected(kind: Kind, *, onset: float, seed: int) -> Iterator[None]:
    """Lets `systems.rig` build rigs with this fault."""
    with ExitStack() as stack:
        for name, replacement in kind.classes(onset, seed).items():
            module = law_module if hasattr(law_module, name) else rig_module
            stack.enter_context(patch.object(module, name, replacement))
        yield


def _reading(base: type, method: str, change: Change) -> Callable[[float, int], type]:
    """Returns a maker of subclasses of a sensor whose output ``method`` is changed."""

    def make(onset: float, seed: int) -> type:
        memory: dict[str, Any] = {"rng": np.random.default_rng([42, seed])}

        def calc(self: Any, context: Context, output: BasicVector) -> None:
            getattr(base, method)(self, context, output)
            since = context.get_time() - onset
            if since >= -1e-9:
                output.SetFromVector(np.atleast_1d(change(output.value().copy(), since, memory)))

        return type(f"Faulty{base.__name__}", (base,), {method: calc})

    return make


def sensor(change: Change) -> Callable[[float, int], dict[str, type]]:
    """A force/torque sensor whose wrench about the tip is changed."""
    make = _reading(WrenchSensor, "_calc_wrench", change)
    return lambda onset, seed: {"WrenchSensor": make(onset, seed)}


def encoder(change: Change) -> Callable[[float, int], dict[str, type]]:
    """A depth encoder whose depth is changed."""
    make = _reading(DepthEncoder, "_calc", change)
    return lambda onset, seed: {"DepthEncoder": make(onset, seed)}


class _ChangedCommand:
    """An input port of a drive that receives another command than the one that was sent."""

    def __init__(self, port: InputPort, change: Callable[[float], float], onset: float) -> None:
        self._port, self._change, self._onset = port, change, onset

    def Eval(self, context: Context) -> Array:
        command = self._port.Eval(context)
        return np.array([self._change(command[0])]) if context.get_time() >= self._onset - 1e-9 else command


def disobedient_feed(change: Callable[[float], float]) -> Callable[[float, int], dict[str, type]]:
    """A feed drive that obeys a changed command (m/s)."""

    def make(onset: float, seed: int) -> dict[str, type]:
        class FaultyMotor(DcMotor):
            def __init__(self, **arguments: Any) -> None:
                super().__init__(**arguments)
                self._speed_command = _ChangedCommand(self._speed_command, change, onset)

        return {"DcMotor": FaultyMotor}

    return make


def dead_feed(onset: float, seed: int) -> dict[str, type]:
    """A feed drive whose amplifier gives no current; the brake relay still works."""

    class DeadMotor(DcMotor):
        def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
            super()._update(context, discrete_state)
            if context.get_time() >= onset - 1e-9 and self._enabled.Eval(context)[0]:
                discrete_state.get_mutable_vector(self._state).SetFromVector([0.0, 0.0])

    return {"DcMotor": DeadMotor}


def sticking_stepper(axis: int, held: Callable[[float], bool]) -> Callable[[float, int], dict[str, type]]:
    """A stepper axis (0: pitch, 1: yaw) that does not turn while ``held`` of the time since the onset (s) is true."""

    def make(onset: float, seed: int) -> dict[str, type]:
        built: list[StepperMotor] = []

        class FaultyStepper(StepperMotor):
            def __init__(self, **arguments: Any) -> None:
                super().__init__(**arguments)
                built.append(self)
                self._faulty = len(built) == axis + 1
                self._held_angle: float | None = None

            def _calc_equilibrium(self, context: Context, output: BasicVector) -> None:
                super()._calc_equilibrium(context, output)
                since = context.get_time() - onset
                if not (self._faulty and since >= 0.0 and held(since)):
                    self._held_angle = None
                    return
                if self._held_angle is None:
                    self._held_angle = output[0]
                output[0] = self._held_angle

        return {"StepperMotor": FaultyStepper}

    return make


def _scaled(factors: list[float]) -> Change:
    return lambda wrench, since, memory: wrench * np.array(factors)


def _swapped(order: list[int]) -> Change:
    return lambda wrench, since, memory: wrench[order]


def _frozen(reading: Array, since: float, memory: dict[str, Any]) -> Array:
    first: Array = memory.setdefault("first", reading)
    return first


def _noise(force: float, torque: float) -> Change:
    sigma = np.repeat([force, torque], 3)
    return lambda wrench, since, memory: wrench + sigma * memory["rng"].standard_normal(6)


def _frozen_with_noise(wrench: Array, since: float, memory: dict[str, Any]) -> Array:
    return _noise(0.02, 5e-4)(_frozen(wrench, since, memory), since, memory)


def _late(delay: float) -> Change:
    """A reading of a time ``delay`` ago (s); before that, the sensor has measured free air."""

    def change(wrench: Array, since: float, memory: dict[str, Any]) -> Array:
        line: list[tuple[float, Array]] = memory.setdefault("line", [])
        line.append((since, wrench))
        if since < delay:
            return _noise(0.02, 5e-4)(line[0][1], since, memory)
        while len(line) > 1 and line[1][0] <= since - delay:
            line.pop(0)
        return line[0][1]

    return change


def _spikes(period: float, width: float) -> Change:
    """A spike of two channels at the mount by 80 N, of ``width`` (s), once within each period (s)."""

    def change(wrench: Array, since: float, memory: dict[str, Any]) -> Array:
        hit = since % period < width - 1e-9
        return wrench + np.array([80.0, 0.0, -80.0, 0.0, 6.4, 0.0]) if hit else wrench

    return change


READS_WRONG = frozenset(
    {
        Fault.SENSOR_REVERSED,
        Fault.SENSOR_LOW,
        Fault.SENSOR_HIGH,
        Fault.SENSOR_CROSSED,
        Fault.SENSOR_MOMENT,
        Fault.SENSOR_BIASED,
    }
)
"""Names of a sensor whose readings contradict the drives or each other."""

RUNS_AWAY = frozenset({Fault.FEED_RUNS_AWAY, Fault.FEED_REVERSED})
"""A feed that runs one way is reversed whenever it is commanded the other way, as a guard does that yields."""

CONTRADICTED = frozenset({Fault.ENCODER_CONTRADICTED, Fault.ENCODER_STUCK})
DRIFT = np.repeat([5.0, 0.1], 3)  # in units of N/s and N m/s
BIAS = np.repeat([15.0, 1.0], 3)  # in units of N and N m
SINGLE = 1e3  # in units of s; a spike period beyond every trial


def _only(*faults: Fault) -> frozenset[Fault]:
    return frozenset(faults)


KINDS: dict[str, Kind] = {
    "sensor disconnected": Kind(sensor(lambda w, t, m: np.full(6, np.nan)), _only(Fault.SENSOR_DISCONNECTED)),
    "sensor saturated": Kind(sensor(lambda w, t, m: np.array([*w[:2], 290.0, *w[3:]])), _only(Fault.SENSOR_SATURATED)),
    "sensor stuck": Kind(sensor(_frozen), _only(Fault.SENSOR_STUCK)),
    "sensor frozen, with noise": Kind(sensor(_frozen_with_noise), READS_WRONG),
    "sensor 500 ms late": Kind(sensor(_late(0.5)), READS_WRONG, built_in=True),
    "sensor gain 0.1": Kind(sensor(_scaled([0.1] * 6)), _only(Fault.SENSOR_LOW), built_in=True),
    "sensor gain 0.3": Kind(sensor(_scaled([0.3] * 6)), _only(Fault.SENSOR_LOW), built_in=True),
    "sensor gain 3": Kind(sensor(_scaled([3.0] * 6)), _only(Fault.SENSOR_HIGH), built_in=True),
    "sensor sign, all channels": Kind(sensor(_scaled([-1.0] * 6)), _only(Fault.SENSOR_REVERSED), built_in=True),
    "sensor sign of fz": Kind(sensor(_scaled([1, 1, -1, 1, 1, 1])), _only(Fault.SENSOR_REVERSED), built_in=True),
    "sensor sign of fx and fy": Kind(sensor(_scaled([-1, -1, 1, 1, 1, 1])), READS_WRONG, built_in=True),
    "sensor sign of mx and my": Kind(sensor(_scaled([1, 1, 1, -1, -1, 1])), READS_WRONG, built_in=True),
    "sensor x and y swapped": Kind(sensor(_swapped([1, 0, 2, 4, 3, 5])), READS_WRONG, built_in=True),
    "sensor x and z swapped": Kind(sensor(_swapped([2, 1, 0, 5, 4, 3])), READS_WRONG, built_in=True),
    "sensor bias 15 N, 1 N m": Kind(sensor(lambda w, t, m: w + BIAS), READS_WRONG, built_in=True),
    "sensor drift 5 N/s, 0.1 N m/s": Kind(sensor(lambda w, t, m: w + t * DRIFT), READS_WRONG, built_in=True),
    "sensor noise 5 N, 0.1 N m": Kind(sensor(_noise(5.0, 0.1)), _only(Fault.SENSOR_NOISY), built_in=True),
    "sensor spikes, ten a second": Kind(sensor(_spikes(0.1, 1e-3)), _only(Fault.SENSOR_SPIKES)),
    "sensor, one spike": Kind(sensor(_spikes(SINGLE, 1e-3)), frozenset()),
    "encoder disconnected": Kind(encoder(lambda d, t, m: np.array([np.nan])), _only(Fault.ENCODER_DISCONNECTED)),
    "encoder jumped by 4 mm": Kind(encoder(lambda d, t, m: d + 4e-3), _only(Fault.ENCODER_JUMPED)),
    "encoder stuck": Kind(encoder(_frozen), _only(Fault.ENCODER_STUCK)),
    "encoder drift 2 mm/s": Kind(encoder(lambda d, t, m: d + 2e-3 * t), CONTRADICTED),
    "encoder scale 0.8": Kind(encoder(lambda d, t, m: 0.8 * d), CONTRADICTED, built_in=True),
    "encoder scale 1.2": Kind(encoder(lambda d, t, m: 1.2 * d), CONTRADICTED, built_in=True),
    "encoder sign": Kind(encoder(lambda d, t, m: -d), CONTRADICTED, built_in=True),
    "feed runs away into the hole": Kind(disobedient_feed(lambda c: -1.0), RUNS_AWAY),
    "feed runs away upwards": Kind(disobedient_feed(lambda c: 1.0), RUNS_AWAY),
    "feed reversed": Kind(disobedient_feed(lambda c: -c), _only(Fault.FEED_REVERSED), built_in=True),
    "feed dead": Kind(dead_feed, _only(Fault.FEED_DEAD)),
    "pitch blocked": Kind(sticking_stepper(0, lambda t: True), _only(Fault.PITCH_STEPS_LOST, Fault.PITCH_STICKS)),
    "yaw blocked": Kind(sticking_stepper(1, lambda t: True), _only(Fault.YAW_STEPS_LOST, Fault.YAW_STICKS)),
    "pitch sticks now and then": Kind(
        sticking_stepper(0, lambda t: t % 0.5 < 0.3), _only(Fault.PITCH_STEPS_LOST, Fault.PITCH_STICKS)
    ),
    "yaw sticks now and then": Kind(
        sticking_stepper(1, lambda t: t % 0.5 < 0.3), _only(Fault.YAW_STEPS_LOST, Fault.YAW_STICKS)
    ),
}
"""All kinds, by their names."""
