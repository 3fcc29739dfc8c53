"""Shows the contact force on the peg in Meshcat."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import Meshcat, Rgba
from pydrake.math import RigidTransform
from pydrake.multibody.plant import ContactResults
from pydrake.systems.framework import Context, DiagramBuilder, EventStatus, LeafSystem

from skill.arrays import Array
from systems.plant.contact_plant import ContactPlant
from systems.visualization.arrow import Arrow

FORCE_COLOUR = "#C1121F"
NEWTONS_PER_CENTIMETRE = 10.0


class ForceDisplay(LeafSystem):
    """
    .. pydrake_system::

        name: ForceDisplay
        input_ports:
        - contact_results
        - body_poses

    Publishes an arrow into Meshcat: the sum of the contact forces with which the block acts on the peg, at its tip.

    Drake's own visualizer shows the force on the body whose geometry was registered first: here the block.
    """

    def __init__(self, *, meshcat: Meshcat, contact: ContactPlant, period: float) -> None:
        """Draws the arrow.

        Args:
            meshcat: Meshcat to draw into.
            contact: the plant.
            period: publishing period, s.
        """
        super().__init__()
        self._contact = contact
        red, green, blue = (int(FORCE_COLOUR[i : i + 2], 16) / 255 for i in (1, 3, 5))
        self._arrow = Arrow(
            meshcat, "force_on_the_peg", scale=100.0 * NEWTONS_PER_CENTIMETRE, colour=Rgba(red, green, blue, 0.99)
        )
        self._results = self.DeclareAbstractInputPort("contact_results", Value(ContactResults()))
        self._poses = self.DeclareAbstractInputPort("body_poses", Value([RigidTransform()]))
        self.DeclarePeriodicPublishEvent(period, 0.0, self._publish)

    def _publish(self, context: Context) -> EventStatus:
        X_WP = self._poses.Eval(context)[self._contact.peg.index()]
        force = force_on_the_peg(self._results.Eval(context), self._contact)
        self._arrow.draw(X_WP.translation(), force, context.get_time())
        return EventStatus.Succeeded()

    @staticmethod
    def AddToBuilder(*, builder: DiagramBuilder, contact: ContactPlant, meshcat: Meshcat, period: float) -> None:
        """Adds the system to a diagram, and connects it with the plant."""
        system = builder.AddNamedSystem("force_display", ForceDisplay(meshcat=meshcat, contact=contact, period=period))
        builder.Connect(contact.plant.get_contact_results_output_port(), system.GetInputPort("contact_results"))
        builder.Connect(contact.plant.get_body_poses_output_port(), system.GetInputPort("body_poses"))


def force_on_the_peg(results: ContactResults, contact: ContactPlant) -> Array:
    """Returns the sum (3,) of the contact forces on the peg in W, N."""
    total, own = np.zeros(3), contact.plant.GetCollisionGeometriesForBody(contact.peg)
    for k in range(results.num_hydroelastic_contacts()):
        info = results.hydroelastic_contact_info(k)
        # The force acts on the body of the contact surface's geometry M, which is the one with the smaller id.
        sign = 1.0 if info.contact_surface().id_M() in own else -1.0
        total += sign * info.F_Ac_W().translational()
    return total
