"""The virtual environment whose operator and device run in the servo: the simulation sees a probe."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder, LeafSystem

from models.scenario import Scenario
from skill.arrays import Array
from systems.math.rotation import from_rotation_vector, rotation_vector
from systems.plant.contact_forces import face_springs
from systems.plant.exact_peg import AddPegPlant, ExactPeg
from systems.servo.local_contact import LocalContact, Springs
from systems.servo.multirate_margins import require_multirate_margins
from systems.servo.probe import Probe
from systems.virtual_environment import PegEnvironment, add_coupling, start_pose


class ServedProbe(LeafSystem):
    """
    .. pydrake_system::

        name: ServedProbe
        output_ports:
        - probe_pose
        - probe_velocity

    Holds what the servo has said of the probe last. The discrete state (13,) is position (m), rotation vector (rad),
    [angular velocity; velocity] (rad/s, m/s), and the minimum of the hand's energy (J).

    Args:
        X_HD_start: pose of the probe at the start.
    """

    def __init__(self, X_HD_start: RigidTransform) -> None:
        super().__init__()
        self._state = self.DeclareDiscreteState(_numbers(X_HD_start, np.zeros(6), 0.0))
        ticket = {self.discrete_state_ticket(self._state)}
        self.DeclareAbstractOutputPort("probe_pose", Value[RigidTransform], self._calc_pose, ticket)
        self.DeclareVectorOutputPort("probe_velocity", 6, self._calc_velocity, ticket)

    def set(self, context: Context, probe: Probe) -> None:
        """Replaces the probe; ``context`` is this system's."""
        context.SetDiscreteState(self._state, _numbers(probe.X_HD, probe.V_HD, probe.min_energy))

    def min_energy(self, context: Context) -> float:
        """Returns the minimum of the hand's energy so far, J; ``context`` is this system's."""
        return float(self._values(context)[12])

    def _values(self, context: Context) -> Array:
        found: Array = context.get_discrete_state(self._state).value()
        return found

    def _calc_pose(self, context: Context, output: Value) -> None:
        values = self._values(context)
        output.set_value(RigidTransform(from_rotation_vector(values[3:6]), values[:3]))

    def _calc_velocity(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._values(context)[6:12])


def _numbers(X_HD: RigidTransform, V_HD: Array, min_energy: float) -> Array:
    return np.concatenate([X_HD.translation(), rotation_vector(X_HD.rotation()), V_HD, np.array([min_energy])])


@dataclass(frozen=True)
class ServedEnvironment(PegEnvironment):
    """The environment of a served probe.

    Attributes:
        probe: what the servo has said of the probe.
    """

    probe: ServedProbe

    def set_probe(self, context: Context, probe: Probe) -> None:
        """Replaces the probe, before the next contact step."""
        self.probe.set(self.probe.GetMyMutableContextFromRoot(context), probe)

    def min_energy(self, context: Context) -> float:
        """See `PegEnvironment`."""
        return self.probe.min_energy(self.probe.GetMyContextFromRoot(context))

    def local_contact(self, context: Context, time: float) -> LocalContact:
        """Returns the local model of the contact after a contact step.

        Args:
            context: of the diagram.
            time: of the servo at the end of the step, s.
        """
        state = self.plant.peg_state.Eval(self.plant.peg_state.get_system().GetMyContextFromRoot(context))
        return LocalContact(time, self.plant.peg_pose(context), np.array(state[7:]), self._springs(context))

    def _springs(self, context: Context) -> Springs:
        if isinstance(self.plant, ExactPeg):
            return Springs(*self.plant.springs(context))
        plant = self.plant.plant
        faces = face_springs(plant, plant.GetMyContextFromRoot(context), peg=self.plant.peg, block=self.plant.block)
        stiff = faces.stiffnesses > 0.0
        return Springs(
            faces.points[stiff], faces.normals[stiff], faces.stiffnesses[stiff], faces.forces[stiff]
        ).joined()


def MakeServedEnvironment(scenario: Scenario) -> ServedEnvironment:
    """Builds the environment of a resolved scenario for a probe that a servo moves.

    Args:
        scenario: resolved (see `resolve_scenario`).

    Raises:
        ValueError: if the scenario is not resolved, or its coupling is not stable (see `multirate_margins`).
    """
    require_multirate_margins(scenario)
    builder = DiagramBuilder()
    plant = AddPegPlant(builder, scenario)
    X_HP_start = start_pose(scenario)
    probe = builder.AddNamedSystem("served_probe", ServedProbe(X_HP_start))
    proxy, recorder, log = add_coupling(builder, scenario, plant)
    for receiver in (proxy, recorder):
        builder.Connect(probe.GetOutputPort("probe_pose"), receiver.GetInputPort("probe_pose"))
    builder.Connect(probe.GetOutputPort("probe_velocity"), proxy.GetInputPort("probe_velocity"))
    diagram = builder.Build()
    diagram.set_name("served_environment")
    return ServedEnvironment(diagram, plant, log, X_HP_start, probe)
