"""Models the six-axis force/torque sensor between the carriage and the peg."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue, Value
from pydrake.multibody.math import SpatialForce
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, ValueProducer

from models.hardware import WrenchSensorParameters
from systems.math.noise import standard_normal


def wrench_at_tip(wrench: NDArray[np.float64], height: float) -> NDArray[np.float64]:
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
    about S is -(F_S - F_tare), where F_tare is F_S without contact. Each period T, in each channel,

        y <- y + (1 - e^{-2 pi f_c T}) (-(F_S - F_tare) - y),
        d <- d + delta sqrt(T) w,
        reading = quantise(clip(y + bias + d + sigma n)),

    with n and w ~ N(0, 1) from the scenario's seed. The drift d is a random walk of variance delta^2 t. ``wrench`` is
    the reading of a time ``delay`` ago, about the tip: [f, m + (h z) x f], force (N) first, then moment (N m), in P. It
    is zero until the first reading has passed the delay.

    Args:
        parameters: Parameters of the sensor.
        seed: Seed of the scenario; `set_seed` replaces it in a context.
        weld: Index of the weld joint in ``reaction_forces``.
        tare: Wrench F_tare (6,): force (N), then moment (N m), about S, in P.
    """

    def __init__(self, *, parameters: WrenchSensorParameters, seed: int, weld: int, tare: NDArray[np.float64]) -> None:
        super().__init__()
        p = self._parameters = parameters
        self._weld = weld
        self._tare = tare
        self._sigma = np.array([*p.force_noise, *p.torque_noise])
        self._range = np.array([*p.force_range, *p.torque_range])
        self._quantum = np.repeat([p.force_quantum, p.torque_quantum], 3)
        self._drift_step = np.repeat([p.force_drift, p.torque_drift], 3) * math.sqrt(p.period)
        # The seed, then the bias (6).
        self._trial = self.DeclareNumericParameter(BasicVector([float(seed), *self._drawn_bias(seed)]))
        self._blend = p.blend
        self._reaction = self.DeclareAbstractInputPort("reaction_forces", AbstractValue.Make([SpatialForce.Zero()]))
        # The plant may step less often than the sensor samples; to read its list of forces takes long.
        self._held = self.DeclareCacheEntry(
            "held wrench", ValueProducer(Value[object], self._calc_held), {self._reaction.ticket()}
        )
        # Filtered wrench (6), drift (6) and the readings of the delay (6 each); the newest is first, the last is the
        # output.
        self._state = self.DeclareDiscreteState(12 + 6 * (round(p.delay / p.period) + 1))
        self.DeclarePeriodicDiscreteUpdateEvent(p.period, 0.0, self._update)
        self.DeclareVectorOutputPort("wrench", 6, self._calc_wrench, {self.discrete_state_ticket(self._state)})

    def set_seed(self, context: Context, seed: int) -> None:
        """Replaces the seed and the bias drawn from it in ``context``, which is this system's."""
        context.get_mutable_numeric_parameter(self._trial).SetFromVector([float(seed), *self._drawn_bias(seed)])

    def contact_wrench(self, context: Context) -> NDArray[np.float64]:
        """Returns the true contact wrench (6,) about the tip; ``context`` is this system's."""
        return wrench_at_tip(-self._held.Eval(context), self._parameters.height)

    def _drawn_bias(self, seed: int) -> NDArray[np.float64]:
        p = self._parameters
        return np.repeat([p.force_bias, p.torque_bias], 3) * standard_normal(seed, "sensor bias", 0, 6)

    def _calc_held(self, context: Context, held: AbstractValue) -> None:
        """Evaluates F_S - F_tare (6,): force (N), then moment (N m)."""
        reaction = self._reaction.Eval(context)[self._weld]
        held.set_value(np.concatenate([reaction.translational(), reaction.rotational()]) - self._tare)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        tick = round(context.get_time() / self._parameters.period)
        trial = context.get_numeric_parameter(self._trial).value()
        noise = standard_normal(int(trial[0]), "sensor noise", tick, 12)
        state = discrete_state.get_mutable_vector(self._state).get_mutable_value()
        filtered, drift = state[:6], state[6:12]
        filtered -= self._blend * (self._held.Eval(context) + filtered)
        drift += self._drift_step * noise[6:]
        noisy = filtered + trial[1:] + drift + self._sigma * noise[:6]
        clipped = np.minimum(np.maximum(noisy, -self._range), self._range)
        state[18:] = state[12:-6].copy()
        state[12:18] = np.rint(clipped / self._quantum) * self._quantum

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        state = context.get_discrete_state(self._state).value()
        output.SetFromVector(wrench_at_tip(state[-6:], self._parameters.height))
