"""The rig's mechanics as rigid bodies with exact contact, as a Drake system that `systems.rig.WireRig` takes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Self

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
)

from compiled import compiled, compiled_within
from models import Array
from models.contact_bodies import Bodies
from models.exact_geometry import CONTACTS, MAX_CONTACTS, NORMAL, POINT, SURFACE, find_contacts, pose_of
from models.scenario import Scenario
from systems.plant.contact_forces import Contact, NormalForces, single_contacts
from systems.plant.contact_plant import AddRigPlant
from systems.plant.exact_contact import IMPULSE, MAX_IMPULSES, ROWS, STEPS, WORK, match, set_frame, solve_contacts
from systems.plant.rig_plant import stepper_axes

FREEDOMS = 6
"""Carriage, mount along x and y, pitch, yaw, and the clocking of the block, which is locked without its stage."""


class Mechanics(NamedTuple):
    """Masses, springs and dampers of the rig, in SI units.

    Attributes:
        mass_z: of all that the carriage moves, with the rotor of the feed, kg.
        mass_x: of all that mount_x moves, kg.
        mass_y: of all that mount_y moves, kg.
        weight: of all that the carriage moves, N.
        peg_mass: kg.
        centre: height of the peg's centre of mass above the sensor, m.
        sensor: height of the sensor above the tip, m.
        friction: of the carriage, N s/m.
        mount_stiffness: N/m.
        mount_damping: N s/m.
        pivot: height of the gimbal's axes above the mouth, m.
        pitch_ring: inertia of the pitch ring and its rotor about the axis of pitch, kg m^2.
        rotor: inertia of the rotor of yaw, kg m^2.
        across: inertia of yaw ring and block, each about its own centre, across the bore, kg m^2.
        along: the same along the bore, kg m^2.
        block_mass: kg.
        block_centre: height of the block's centre of mass above the mouth, m.
        stepper_stiffness: N m/rad.
        stepper_damping: N m s/rad.
        holding_torque: N m.
        clocking: inertia of the block and the rotor of the clocking stage along the bore, kg m^2; infinite without
            the stage.
        gravity: m/s^2.
    """

    mass_z: float
    mass_x: float
    mass_y: float
    weight: float
    peg_mass: float
    centre: float
    sensor: float
    friction: float
    mount_stiffness: float
    mount_damping: float
    pivot: float
    pitch_ring: float
    rotor: float
    across: float
    along: float
    block_mass: float
    block_centre: float
    stepper_stiffness: float
    stepper_damping: float
    holding_torque: float
    clocking: float
    gravity: float

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """Returns the mechanics of a resolved scenario, with the masses and inertias of Drake's plant."""
        plant = AddRigPlant(DiagramBuilder(), scenario).plant
        gravity = float(np.linalg.norm(plant.gravity_field().gravity_vector()))
        rig, stepper, feed = scenario.rig, scenario.stepper, scenario.feed
        bodies = {name: plant.GetBodyByName(name).default_spatial_inertia() for name in BODIES}
        moments = {name: inertia.CalcRotationalInertia().get_moments() for name, inertia in bodies.items()}
        mass = {name: inertia.get_mass() for name, inertia in bodies.items()}
        mass_y = mass["mount_y"] + mass["peg"]
        mass_x = mass["mount_x"] + mass_y
        centre = float(bodies["block"].get_com()[2])
        return cls(
            mass_z=mass["carriage"] + mass_x + feed.reflected_mass,
            mass_x=mass_x,
            mass_y=mass_y,
            weight=(mass["carriage"] + mass_x) * gravity,
            peg_mass=mass["peg"],
            centre=float(bodies["peg"].get_com()[2]) - scenario.sensor.height,
            sensor=scenario.sensor.height,
            friction=rig.carriage_friction,
            mount_stiffness=rig.mount_stiffness,
            mount_damping=rig.mount_damping,
            pivot=float(rig.pivot_height or 0.0),
            pitch_ring=float(moments["pitch_ring"][0]) + stepper.reflected_inertia,
            rotor=stepper.reflected_inertia,
            across=float(moments["yaw_ring"][0] + moments["block"][0]) - mass["block"] * centre**2,
            along=float(moments["yaw_ring"][2] + moments["block"][2]),
            block_mass=mass["block"],
            block_centre=centre,
            stepper_stiffness=stepper.stiffness,
            stepper_damping=stepper.damping,
            holding_torque=stepper.holding_torque,
            clocking=float(moments["block"][2]) + stepper.reflected_inertia if rig.clocking_stage else math.inf,
            gravity=gravity,
        )


