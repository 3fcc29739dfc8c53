"""The force guard: at the rate of the sensor it limits the contact load, and every command passes through it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from systems.steps.force_guard import (
    CLOCKING,
    FEED_SPEED,
    PEAK,
    PITCH,
    SIZE,
    YAW,
    GuardLimits,
    StoppingModel,
    force_guard_step,
)


class ForceGuard(LeafSystem):
    """
    .. pydrake_system::

        name: ForceGuard
        input_ports:
        - wrench
        - depth
        - pitch_rate
        - yaw_rate
        - clocking_rate
        - feed_speed
        - unwinding
        - blind
        output_ports:
        - target_pitch
        - target_yaw
        - target_clocking
        - feed_speed

    The last system before the motors: every command passes through it, also that of a back-off and after a fault. What
    it permits is in `force_guard_step`. Rates are in rad/s, speeds in m/s, angles in rad relative to the start. The
    wrench (N, N m) acts on the peg about its tip, in P.
    """

    def __init__(self, *, limits: GuardLimits, stopping: StoppingModel) -> None:
        super().__init__()
        self._limits, self._stopping = limits, stopping
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._inputs = [
            self.DeclareVectorInputPort(name, 1)
            for name in ("depth", "pitch_rate", "yaw_rate", "clocking_rate", "feed_speed", "unwinding", "blind")
        ]
        self._state = self.DeclareDiscreteState(SIZE)
        self.DeclarePeriodicDiscreteUpdateEvent(stopping.period, 0.0, self._update)
        state = {self.discrete_state_ticket(self._state)}
        for name, index in (
            ("target_pitch", PITCH),
            ("target_yaw", YAW),
            ("target_clocking", CLOCKING),
            ("feed_speed", FEED_SPEED),
        ):
            self.DeclareVectorOutputPort(name, 1, self._reader(index), state)

    def peak_load(self, context: Context) -> float:
        """Returns the largest measured load so far, N; ``context`` is this system's."""
        return float(context.get_discrete_state(self._state)[PEAK])

    def _reader(self, index: int) -> Callable[[Context, BasicVector], None]:
        def calc(context: Context, output: BasicVector) -> None:
            output[0] = context.get_discrete_state(self._state)[index]

        return calc

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        depth, pitch_rate, yaw_rate, clocking_rate, speed, unwinding, blind = (
            port.Eval(context)[0] for port in self._inputs
        )
        state = np.array(context.get_discrete_state(self._state).value())
        found = force_guard_step(
            self._limits,
            self._stopping,
            state,
            self._wrench.Eval(context),
            depth,
            pitch_rate,
            yaw_rate,
            clocking_rate,
            speed,
            unwinding > 0.0,
            blind > 0.0,
        )
        discrete_state.set_value(self._state, found)
