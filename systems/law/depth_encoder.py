"""Models the linear encoder of the feed's carriage, which measures the depth of the peg."""

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

    Outputs the depth of the tip below the mouth (m), quantised to encoder counts:
    depth = round((home - q)/resolution) resolution, where q is the carriage's position. ``carriage_state`` is
    [position, velocity] in m, m/s.

    Args:
        home: Position of the carriage at which the tip is level with the mouth, m.
        resolution: Size of an encoder count, m.
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