BODIES = ("carriage", "mount_x", "mount_y", "peg", "pitch_ring", "yaw_ring", "block")


@compiled
def block_rotation(pitch: float, yaw: float, clocking: float) -> Array:
    """Returns R_WH (3, 3) = R_x(pitch) R_y(yaw) R_z(clocking)."""
    c, s, cy, sy = math.cos(pitch), math.sin(pitch), math.cos(yaw), math.sin(yaw)
    R = np.array([[cy, 0.0, sy], [s * sy, c, -s * cy], [-c * sy, s, c * cy]])
    if clocking != 0.0:
        cz, sz = math.cos(clocking), math.sin(clocking)
        for i in range(3):
            x, y = R[i, 0], R[i, 1]
            R[i, 0], R[i, 1] = cz * x + sz * y, cz * y - sz * x
    return R


@compiled
def tip_in_hole(m: Mechanics, q: Array) -> tuple[Array, Array]:
    """Returns R_WH (3, 3) and the centre of the tip in H (3,), m, at positions (6,)."""
    R, found = block_rotation(q[3], q[4], q[5]), np.empty(3)
    x, y, z = q[1], q[2], q[0] - m.sensor - m.pivot  # from the pivot
    for i in range(3):
        found[i] = R[0, i] * x + R[1, i] * y + R[2, i] * z
    found[2] += m.pivot  # from the origin of H, which is below the pivot along the axis of the bore
    return R, found


@compiled_within
def rig_contacts(bodies: Bodies, m: Mechanics, q: Array, contacts: Array) -> int:
    """Finds the contacts at positions (6,); their points and normals are in W. Returns how many there are."""
    R, tip = tip_in_hole(m, q)
    # The peg does not turn in W, so that R_HP is the transpose of R_WH.
    count = find_contacts(bodies, pose_of(tip, R.T), contacts)
    for i in range(count):
        contacts[i, 3] -= m.pivot
        turn(R, contacts, i, 1)
        contacts[i, 3] += m.pivot
        turn(R, contacts, i, 4)
    return count


@compiled
def turn(R: Array, rows: Array, i: int, first: int) -> None:
    """Turns three components of a row in place by a matrix (3, 3), without the call of a library and new arrays."""
    a, b, c = rows[i, first], rows[i, first + 1], rows[i, first + 2]
    for k in range(3):
        rows[i, first + k] = R[k, 0] * a + R[k, 1] * b + R[k, 2] * c


