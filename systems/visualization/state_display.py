"""Shows the estimated contact state in Meshcat by the colour of the peg."""

from __future__ import annotations

from pydrake.geometry import Meshcat, Rgba
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, EventStatus, LeafSystem

from models.scenario import Geometry
from skill.states.state_style import state_colours
from systems.plant.contact_plant import peg_shape
from systems.visualization.plant_display import PLANT

PATH = "contact_state"


class StateDisplay(LeafSystem):
    """
    .. pydrake_system::

        name: StateDisplay
        input_ports:
        - state
        - carriage_state

    Publishes the estimated contact state into Meshcat. For every state there is a coloured peg; that of the present
    state is visible, the others are hidden. (A recording replays the visibility of an object, but not its colour.) The
    pegs follow the carriage: the height of the tip above the mouth is the position of the carriage minus ``home``. The
    deflection of the mount is too small to see. They replace the plant's own picture of the feed, whose carriage would
    cover the view.
    """

    def __init__(self, *, meshcat: Meshcat, n_states: int, geometry: Geometry, home: float, period: float) -> None:
        """Draws the pegs.

        Args:
            meshcat: Meshcat to draw into.
            n_states: number of states.
            geometry: geometry of the peg.
            home: position of the carriage at which the tip is level with the mouth, m.
            period: publishing period, s.
        """
        super().__init__()
        self._meshcat, self._n_states, self._home = meshcat, n_states, home
        self._state = self.DeclareVectorInputPort("state", 1)
        self._carriage = self.DeclareVectorInputPort("carriage_state", 2)
        X_PC, peg = peg_shape(geometry)
        for k, colour in enumerate(state_colours(n_states)):
            red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
            meshcat.SetObject(f"{PATH}/{k}", peg, Rgba(red, green, blue, 1.0))
            meshcat.SetTransform(f"{PATH}/{k}", X_PC)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._publish)

    def _publish(self, context: Context) -> EventStatus:
        time = context.get_time()
        state = round(float(self._state.Eval(context)[0]))
        position, _speed = self._carriage.Eval(context)
        self._meshcat.SetTransform(PATH, RigidTransform([0.0, 0.0, position - self._home]), time)
        self._meshcat.SetProperty(f"{PLANT}/feed", "visible", False, time)
        for k in range(self._n_states):
            self._meshcat.SetProperty(f"{PATH}/{k}", "visible", k == state, time)
        return EventStatus.Succeeded()
