"""A peg that moves freely in a fixed bore of MuJoCo's boxes; see `systems.plant.mujoco_model`."""

from __future__ import annotations

import mujoco
import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, ValueProducer

from models.contact_geometry import TINY
from models.scenario import Scenario
from skill.arrays import Array
from systems.math.rotation import free_body_pose
from systems.plant.mujoco_model import STEPS, MujocoContact, forces_on_the_peg, peg_document


class MujocoPeg(LeafSystem):
    """
    .. pydrake_system::

        name: MujocoPeg
        input_ports:
        - peg_forces
        output_ports:
        - peg_state
        - contact_wrench
        - pose

    A `systems.plant.peg_plant.PegPlant` whose peg has the coupling's virtual mass and inertia, with its centre of mass
    at the tip. In every period, the contact time step of the scenario, it takes `STEPS` of MuJoCo's steps under the
    forces at its start. The discrete state has three groups: ``peg_state``; MuJoCo's warm start; and what the contact
    was in the last step: torque and force on the peg at its tip, and the mean point of the normal forces, in H, (9,).

    Args:
        scenario: with the geometry and contact of the bodies.
    """

    index = BodyIndex(1)

    def __init__(self, scenario: Scenario) -> None:
        super().__init__()
        self._model = mujoco.MjModel.from_xml_string(peg_document(scenario, MujocoContact.of(scenario)))
        self._peg = self._model.body("peg").id
        self.peg_forces = self.DeclareAbstractInputPort("peg_forces", Value([ExternallyAppliedSpatialForce()]))
        self._motion = self.DeclareDiscreteState(np.eye(13)[0])
        self._warm_start = self.DeclareDiscreteState(np.zeros(6))
        self._contact = self.DeclareDiscreteState(np.zeros(9))
        # Work space for each context; it keeps nothing from one step to the next.
        self._scratch = self.DeclareCacheEntry(
            "scratch",
            ValueProducer(lambda: Value[object](mujoco.MjData(self._model)), ValueProducer.NoopCalc),
            {self.nothing_ticket()},
        )
        self.DeclarePeriodicDiscreteUpdateEvent(scenario.contact.time_step, 0.0, self._update)
        motion, contact_ticket = {self.discrete_state_ticket(self._motion)}, {self.discrete_state_ticket(self._contact)}
        self.peg_state = self.DeclareVectorOutputPort("peg_state", 13, self._calc_state, motion)
        self.contact_wrench = self.DeclareVectorOutputPort("contact_wrench", 6, self._calc_wrench, contact_ticket)
        self.pose = self.DeclareAbstractOutputPort("pose", Value[RigidTransform], self._calc_pose, motion)

    def set_start(self, context: Context, X_HP: RigidTransform) -> None:
        """See `PegPlant`."""
        pose = np.concatenate([X_HP.rotation().ToQuaternion().wxyz(), X_HP.translation()])
        own = self.GetMyMutableContextFromRoot(context)
        own.SetDiscreteState(self._motion, np.concatenate([pose, np.zeros(6)]))

    def peg_pose(self, context: Context) -> RigidTransform:
        """See `PegPlant`."""
        return free_body_pose(self._state(self.GetMyContextFromRoot(context))[:7])

    def contact_force(self, context: Context) -> tuple[Array, Array] | None:
        """See `PegPlant`: the point is the mean of the contacts, weighted with their normal forces."""
        contact = self.GetMyContextFromRoot(context).get_discrete_state(self._contact).value()
        return (contact[6:].copy(), contact[3:6].copy()) if contact[:6].any() else None

    def _state(self, own: Context) -> Array:
        return np.asarray(own.get_discrete_state(self._motion).value())

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        data, state = self._scratch.Eval(context), self._state(context)
        R = free_body_pose(state[:7]).rotation().matrix()
        mujoco.mj_resetData(self._model, data)
        data.qpos[:3], data.qpos[3:] = state[4:7], state[:4]
        data.qvel[:3], data.qvel[3:] = state[10:], R.T @ state[7:10]  # MuJoCo's angular velocity is in P
        data.qacc_warmstart[:] = context.get_discrete_state(self._warm_start).value()
        for force in self.peg_forces.Eval(context):  # at the tip
            data.xfrc_applied[self._peg, :3] += force.F_Bq_W.translational()
            data.xfrc_applied[self._peg, 3:] += force.F_Bq_W.rotational()
        mujoco.mj_step(self._model, data, nstep=STEPS)
        points, normals, forces = forces_on_the_peg(self._model, data)
        arms = points - data.xpos[self._peg]  # of the last step, as the forces
        wrench = np.concatenate([np.cross(arms, forces).sum(axis=0), forces.sum(axis=0)])
        weights = (forces * normals).sum(axis=1)
        centre = weights @ points / max(weights.sum(), TINY)
        pose = np.concatenate([data.qpos[3:], data.qpos[:3]])
        turning = free_body_pose(pose).rotation().matrix() @ data.qvel[3:]
        discrete_state.set_value(self._motion, np.concatenate([pose, turning, data.qvel[:3]]))
        discrete_state.set_value(self._warm_start, data.qacc_warmstart)
        discrete_state.set_value(self._contact, np.concatenate([wrench, centre]))

    def _calc_state(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._state(context))

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state(self._contact).value()[:6])

    def _calc_pose(self, context: Context, output: Value) -> None:
        output.set_value(free_body_pose(self._state(context)[:7]))
