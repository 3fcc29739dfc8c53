"""The six-axis force/torque sensor between the carriage and the peg."""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.multibody.math import SpatialForce
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, ValueProducer

from compiled import compiled
from models.hardware import WrenchSensorParameters
from skill.arrays import Array, assign
from systems.math.noise import standard_normal


class Sensor(NamedTuple):
    """A sensor; see `models.hardware.WrenchSensorParameters`. Arrays have its six channels.

    Attributes:
        height: h above the tip, m.
        blend: 1 - e^{-2 pi f_c T}.
        sigma: standard deviations of the noise.
        range: largest readings.
        quantum: of the readings.
        drift: delta sqrt(T).
        delay: number of periods.
    """

    height: float
    blend: float
    sigma: Array
    range: Array
    quantum: Array
    drift: Array
    delay: int

    @classmethod
    def of(cls, p: WrenchSensorParameters) -> Self:
        """Returns the sensor."""
        return cls(
            p.height,
            p.blend,
            np.array([*p.force_noise, *p.torque_noise]),
            np.array([*p.force_range, *p.torque_range]),
            np.repeat([p.force_quantum, p.torque_quantum], 3),
            np.repeat([p.force_drift, p.torque_drift], 3) * math.sqrt(p.period),
            round(p.delay / p.period),
        )

    def initial_state(self) -> Array:
        """Returns the state at the start: filtered wrench (6), drift (6), and the readings of the delay (6 each)."""
        return np.zeros(12 + 6 * (self.delay + 1))


@compiled
def wrench_sensor_step(p: Sensor, state: Array, held: Array, bias: Array, noise: Array) -> Array:
    """Returns the next state; the newest reading comes first, the last one is the output.

    In each channel, with n and w ~ N(0, 1),

        y <- y + (1 - e^{-2 pi f_c T}) (-(F_S - F_tare) - y),
        d <- d + delta sqrt(T) w,
        reading = quantise(clip(y + bias + d + sigma n)).

    Args:
        p: the sensor.
        state: after the last period; see `Sensor.initial_state`.
        held: (6,), F_S - F_tare, of the carriage on the peg, about the mount, N and N m.
        bias: (6,).
        noise: (12,), n, then w.
    """
    found = np.empty_like(state)
    for i in range(6):
        found[i] = state[i] - p.blend * (held[i] + state[i])
        found[6 + i] = state[6 + i] + p.drift[i] * noise[6 + i]
        noisy = found[i] + bias[i] + found[6 + i] + p.sigma[i] * noise[i]
        clipped = min(max(noisy, -p.range[i]), p.range[i])
        found[12 + i] = np.rint(clipped / p.quantum[i]) * p.quantum[i]
    assign(found[18:], state[12:-6])
    return found


@compiled
def wrench_at_tip(wrench: Array, height: float) -> Array:
    """Returns a wrench about the tip.

    Args:
        wrench: Force (N), then moment (N m), about the mount (6,).
        height: Height of the mount above the tip, m.
    """
    moved = wrench.copy()
    moved[3] -= height * wrench[1]
    moved[4] += height * wrench[0]
    return moved


class WrenchSensor(LeafSystem):
    """
    .. pydrake_system::

        name: WrenchSensor
        input_ports:
        - reaction_forces
        output_ports:
        - wrench

    Measures the reaction force of the weld between carriage and peg, at the mount S. The axes of S are parallel to
    those of P, at a height h above the tip. F_S is the wrench of the carriage on the peg. At rest the contact wrench
    about S is -(F_S - F_tare), where F_tare is F_S without contact. A reading is made by `wrench_sensor_step`,
    with n and w ~ N(0, 1) from the scenario's seed. The drift d is a random walk of variance delta^2 t. ``wrench`` is
    the reading of a time ``delay`` ago, about the tip: [f, m + (h z) x f], force (N) first, then moment (N m), in P. It
    is zero until the first reading has passed the delay.

    Args:
        parameters: Parameters of the sensor.
        seed: Seed of the scenario; `set_seed` replaces it in a context.
        weld: Index of the weld joint in ``reaction_forces``.
        tare: Wrench F_tare (6,): force (N), then moment (N m), about S, in P.
    """

    def __init__(self, *, parameters: WrenchSensorParameters, seed: int, weld: int, tare: Array) -> None:
        super().__init__()
        self._parameters, self._sensor = parameters, Sensor.of(parameters)
        self._weld = weld
        self._tare = tare
        # The seed, then the bias (6).
        self._trial = self.DeclareNumericParameter(BasicVector([float(seed), *drawn_bias(parameters, seed)]))
        self._reaction = self.DeclareAbstractInputPort("reaction_forces", AbstractValue.Make([SpatialForce.Zero()]))
        # The plant may step less often than the sensor samples; to read its list of forces takes long.
        self._held = self.DeclareCacheEntry(
            "held wrench", ValueProducer(Value[object], self._calc_held), {self._reaction.ticket()}
        )
        self._state = self.DeclareDiscreteState(self._sensor.initial_state())
        self.DeclarePeriodicDiscreteUpdateEvent(parameters.period, 0.0, self._update)
        self.DeclareVectorOutputPort("wrench", 6, self._calc_wrench, {self.discrete_state_ticket(self._state)})

    def set_seed(self, context: Context, seed: int) -> None:
        """Replaces the seed and the bias drawn from it in ``context``, which is this system's."""
        trial = [float(seed), *drawn_bias(self._parameters, seed)]
        context.get_mutable_numeric_parameter(self._trial).SetFromVector(trial)

    def contact_wrench(self, context: Context) -> Array:
        """Returns the true contact wrench (6,) about the tip; ``context`` is this system's."""
        return wrench_at_tip(-self._held.Eval(context), self._sensor.height)

    def _calc_held(self, context: Context, held: AbstractValue) -> None:
        """Evaluates F_S - F_tare (6,): force (N), then moment (N m)."""
        reaction = self._reaction.Eval(context)[self._weld]
        held.set_value(np.concatenate([reaction.translational(), reaction.rotational()]) - self._tare)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        tick = round(context.get_time() / self._parameters.period)
        trial = np.array(context.get_numeric_parameter(self._trial).value())
        noise = standard_normal(int(trial[0]), SENSOR_NOISE, tick, 12)
        state = np.array(context.get_discrete_state(self._state).value())
        found = wrench_sensor_step(self._sensor, state, self._held.Eval(context), trial[1:], noise)
        discrete_state.set_value(self._state, found)

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        last = np.array(context.get_discrete_state(self._state).value()[-6:])
        output.SetFromVector(wrench_at_tip(last, self._sensor.height))


SENSOR_NOISE = "sensor noise"
"""Name of the noise of the readings."""


def drawn_bias(parameters: WrenchSensorParameters, seed: int) -> Array:
    """Returns the bias (6,) of a sensor, N and N m, from the seed of a scenario."""
    return np.repeat([parameters.force_bias, parameters.torque_bias], 3) * standard_normal(seed, "sensor bias", 0, 6)
