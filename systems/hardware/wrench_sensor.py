"""Models the six-axis force/torque sensor between the carriage and the peg."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.multibody.math import SpatialForce
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, ValueProducer

from models.hardware import WrenchSensorParameters
from skill.arrays import Array
from systems.math.noise import standard_normal
from systems.steps.wrench_sensor import Sensor, wrench_at_tip, wrench_sensor_step


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
    p = parameters
    return np.repeat([p.force_bias, p.torque_bias], 3) * standard_normal(seed, "sensor bias", 0, 6)
