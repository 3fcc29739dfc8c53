"""The linear encoder of the feed carriage: how deep the peg is."""

from __future__ import annotations

from pydrake.systems.framework import BasicVector, Context, LeafSystem


class DepthEncoder(LeafSystem):
    """
    .. pydrake_system::

        name: DepthEncoder
        input_ports:
        - carriage_state
        output_ports:
        - depth

    Depth of the tip below the mouth, in whole encoder counts: depth = round((home - q)/resolution) resolution, with q
    the carriage's position and ``home`` its position where the tip is level with the mouth (m).
    """

    def __init__(self, *, home: float, resolution: float) -> None:
        super().__init__()
        self._home = home
        self._resolution = resolution
        self._carriage_state = self.DeclareVectorInputPort("carriage_state", 2)
        self.DeclareVectorOutputPort("depth", 1, self._calc, {self._carriage_state.ticket()})

    def _calc(self, context: Context, output: BasicVector) -> None:
        position = self._carriage_state.Eval(context)[0]
        output[0] = round((self._home - position) / self._resolution) * self._resolution
