"""The bodies of the rig in MuJoCo, as a Drake system that `systems.rig.WireRig` takes in place of Drake's plant."""

from __future__ import annotations

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
from systems.plant.mujoco_model import MujocoContact, rig_document

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

    A `systems.plant.rig_plant.RigPlant`. In every period, the contact time step of the scenario, it takes as many of
    MuJoCo's steps as fill the period. The discrete state has three groups: MuJoCo's positions, velocities and warm
    start; the force (N) and torque (N m) of the mount on the peg, at the mount, in P, as measured by MuJoCo's sensor in
    the last step; and the sum of the overlaps of all contacts in the last step, m. The single contacts are those of the
    step that would follow with the present inputs. The steppers are MuJoCo's position actuators, with the holding
    torque as their force limit. They have no desired rates: those of ``gimbal_equilibrium`` must be zero.

    Args:
        scenario: resolved.
        contact: parameters of MuJoCo's contact.

    Raises:
        ValueError: if MuJoCo's time step does not divide the period.
    """

    sensor = 0

    def __init__(self, scenario: Scenario, contact: MujocoContact) -> None:
        super().__init__()
        period = scenario.contact.time_step
        self._count = round(period / contact.time_step)
        if self._count < 1 or abs(self._count * contact.time_step - period) > 1e-9:
            raise ValueError(
                f"MuJoCo's time step is {contact.time_step} s, expected a part of contact.time_step {period} s"
            )
        self._model = mujoco.MjModel.from_xml_string(rig_document(scenario, contact))
        model = self._model
        self._size = mujoco.mj_stateSize(model, KEPT)
        at = {name: model.joint(name).qposadr[0] for name in ("feed", "pitch", "yaw")}
        self._feed, self._gimbal = at["feed"], [at["pitch"], at["yaw"]]
        self._tip = -scenario.sensor.height
        self.weight = float(model.body("peg").mass[0] * np.linalg.norm(model.opt.gravity))
        self.moving_mass = float(model.body("carriage").subtreemass[0])
        self.turning_inertia = _inertia(model, "pitch")
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
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        motion, measurement = {self.discrete_state_ticket(self._kept)}, {self.discrete_state_ticket(self._held)}
        self.carriage_state = self.DeclareVectorOutputPort("carriage_state", 2, self._calc_carriage, motion)
        self.gimbal_state = self.DeclareVectorOutputPort("gimbal_state", 4, self._calc_gimbal, motion)
        self.reaction_forces = self.DeclareAbstractOutputPort(
            "reaction_forces", lambda: AbstractValue.Make([SpatialForce.Zero()]), self._calc_reaction, measurement
        )

    @staticmethod
    def AddToBuilder(builder: DiagramBuilder, scenario: Scenario, contact: MujocoContact) -> MujocoPlant:
        """Adds the plant of a resolved scenario; its bodies are those of `systems.plant.contact_plant.AddRigPlant`."""
        plant: MujocoPlant = builder.AddNamedSystem("plant", MujocoPlant(scenario, contact))
        return plant

    def set_start(self, context: Context, *, carriage: float, pitch: float, yaw: float) -> None:
        """See `RigPlant`."""
        own = self.GetMyMutableContextFromRoot(context)
        data = mujoco.MjData(self._model)
        data.qpos[self._feed], data.qpos[self._gimbal] = carriage, [pitch, yaw]
        kept = np.zeros(self._size)
        mujoco.mj_getState(self._model, data, kept, KEPT)
        own.SetDiscreteState(self._kept, kept)

    def set_trial(self, context: Context, trial: Scenario) -> float:
        """See `RigPlant`: a model of MuJoCo is compiled once."""
        raise TypeError("MuJoCo's plant cannot change its trial; build a rig for each")

    def tip_height(self, context: Context) -> float:
        """See `RigPlant`."""
        own = self.GetMyContextFromRoot(context)
        return float(own.get_discrete_state(self._kept).value()[self._feed]) + self._tip

    def peg_in_hole(self, context: Context) -> RigidTransform:
        """See `RigPlant`."""
        own = self.GetMyContextFromRoot(context)
        data = self._scratch.Eval(own)
        mujoco.mj_setState(self._model, data, own.get_discrete_state(self._kept).value(), KEPT)
        mujoco.mj_kinematics(self._model, data)
        X_WH, X_WP = _poses(data)
        return X_WH.inverse() @ X_WP

    def contact_extent(self, context: Context) -> float:
        """See `RigPlant`: the sum of the overlaps, m."""
        return float(self.GetMyContextFromRoot(context).get_discrete_state(self._overlap).value()[0])

    def contacts(self, context: Context) -> list[Contact]:
        """See `RigPlant`."""
        data = self._loaded(self.GetMyContextFromRoot(context))
        mujoco.mj_forward(self._model, data)
        found = data.contact
        forces, force = np.zeros(data.ncon), np.zeros(6)
        for k in range(data.ncon):
            mujoco.mj_contactForce(self._model, data, k, force)
            forces[k] = force[0]
        # A contact's normal points from its first to its second geom; the one of a cylinder is the peg.
        second = self._model.geom_type[found.geom[:, 1]] == mujoco.mjtGeom.mjGEOM_CYLINDER
        normals = np.where(second[:, None], 1.0, -1.0) * found.frame[:, :3]
        X_WH, X_WP = _poses(data)
        parts = NormalForces(np.array(found.pos), normals, forces)
        return single_contacts(parts, X_WH, X_WH.inverse() @ X_WP, chamfer=self._chamfer)

    def advance(self, data: mujoco.MjData) -> None:
        """Takes the steps of one period."""
        mujoco.mj_step(self._model, data, nstep=self._count)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        data = self._loaded(context)
        self.advance(data)
        kept = np.zeros(self._size)
        mujoco.mj_getState(self._model, data, kept, KEPT)
        discrete_state.get_mutable_vector(self._kept).SetFromVector(kept)
        discrete_state.get_mutable_vector(self._held).SetFromVector(data.sensordata)
        discrete_state.get_mutable_vector(self._overlap).SetFromVector(
            [float(np.maximum(0.0, -data.contact.dist).sum())]
        )

    def _loaded(self, context: Context) -> mujoco.MjData:
        """MuJoCo's data with the state and the inputs of a context of this system."""
        data = self._scratch.Eval(context)
        mujoco.mj_setState(self._model, data, context.get_discrete_state(self._kept).value(), KEPT)
        data.ctrl[0] = self.carriage_force.Eval(context)[0]
        data.ctrl[1:3] = self.gimbal_equilibrium.Eval(context)[:2]
        return data

    def _calc_carriage(self, context: Context, output: BasicVector) -> None:
        kept = context.get_discrete_state(self._kept).value()
        output.SetFromVector([kept[self._feed], kept[self._model.nq + self._feed]])

    def _calc_gimbal(self, context: Context, output: BasicVector) -> None:
        kept = context.get_discrete_state(self._kept).value()
        output.SetFromVector([*kept[self._gimbal], *kept[self._model.nq + np.array(self._gimbal)]])

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


def _inertia(model: mujoco.MjModel, joint: str) -> float:
    """Returns the inertia about a joint with all joints at zero, with its rotor."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    axis = int(model.joint(joint).dofadr[0])
    unit, product = np.eye(model.nv)[axis], np.zeros(model.nv)
    mujoco.mj_mulM(model, data, product, unit)
    return float(product[axis])
