"""Models the six-axis force/torque sensor between the carriage and the peg."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue
from pydrake.multibody.math import SpatialForce
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.hardware import WrenchSensorParameters
from systems.math.noise import standard_normal
from systems.math.rotation import cross


def wrench_at_tip(wrench: NDArray[np.float64], height: float) -> NDArray[np.float64]:
    """Returns a wrench about the tip.

    Args:
        wrench: Force (N), then moment (N m), about the mount (6,).
        height: Height of the mount above the tip, m.
    """
    force, moment = wrench[:3], wrench[3:]
    return np.concatenate([force, moment + cross(np.array([0.0, 0.0, height]), force)])


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
        seed: Seed of the scenario.
        weld: Index of the weld joint in ``reaction_forces``.
        tare: Wrench F_tare (6,): force (N), then moment (N m), about S, in P.
    """

    def __init__(self, *, parameters: WrenchSensorParameters, seed: int, weld: int, tare: NDArray[np.float64]) -> None:
        super().__init__()
        p = self._parameters = parameters
        self._seed = seed
        self._weld = weld
        self._tare = tare
        self._sigma = np.array([*p.force_noise, *p.torque_noise])
        self._range = np.array([*p.force_range, *p.torque_range])
        self._quantum = np.repeat([p.force_quantum, p.torque_quantum], 3)
        self._drift_step = np.repeat([p.force_drift, p.torque_drift], 3) * math.sqrt(p.period)
        self._bias = np.repeat([p.force_bias, p.torque_bias], 3) * standard_normal(seed, "sensor bias", 0, 6)
        self._reaction = self.DeclareAbstractInputPort("reaction_forces", AbstractValue.Make([SpatialForce.Zero()]))
        self._filtered = self.DeclareDiscreteState(6)
        self._drift = self.DeclareDiscreteState(6)
        # The newest reading is first; the last one is the output.
        self._readings = self.DeclareDiscreteState(6 * (round(p.delay / p.period) + 1))
        self.DeclarePeriodicDiscreteUpdateEvent(p.period, 0.0, self._update)
        self.DeclareVectorOutputPort("wrench", 6, self._calc_wrench, {self.discrete_state_ticket(self._readings)})

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        p = self._parameters
        reaction = self._reaction.Eval(context)[self._weld]
        held = np.concatenate([reaction.translational(), reaction.rotational()])
        filtered = context.get_discrete_state(self._filtered).value()
        blend = 1.0 - math.exp(-2.0 * math.pi * p.bandwidth * p.period)
        filtered = filtered + blend * (-(held - self._tare) - filtered)
        tick = round(context.get_time() / p.period)
        white, walk = standard_normal(self._seed, "sensor noise", tick, 12).reshape(2, 6)
        drift = context.get_discrete_state(self._drift).value() + self._drift_step * walk
        noisy = filtered + self._bias + drift + self._sigma * white
        clipped = np.clip(noisy, -self._range, self._range)
        reading = np.round(clipped / self._quantum) * self._quantum
        readings = context.get_discrete_state(self._readings).value()
        discrete_state.get_mutable_vector(self._filtered).SetFromVector(filtered)
        discrete_state.get_mutable_vector(self._drift).SetFromVector(drift)
        discrete_state.get_mutable_vector(self._readings).SetFromVector(np.concatenate([reading, readings[:-6]]))

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(
            wrench_at_tip(context.get_discrete_state(self._readings).value()[-6:], self._parameters.height)
        )
