"""Lets the force decay when the simulation no longer updates the local model of the contact."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from systems.servo.local_contact import LocalContact, Springs

HOLD = 0.02  # in units of s; up to this age a model serves unchanged
FADE = 0.05  # in units of s; so much later the force has decayed to zero
RISE = 0.10  # in units of s, in which the force returns


class StaleContactFade(LeafSystem):
    """
    .. pydrake_system::

        name: StaleContactFade
        input_ports:
        - virtual_wrench
        - contact
        - closed
        output_ports:
        - faded_wrench
        - gain

    Multiplies a wrench (6,) by a gain from 0 to 1. A model of the contact of age a (the present minus its time) allows

        1 up to HOLD,  1 - (a - HOLD) / FADE up to HOLD + FADE,  0 from there on.

    The gain falls with it and rises at most by 1/RISE a second, so that the force has no step when the simulation
    goes on. ``closed`` is 0 for a servo that has just stood still, which takes the gain to 0, else 1.

    Args:
        period: of a tick, s.
    """

    def __init__(self, *, period: float) -> None:
        super().__init__()
        self._rise = period / RISE
        self._wrench = self.DeclareVectorInputPort("virtual_wrench", 6)
        none = LocalContact(0.0, RigidTransform(), np.zeros(6), Springs.none())
        self._contact = self.DeclareAbstractInputPort("contact", AbstractValue.Make(none))
        self._closed = self.DeclareVectorInputPort("closed", 1)
        self._gain = self.DeclareDiscreteState([1.0])
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        gain = self.discrete_state_ticket(self._gain)
        self.DeclareVectorOutputPort("faded_wrench", 6, self._calc_wrench, {gain, self._wrench.ticket()})
        self.DeclareStateOutputPort("gain", self._gain)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        age = context.get_time() - self._contact.Eval(context).time
        allowed = min(1.0, max(0.0, 1.0 - (age - HOLD) / FADE)) * self._closed.Eval(context)[0]
        gain = min(allowed, self._present(context) + self._rise)
        discrete_state.get_mutable_vector(self._gain).SetFromVector([gain])

    def _present(self, context: Context) -> float:
        return float(context.get_discrete_state(self._gain).value()[0])

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._present(context) * self._wrench.Eval(context))
