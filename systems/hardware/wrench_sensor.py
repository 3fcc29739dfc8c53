"""The six-axis force/torque sensor between the carriage and the peg."""

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
    """Moves a wrench (6,), force (N) then moment (N m), from the mount at ``height`` (m) above the tip to the tip."""
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

    Reads the reaction of the weld between carriage and peg, at the mount S, a height h above the tip and parallel to
    P. The carriage holds the peg with F_S; at rest the contact's wrench about S is -(F_S - F_tare), where F_tare is
    F_S in free air: the sensor is tared. Each period, channel by channel,

        y <- y + (1 - e^{-2 pi f_c T}) (-(F_S - F_tare) - y),
        d <- d + delta sqrt(T) w,
        reading = quantise(clip(y + bias + d + sigma n)),

    with n and w ~ N(0, 1) from the scenario's seed; the drift d is a random walk, of variance delta^2 t. ``wrench`` is
    the reading of ``delay`` before, moved to the tip, [f, m + (h z) x f]: force (N) first, then moment (N m) about the
    tip, in P, as in the fourteen channels. Until the first reading has come through it is zero.
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
        # The newest reading first; the one that comes out is the last.
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
