"""What the parts of a law and the hardware have in common as systems of Drake: named ports, a state and a step."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from skill.arrays import Array

TIME = "time"


class Part(LeafSystem):
    """A system whose discrete state a step advances once a period.

    Args:
        inputs: sizes of the input ports, by their names; a port of size 1 is read as a number.
        state: (n,), at the start.
        period: of the step, s.
        step: returns the next state (n,) for the state and the values of the inputs, in their order.
        timed: whether the step takes the time (s) after the inputs.
    """

    def __init__(
        self,
        inputs: Mapping[str, int],
        *,
        state: ArrayLike,
        period: float,
        step: Callable[..., Array],
        timed: bool = False,
    ) -> None:
        super().__init__()
        self._step = step
        self._ports = {name: self.DeclareVectorInputPort(name, size) for name, size in inputs.items()}
        self._reads = (*inputs, TIME) if timed else tuple(inputs)
        self._state = self.DeclareDiscreteState(np.asarray(state, dtype=float))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def declare_output(self, name: str, size: int, calc: Callable[..., ArrayLike], *reads: str) -> None:
        """Declares an output port.

        Args:
            name: of the port.
            size: of the port.
            calc: returns its value for the state and the values of what it reads.
            reads: names of inputs, on which it depends directly, or `TIME`.
        """

        def write(context: Context, output: BasicVector) -> None:
            output.SetFromVector(np.atleast_1d(calc(self.values(context), *self._read(context, reads))))

        tickets = {self.time_ticket() if read == TIME else self._ports[read].ticket() for read in reads}
        self.DeclareVectorOutputPort(name, size, write, {self.discrete_state_ticket(self._state), *tickets})

    def values(self, context: Context) -> Array:
        """Returns a copy of the state (n,); ``context`` is this system's."""
        return np.array(context.get_discrete_state(self._state).value())

    def _read(self, context: Context, names: tuple[str, ...]) -> list[Any]:
        return [context.get_time() if name == TIME else self._value(context, name) for name in names]

    def _value(self, context: Context, name: str) -> Any:
        value = self._ports[name].Eval(context)
        return value[0] if len(value) == 1 else value

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        found = self._step(self.values(context), *self._read(context, self._reads))
        discrete_state.set_value(self._state, found)
