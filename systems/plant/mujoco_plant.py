"""The bodies of the rig in MuJoCo, as a Drake system that `systems.rig.WireRig` takes in place of Drake's plant."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialForce
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiagramBuilder,
    DiscreteValues,
    LeafSystem,
    ValueProducer,
)

from models.scenario import Scenario
from systems.plant.contact_forces import Contact, NormalForces, single_contacts
from systems.plant.mujoco_model import STEPS, MujocoContact, forces_on_the_peg, rig_document

KEPT = mujoco.mjtState.mjSTATE_PHYSICS | mujoco.mjtState.mjSTATE_WARMSTART
"""The parts of MuJoCo's state that, with the inputs, determine the next step."""


class MujocoPlant(LeafSystem):
    """
    .. pydrake_system::

        name: MujocoPlant
        input_ports:
        - carriage_force
        - gimbal_equilibrium
        output_ports:
        - carriage_state
        - gimbal_state
        - reaction_forces

    A `systems.plant.rig_plant.RigPlant`. In every period, the contact time step of the scenario, it takes `STEPS`
    of MuJoCo's steps. The discrete state has three groups: MuJoCo's positions, velocities and warm
    start; the force (N) and torque (N m) of the mount on the peg, at the mount, in P, as measured by MuJoCo's sensor in
    the last step; and the sum of the overlaps of all contacts in the last step, m. The single contacts are those of the
    step that would follow with the present inputs. The steppers are MuJoCo's position actuators, with the holding
    torque as their force limit. They have no desired rates: those of ``gimbal_equilibrium`` must be zero.

    Args:
        scenario: resolved.
    """

    sensor = 0

    def __init__(self, scenario: Scenario) -> None:
        super().__init__()
        model = mujoco.MjModel.from_xml_string(rig_document(scenario, MujocoContact.of(scenario)))
        self._constants = self.DeclareAbstractParameter(Value[object](model))
        self._size, self._nq = mujoco.mj_stateSize(model, KEPT), model.nq
        at = {name: model.joint(name).qposadr[0] for name in ("feed", "pitch", "yaw")}
        self._feed, self._gimbal = at["feed"], [at["pitch"], at["yaw"]]
        self._tip = -scenario.sensor.height
        self.weight = float(model.body("peg").mass[0] * np.linalg.norm(model.opt.gravity))
        self.carriage_force = self.DeclareVectorInputPort("carriage_force", 1)
        self.gimbal_equilibrium = self.DeclareVectorInputPort("gimbal_equilibrium", 4)
        scratch = mujoco.MjData(model)
        kept = np.zeros(self._size)
        mujoco.mj_getState(model, scratch, kept, KEPT)
        self._kept = self.DeclareDiscreteState(kept)
        self._held = self.DeclareDiscreteState(np.array([0.0, 0.0, self.weight, 0.0, 0.0, 0.0]))
        self._overlap = self.DeclareDiscreteState(np.zeros(1))
        self._chamfer = scenario.geometry.chamfer
        # Work space for each context; it keeps nothing from one step to the next.
        self._scratch = self.DeclareCacheEntry(
            "scratch",
            ValueProducer(lambda: Value[object](mujoco.MjData(model)), ValueProducer.NoopCalc),
            {self.nothing_ticket()},
        )
        self.DeclarePeriodicDiscreteUpdateEvent(scenario.contact.time_step, 0.0, self._update)
        motion, measurement = {self.discrete_state_ticket(self._kept)}, {self.discrete_state_ticket(self._held)}
        self.carriage_state = self.DeclareVectorOutputPort("carriage_state", 2, self._calc_carriage, motion)
        self.gimbal_state = self.DeclareVectorOutputPort("gimbal_state", 4, self._calc_gimbal, motion)
        self.reaction_forces = self.DeclareAbstractOutputPort(
            "reaction_forces", lambda: AbstractValue.Make([SpatialForce.Zero()]), self._calc_reaction, measurement
        )

    @staticmethod
    def AddToBuilder(builder: DiagramBuilder, scenario: Scenario) -> MujocoPlant:
        """Adds the plant of a resolved scenario; its bodies are those of `systems.plant.contact_plant.AddRigPlant`."""
        plant: MujocoPlant = builder.AddNamedSystem("plant", MujocoPlant(scenario))
        return plant

    def set_start(self, context: Context, *, carriage: float, angles: Sequence[float]) -> None:
        """See `RigPlant`."""
        own = self.GetMyMutableContextFromRoot(context)
        model = self._model_in(own)
        data = mujoco.MjData(model)
        data.qpos[self._feed], data.qpos[self._gimbal] = carriage, angles
        kept = np.zeros(self._size)
        mujoco.mj_getState(model, data, kept, KEPT)
        own.SetDiscreteState(self._kept, kept)

    def set_trial(self, context: Context, trial: Scenario) -> None:
        """See `RigPlant`: another model of the same size is compiled."""
        model = mujoco.MjModel.from_xml_string(rig_document(trial, MujocoContact.of(trial)))
        own = self.GetMyMutableContextFromRoot(context)
        own.get_mutable_abstract_parameter(self._constants).set_value(model)

    def tip_height(self, context: Context) -> float:
        """See `RigPlant`."""
        own = self.GetMyContextFromRoot(context)
        return float(own.get_discrete_state(self._kept).value()[self._feed]) + self._tip

    def peg_in_hole(self, context: Context) -> RigidTransform:
        """See `RigPlant`."""
        own = self.GetMyContextFromRoot(context)
        data = self._scratch.Eval(own)
        model = self._model_in(own)
        mujoco.mj_setState(model, data, own.get_discrete_state(self._kept).value(), KEPT)
        mujoco.mj_kinematics(model, data)
        X_WH, X_WP = _poses(data)
        return X_WH.inverse() @ X_WP

    def contact_extent(self, context: Context) -> float:
        """See `RigPlant`: the sum of the overlaps, m."""
        return float(self.GetMyContextFromRoot(context).get_discrete_state(self._overlap).value()[0])

    def contacts(self, context: Context) -> list[Contact]:
        """See `RigPlant`."""
        own = self.GetMyContextFromRoot(context)
        model, data = self._model_in(own), self._loaded(own)
        mujoco.mj_forward(model, data)
        points, normals, forces = forces_on_the_peg(model, data)
        X_WH, X_WP = _poses(data)
        parts = NormalForces(points, normals, (forces * normals).sum(axis=1))
        return single_contacts(parts, X_WH, X_WH.inverse() @ X_WP, chamfer=self._chamfer)

    def advance(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Takes the steps of one period."""
        mujoco.mj_step(model, data, nstep=STEPS)

    def _model_in(self, own: Context) -> mujoco.MjModel:
        return own.get_abstract_parameter(self._constants).get_value()

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        model, data = self._model_in(context), self._loaded(context)
        self.advance(model, data)
        kept = np.zeros(self._size)
        mujoco.mj_getState(model, data, kept, KEPT)
        discrete_state.get_mutable_vector(self._kept).SetFromVector(kept)
        discrete_state.get_mutable_vector(self._held).SetFromVector(data.sensordata)
        discrete_state.get_mutable_vector(self._overlap).SetFromVector(
            [float(np.maximum(0.0, -data.contact.dist).sum())]
        )

    def _loaded(self, context: Context) -> mujoco.MjData:
        """MuJoCo's data with the state and the inputs of a context of this system."""
        data = self._scratch.Eval(context)
        mujoco.mj_setState(self._model_in(context), data, context.get_discrete_state(self._kept).value(), KEPT)
        data.ctrl[0] = self.carriage_force.Eval(context)[0]
        data.ctrl[1:3] = self.gimbal_equilibrium.Eval(context)[:2]
        return data

    def _calc_carriage(self, context: Context, output: BasicVector) -> None:
        kept = context.get_discrete_state(self._kept).value()
        output.SetFromVector([kept[self._feed], kept[self._nq + self._feed]])

    def _calc_gimbal(self, context: Context, output: BasicVector) -> None:
        kept = context.get_discrete_state(self._kept).value()
        output.SetFromVector([*kept[self._gimbal], *kept[self._nq + np.array(self._gimbal)]])

    def _calc_reaction(self, context: Context, output: AbstractValue) -> None:
        held = context.get_discrete_state(self._held).value()
        output.set_value([SpatialForce(tau=held[3:], f=held[:3])])


def _poses(data: mujoco.MjData) -> tuple[RigidTransform, RigidTransform]:
    """X_WH and X_WP."""
    X_WH, X_WP = (
        RigidTransform(RotationMatrix(body.xmat.reshape(3, 3)), body.xpos)
        for body in (data.body("block"), data.body("peg"))
    )
    return X_WH, X_WP
