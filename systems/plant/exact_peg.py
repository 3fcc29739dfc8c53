"""A rigid peg that moves freely in a fixed bore with exact contact; see `systems.plant.exact_contact`."""

from __future__ import annotations

import math

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder, DiscreteValues, LeafSystem

from compiled import compiled
from models import Array
from models.contact_bodies import Bodies
from models.exact_geometry import CONTACTS, GAP, MAX_CONTACTS, NORMAL, POINT, SURFACE, TINY, find_contacts, pose_of
from models.scenario import Scenario
from systems.math.rotation import free_body_pose
from systems.plant.contact_plant import AddVirtualPlant, HydroelasticPeg
from systems.plant.exact_contact import IMPULSE, MAX_IMPULSES, ROWS, STEPS, WORK, match, set_frame, solve_contacts


@compiled
def product(a: Array, b: Array) -> Array:
    """Returns the product (4,) of two quaternions (4,), w first."""
    return np.array(
        [
            a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
            a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
        ]
    )


@compiled
def turn(quaternion: Array, vector: Array) -> None:
    """Turns a quaternion (4,), w first, in place by a rotation vector (3,), rad."""
    angle = math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    half = 0.5 * math.sin(0.5 * angle) / (0.5 * angle) if angle > 1e-9 else 0.5
    step = np.array([math.cos(0.5 * angle), half * vector[0], half * vector[1], half * vector[2]])
    quaternion[:] = product(step, quaternion)
    quaternion /= math.sqrt((quaternion**2).sum())


@compiled
def rotation_of(q: Array) -> Array:
    """Returns the matrix (3, 3) of a unit quaternion (4,), w first."""
    a, b, c, d = q[0], q[1], q[2], q[3]
    return np.array(
        [
            [1.0 - 2.0 * (c * c + d * d), 2.0 * (b * c - a * d), 2.0 * (b * d + a * c)],
            [2.0 * (b * c + a * d), 1.0 - 2.0 * (b * b + d * d), 2.0 * (c * d - a * b)],
            [2.0 * (b * d - a * c), 2.0 * (c * d + a * b), 1.0 - 2.0 * (b * b + c * c)],
        ]
    )