@compiled
def advance_rig(
    bodies: Bodies,
    m: Mechanics,
    q: Array,
    v: Array,
    motor: float,
    equilibrium: Array,
    step: float,
    count: int,
) -> tuple[Array, int, Array, Array]:
    """Takes ``count`` time steps.

    Args:
        bodies: `Bodies`.
        m: `Mechanics`.
        q: (6,), positions of carriage, mount, gimbal and clocking stage, m and rad; is changed.
        v: (6,), velocities, m/s and rad/s; is changed.
        motor: force on the carriage, N.
        equilibrium: (3,), of the steppers, rad.
        step: s.
        count: number of steps.

    Returns:
        Mean force (N) and torque (N m) of the mount on the peg, at the sensor, in W (6,); and the contacts in the last
        step: number, `CONTACTS` with points and normals in W, and normal forces (MAX_CONTACTS,).
    """
    contacts, force, frame = np.empty(CONTACTS), np.zeros(MAX_CONTACTS), np.empty((3, 3))
    old_surface, old_impulse = np.full(MAX_CONTACTS, -1), np.zeros((MAX_CONTACTS, 3))
    work, jacobian = np.empty(WORK), np.empty((MAX_IMPULSES, FREEDOMS))
    start, wrench, found = v.copy(), np.zeros(6), 0
    limit, arm = m.holding_torque, m.block_centre - m.pivot
    across, lever = m.across + m.block_mass * arm * arm, m.block_mass * m.gravity * arm
    inertia, load, velocity = np.zeros(FREEDOMS), np.zeros(FREEDOMS), np.zeros(FREEDOMS)
    inverse, free, hold, torque = np.zeros(FREEDOMS), np.zeros(FREEDOMS), np.zeros(3), np.zeros(3)
    inertia[0], inertia[1], inertia[2] = m.mass_z, m.mass_x, m.mass_y
    inertia[4], inertia[5], load[0] = across + m.rotor, m.clocking, motor - m.weight
    for _ in range(count):
        cy, sy = math.cos(q[4]), math.sin(q[4])
        inertia[3] = m.pitch_ring + across * cy * cy + m.along * sy * sy
        gyration = (m.along - across) * sy * cy
        load[3] = lever * math.sin(q[3]) * cy - 2.0 * gyration * v[3] * v[4]
        load[4] = lever * math.cos(q[3]) * sy + gyration * v[3] * v[3]
        found = rig_contacts(bodies, m, q, contacts)
        c, s = math.cos(q[3]), math.sin(q[3])
        for i in range(found):
            set_frame(contacts[i, 4], contacts[i, 5], contacts[i, 6], frame)
            x, y, z = contacts[i, 1], contacts[i, 2], contacts[i, 3] - m.pivot
            # Velocities of a point of the block: e_x x d for pitch, (0, c, s) x d for yaw, and the axis of the bore
            # (sy, -s cy, c cy) x d for the clocking stage.
            for j in range(3):
                f_x, f_y, f_z, row = frame[j, 0], frame[j, 1], frame[j, 2], 3 * i + j
                jacobian[row, 0], jacobian[row, 1], jacobian[row, 2] = f_z, f_x, f_y
                jacobian[row, 3] = f_y * z - f_z * y
                jacobian[row, 4] = -(f_x * (c * z - s * y) + f_y * s * x - f_z * c * x)
                jacobian[row, 5] = (
                    f_x * (s * z + c * y) * cy + f_y * (sy * z - c * cy * x) - f_z * (sy * y + s * cy * x)
                )
        match(contacts, found, old_surface, old_impulse, work)
        hold[:] = 0.0  # torque of a stepper at its limit
        for _trial in range(3):
            for k in range(FREEDOMS):
                a = inertia[k]
                b = inertia[k] * v[k] + step * load[k] if inertia[k] < math.inf else 0.0
                if k == 0:
                    a += step * m.friction
                elif k < 3:
                    a += step * (m.mount_damping + step * m.mount_stiffness)
                    b -= step * m.mount_stiffness * q[k]
                elif hold[k - 3] == 0.0:
                    a += step * (m.stepper_damping + step * m.stepper_stiffness)
                    b -= step * m.stepper_stiffness * (q[k] - equilibrium[k - 3])
                else:
                    b += step * hold[k - 3]
                inverse[k], free[k] = 1.0 / a, b / a
            solve_contacts(bodies.law, step, inverse, free, jacobian, contacts, 3 * found, work, velocity)
            again = False
            for k in range(3, FREEDOMS):
                later = q[k] + step * velocity[k] - equilibrium[k - 3]
                torque[k - 3] = -m.stepper_stiffness * later - m.stepper_damping * velocity[k]
                if hold[k - 3] == 0.0 and abs(torque[k - 3]) > limit:
                    hold[k - 3], again = math.copysign(limit, torque[k - 3]), True
            if not again:
                break
        for k in range(FREEDOMS):
            v[k] = velocity[k]
            q[k] += step * v[k]
        old_surface[:] = -1
        for i in range(found):
            k = 3 * i
            n, a, b = work[ROWS, IMPULSE, k], work[ROWS, IMPULSE, k + 1], work[ROWS, IMPULSE, k + 2]
            force[i] = n / step
            p_x = n * jacobian[k, 1] + a * jacobian[k + 1, 1] + b * jacobian[k + 2, 1]
            p_y = n * jacobian[k, 2] + a * jacobian[k + 1, 2] + b * jacobian[k + 2, 2]
            p_z = n * jacobian[k, 0] + a * jacobian[k + 1, 0] + b * jacobian[k + 2, 0]
            x, y, z = contacts[i, 1] - q[1], contacts[i, 2] - q[2], contacts[i, 3] - q[0]
            wrench[0] -= p_x
            wrench[1] -= p_y
            wrench[2] -= p_z
            wrench[3] -= y * p_z - z * p_y
            wrench[4] -= z * p_x - x * p_z
            wrench[5] -= x * p_y - y * p_x
            old_surface[i] = int(contacts[i, SURFACE])
            old_impulse[i, 0], old_impulse[i, 1], old_impulse[i, 2] = n, a, b
    duration = count * step
    wrench /= duration
    a_x, a_y = (v[1] - start[1]) / duration, (v[2] - start[2]) / duration
    wrench[0] += m.peg_mass * a_x
    wrench[1] += m.peg_mass * a_y
    wrench[2] += m.peg_mass * ((v[0] - start[0]) / duration + m.gravity)
    wrench[3] -= m.centre * m.peg_mass * a_y
    wrench[4] += m.centre * m.peg_mass * a_x
    return wrench, found, contacts, force