@compiled
def advance_peg(
    bodies: Bodies,
    inertia: Array,
    damping: Array,
    free: Array,
    q: Array,
    v: Array,
    wrench: Array,
    step: float,
    count: int,
) -> tuple[Array, int, Array, Array]:
    """Takes ``count`` time steps.

    Args:
        bodies: `models.contact_bodies.Bodies`.
        inertia: (6,), of rotation about the tip, three times the same, kg m^2, and masses, kg.
        damping: (6,), N m s/rad and N s/m.
        free: (6,), 1 for each freedom, or 0 where it is locked.
        q: (7,), quaternion of R_HP, w first, and centre of the tip in H, m; is changed.
        v: (6,), angular velocity of the peg and velocity of its tip in H, rad/s and m/s; is changed.
        wrench: (6,), applied torque and force at the tip in H, N m and N.
        step: s.
        count: number of steps.

    Returns:
        Torque and force of the contact on the peg at the tip, in H, in the last step, (6,), N m and N; and the
        contacts of the last step: number, `CONTACTS`, and normal forces (MAX_CONTACTS,).
    """
    contacts, frame, force, contact, found = (
        np.empty(CONTACTS),
        np.empty((3, 3)),
        np.zeros(MAX_CONTACTS),
        np.zeros(6),
        0,
    )
    old_surface, old_impulse = np.full(MAX_CONTACTS, -1), np.zeros((MAX_CONTACTS, 3))
    work, jacobian, inverse, without = np.empty(WORK), np.empty((MAX_IMPULSES, 6)), np.empty(6), np.empty(6)
    for _ in range(count):
        R = rotation_of(q[:4])
        found = find_contacts(bodies, pose_of(q[4:], R), contacts)
        for i in range(found):
            set_frame(contacts[i, 4], contacts[i, 5], contacts[i, 6], frame)
            x, y, z = contacts[i, 1] - q[4], contacts[i, 2] - q[5], contacts[i, 3] - q[6]
            for j in range(3):
                f_x, f_y, f_z, row = frame[j, 0], frame[j, 1], frame[j, 2], 3 * i + j
                jacobian[row, 0], jacobian[row, 1], jacobian[row, 2] = (
                    y * f_z - z * f_y,
                    z * f_x - x * f_z,
                    x * f_y - y * f_x,
                )
                jacobian[row, 3], jacobian[row, 4], jacobian[row, 5] = f_x, f_y, f_z
        match(contacts, found, old_surface, old_impulse, work)
        for k in range(6):
            mass = inertia[k] + step * damping[k]
            inverse[k], without[k] = free[k] / mass, free[k] * (inertia[k] * v[k] + step * wrench[k]) / mass
        solve_contacts(bodies.law, step, inverse, without, jacobian, contacts, 3 * found, work, v)
        turn(q[:4], step * v[:3])
        q[4:] += step * v[3:]
        contact[:] = 0.0
        old_surface[:] = -1
        for i in range(3 * found):
            impulse = work[ROWS, IMPULSE, i]
            for k in range(6):
                contact[k] += jacobian[i, k] * impulse / step
            old_impulse[i // 3, i % 3] = impulse
        for i in range(found):
            force[i], old_surface[i] = work[ROWS, IMPULSE, 3 * i] / step, int(contacts[i, SURFACE])
    return contact, found, contacts, force


class ExactPeg(LeafSystem):
    """
    .. pydrake_system::

        name: ExactPeg
        input_ports:
        - peg_forces
        output_ports:
        - peg_state
        - contact_wrench
        - pose

    A `PegPlant` whose peg has the coupling's virtual mass and inertia, with its centre of mass
    at the tip. In every period, the contact time step of the scenario, it takes `STEPS` steps under
    the forces at its start. The discrete state has two groups: ``peg_state``, and what the contact was in the last
    step: torque and force on the peg at its tip, and the mean point of the normal forces, in H, (9,).

    Args:
        scenario: with the geometry and contact of the bodies.
    """

    index = BodyIndex(1)

    def __init__(self, scenario: Scenario) -> None:
        super().__init__()
        period, coupling = scenario.contact.time_step, scenario.coupling
        self._step = period / STEPS
        self._bodies = Bodies.of(scenario)
        self._inertia = np.repeat([coupling.peg_inertia, coupling.peg_mass], 3)
        self._damping, self._free = np.zeros(6), np.ones(6)
        self.peg_forces = self.DeclareAbstractInputPort("peg_forces", Value([ExternallyAppliedSpatialForce()]))
        self._motion = self.DeclareDiscreteState(np.eye(13)[0])
        self._contact = self.DeclareDiscreteState(np.zeros(9))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        motion, contact = {self.discrete_state_ticket(self._motion)}, {self.discrete_state_ticket(self._contact)}
        self.peg_state = self.DeclareVectorOutputPort("peg_state", 13, self._calc_state, motion)
        self.contact_wrench = self.DeclareVectorOutputPort("contact_wrench", 6, self._calc_wrench, contact)
        self.pose = self.DeclareAbstractOutputPort("pose", Value[RigidTransform], self._calc_pose, motion)

    def set_start(self, context: Context, X_HP: RigidTransform) -> None:
        """See `HydroelasticPeg`."""
        pose = np.concatenate([X_HP.rotation().ToQuaternion().wxyz(), X_HP.translation()])
        own = self.GetMyMutableContextFromRoot(context)
        own.SetDiscreteState(self._motion, np.concatenate([pose, np.zeros(6)]))

    def peg_pose(self, context: Context) -> RigidTransform:
        """See `HydroelasticPeg`."""
        return free_body_pose(self._state(self.GetMyContextFromRoot(context))[:7])

    def contact_force(self, context: Context) -> tuple[Array, Array] | None:
        """See `HydroelasticPeg`: the point is the mean of the contacts, weighted with their normal forces."""
        contact = self.GetMyContextFromRoot(context).get_discrete_state(self._contact).value()
        return (contact[6:].copy(), contact[3:6].copy()) if contact[:6].any() else None

    def springs(self, context: Context) -> tuple[Array, Array, Array, Array]:
        """Returns the contacts at the present pose as springs, n of them, also those that nearly touch.

        Returns:
            Points (n, 3) in H, m; unit normals (n, 3) in H, in which the block pushes the peg; stiffnesses (n,), N/m;
            elastic forces (n,), N, negative at a gap.
        """
        contacts = np.empty(CONTACTS)
        pose = self._state(self.GetMyContextFromRoot(context))[:7].copy()
        n = find_contacts(self._bodies, pose_of(pose[4:], rotation_of(pose[:4])), contacts)
        stiffness = self._bodies.law.stiffness
        return (
            contacts[:n, POINT].copy(),
            contacts[:n, NORMAL].copy(),
            np.full(n, stiffness),
            -stiffness * contacts[:n, GAP],
        )

    def _state(self, own: Context) -> Array:
        return np.asarray(own.get_discrete_state(self._motion).value())

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        state, wrench = self._state(context).copy(), np.zeros(6)
        for force in self.peg_forces.Eval(context):  # at the tip
            wrench += np.concatenate([force.F_Bq_W.rotational(), force.F_Bq_W.translational()])
        contact, found, contacts, forces = advance_peg(
            self._bodies,
            self._inertia,
            self._damping,
            self._free,
            state[:7],
            state[7:],
            wrench,
            self._step,
            STEPS,
        )
        weights = forces[:found] / max(forces[:found].sum(), TINY)
        discrete_state.set_value(self._motion, state)
        discrete_state.set_value(self._contact, np.concatenate([contact, weights @ contacts[:found, POINT].copy()]))

    def _calc_state(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._state(context))

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state(self._contact).value()[:6])

    def _calc_pose(self, context: Context, output: Value) -> None:
        output.set_value(free_body_pose(self._state(context)[:7]))


PegPlant = HydroelasticPeg | ExactPeg
"""A free peg and a fixed block, without gravity; H and W coincide. Both have the same ports and queries."""


def AddPegPlant(builder: DiagramBuilder, scenario: Scenario) -> PegPlant:
    """Adds the mechanics of peg and hole, in the engine that a scenario names."""
    if scenario.contact.engine == "drake":
        return AddVirtualPlant(builder, scenario)
    plant: ExactPeg = builder.AddNamedSystem("plant", ExactPeg(scenario))
    return plant