class ExactPlant(LeafSystem):
    """
    .. pydrake_system::

        name: ExactPlant
        input_ports:
        - carriage_force
        - gimbal_equilibrium
        output_ports:
        - carriage_state
        - gimbal_state
        - reaction_forces

    One of `systems.rig.RigPlant`. In every period, the contact time step of the scenario, it takes `STEPS`
    steps. The discrete state has three groups: positions and velocities of carriage, mount, gimbal and clocking stage,
    (12,); the mean force (N) and torque (N m) of the mount on the peg in the last period, at the mount, in P; and the
    sum of the normal forces of all contacts at its end, N. The single contacts are those of the step that would follow
    with the present inputs. A stepper is a spring-damper whose torque is limited to the holding torque. The rates of
    ``gimbal_equilibrium`` must be zero. The product of inertia of pitch and clocking, the inertia of the block about
    the bore times the sine of yaw, is left out.

    Args:
        scenario: resolved.
    """

    sensor = 0

    def __init__(self, scenario: Scenario) -> None:
        super().__init__()
        self._step = scenario.contact.time_step / STEPS
        self._chamfer = scenario.geometry.chamfer
        m = Mechanics.of(scenario)
        self._constants = self.DeclareAbstractParameter(Value[object]((Bodies.of(scenario), m)))
        self.weight = m.peg_mass * m.gravity
        self.carriage_force = self.DeclareVectorInputPort("carriage_force", 1)
        self._axes = axes = len(stepper_axes(scenario))
        self.gimbal_equilibrium = self.DeclareVectorInputPort("gimbal_equilibrium", 2 * axes)
        self._motion = self.DeclareDiscreteState(np.zeros(2 * FREEDOMS))
        self._held = self.DeclareDiscreteState(np.array([0.0, 0.0, self.weight, 0.0, 0.0, 0.0]))
        self._load = self.DeclareDiscreteState(np.zeros(1))
        self.DeclarePeriodicDiscreteUpdateEvent(scenario.contact.time_step, 0.0, self._update)
        motion, measurement = {self.discrete_state_ticket(self._motion)}, {self.discrete_state_ticket(self._held)}
        self.carriage_state = self.DeclareVectorOutputPort("carriage_state", 2, self._calc_carriage, motion)
        self.gimbal_state = self.DeclareVectorOutputPort("gimbal_state", 2 * axes, self._calc_gimbal, motion)
        self.reaction_forces = self.DeclareAbstractOutputPort(
            "reaction_forces", lambda: AbstractValue.Make([SpatialForce.Zero()]), self._calc_reaction, measurement
        )

    def set_start(self, context: Context, *, carriage: float, angles: Sequence[float]) -> None:
        """See `PegCarrier`."""
        start = np.zeros(2 * FREEDOMS)
        start[0], start[3 : 3 + len(angles)] = carriage, angles
        self.GetMyMutableContextFromRoot(context).SetDiscreteState(self._motion, start)

    def set_trial(self, context: Context, trial: Scenario) -> None:
        """See `PegCarrier`."""
        own = self.GetMyMutableContextFromRoot(context)
        bodies, m = self._constants_in(own)
        bodies = bodies._replace(law=bodies.law._replace(friction=trial.contact.friction))
        m = m._replace(pivot=float(trial.rig.pivot_height or 0.0))
        own.get_mutable_abstract_parameter(self._constants).set_value((bodies, m))

    def tip_height(self, context: Context) -> float:
        """See `PegCarrier`."""
        own = self.GetMyContextFromRoot(context)
        return float(self._positions(own)[0]) - self._constants_in(own)[1].sensor

    def peg_in_hole(self, context: Context) -> RigidTransform:
        """See `PegCarrier`."""
        own = self.GetMyContextFromRoot(context)
        R_WH, p_HP = tip_in_hole(self._constants_in(own)[1], self._positions(own))
        return RigidTransform(RotationMatrix(R_WH.T), p_HP)

    def contact_extent(self, context: Context) -> float:
        """See `PegCarrier`: the sum of the normal forces, N."""
        return float(self.GetMyContextFromRoot(context).get_discrete_state(self._load).value()[0])

    def contacts(self, context: Context) -> list[Contact]:
        """See `PegCarrier`."""
        own = self.GetMyContextFromRoot(context)
        _, _, (found, contacts, forces) = self._advanced(own, 1)
        parts = NormalForces(contacts[:found, POINT].copy(), contacts[:found, NORMAL].copy(), forces[:found])
        m = self._constants_in(own)[1]
        R_WH, p_HP = tip_in_hole(m, self._positions(own))
        p_WH = np.array([0.0, 0.0, m.pivot]) - m.pivot * R_WH[:, 2]
        X_WH = RigidTransform(RotationMatrix(R_WH), p_WH)
        return single_contacts(parts, X_WH, RigidTransform(p_HP), chamfer=self._chamfer)

    def _constants_in(self, own: Context) -> tuple[Bodies, Mechanics]:
        found: tuple[Bodies, Mechanics] = own.get_abstract_parameter(self._constants).get_value()
        return found

    def _positions(self, own: Context) -> Array:
        return np.array(own.get_discrete_state(self._motion).value()[:FREEDOMS])

    def _advanced(self, own: Context, count: int) -> tuple[Array, Array, tuple[int, Array, Array]]:
        """Returns the motion (12,) after some steps, and wrench and contacts as `advance_rig` does."""
        motion = own.get_discrete_state(self._motion).value()
        q, v = motion[:FREEDOMS].copy(), motion[FREEDOMS:].copy()
        wrench, found, contacts, forces = advance_rig(
            *self._constants_in(own),
            q,
            v,
            self.carriage_force.Eval(own)[0],
            np.append(self.gimbal_equilibrium.Eval(own)[: self._axes], np.zeros(3 - self._axes)),
            self._step,
            count,
        )
        return np.concatenate([q, v]), wrench, (found, contacts, forces)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        motion, wrench, (found, _, forces) = self._advanced(context, STEPS)
        discrete_state.set_value(self._motion, motion)
        discrete_state.set_value(self._held, wrench)
        discrete_state.set_value(self._load, [forces[:found].sum()])

    def _calc_carriage(self, context: Context, output: BasicVector) -> None:
        motion = context.get_discrete_state(self._motion).value()
        output.SetFromVector([motion[0], motion[FREEDOMS]])

    def _calc_gimbal(self, context: Context, output: BasicVector) -> None:
        motion = context.get_discrete_state(self._motion).value()
        output.SetFromVector([*motion[3 : 3 + self._axes], *motion[FREEDOMS + 3 : FREEDOMS + 3 + self._axes]])

    def _calc_reaction(self, context: Context, output: AbstractValue) -> None:
        held = context.get_discrete_state(self._held).value()
        output.set_value([SpatialForce(tau=held[3:], f=held[:3])])
