"""A rigid peg that a compliance holds over a fixed bore, with exact contact; see `systems.plant.exact_contact`."""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from compiled import compiled
from models import Array
from models.arm import ArmParameters
from models.contact_bodies import Bodies
from models.exact_geometry import NORMAL, POINT
from models.hardware import GRAVITY, STEEL
from models.scenario import Scenario
from systems.math.rotation import free_body_pose
from systems.plant.contact_forces import Contact, NormalForces, single_contacts
from systems.plant.exact_contact import STEPS
from systems.plant.exact_peg import advance_peg, product, rotation_of, turn


class Compliance(NamedTuple):
    """Springs and dampers between an anchor and the peg, at the tip, along the axes of the anchor.

    Attributes:
        stiffness: (6,), about and along x, y and z, N m/rad and N/m.
        damping: (6,), N m s/rad and N s/m.
        inertia: (6,), of the peg with its holder, three times about the tip, kg m^2, and its mass, kg.
        weight: N.
    """

    stiffness: Array
    damping: Array
    inertia: Array
    weight: float

    @classmethod
    def of(cls, arm: ArmParameters, peg_mass: float) -> Self:
        """Returns the compliance of an arm with a peg of this mass, kg."""
        stiffness = np.array(
            [
                *(arm.cocking_stiffness, arm.cocking_stiffness, arm.torsional_stiffness),
                *(arm.lateral_stiffness, arm.lateral_stiffness, arm.axial_stiffness),
            ]
        )
        mass = arm.held_mass + peg_mass
        inertia = np.repeat([arm.held_inertia, mass], 3)
        return cls(stiffness, 2.0 * arm.damping_ratio * np.sqrt(stiffness * inertia), inertia, mass * GRAVITY)


@compiled
def seen_from(frame: Array, motion: Array) -> Array:
    """Returns a motion (13,), see `HeldPeg`, seen from a frame (7,), its quaternion (w first) and origin, at rest."""
    R = rotation_of(frame[:4]).T
    found = np.empty(13)
    found[:4] = product(np.array([frame[0], -frame[1], -frame[2], -frame[3]]), motion[:4])
    found[4:7] = R @ (motion[4:7] - frame[4:])
    found[7:10], found[10:] = R @ motion[7:10], R @ motion[10:]
    return found


@compiled
def inverse(frame: Array) -> Array:
    """Returns the inverse (7,) of a frame (7,); see `seen_from`."""
    found = frame.copy()
    found[1:4] *= -1.0
    found[4:] = -(rotation_of(frame[:4]).T @ frame[4:])
    return found


@compiled
def held_wrench(c: Compliance, q: Array, v: Array, anchor: Array) -> Array:
    """Returns the torque and force (6,) of a compliance on the peg at its tip, in H.

    Args:
        c: `Compliance`.
        q: (7,), pose of the peg in H: quaternion, w first, and tip, m.
        v: (6,), its angular velocity and the velocity of its tip in H, rad/s and m/s.
        anchor: (13,), pose and velocities at which the compliance is at rest, likewise.
    """
    R, P = rotation_of(anchor[:4]), rotation_of(q[:4])
    # R' P is nearly the unit matrix: its rotation vector is that of its skew part, up to the third order.
    relative = R.T @ P
    found = np.empty(6)
    bent = np.empty(6)
    bent[0] = 0.5 * (relative[2, 1] - relative[1, 2])
    bent[1] = 0.5 * (relative[0, 2] - relative[2, 0])
    bent[2] = 0.5 * (relative[1, 0] - relative[0, 1])
    bent[3:] = R.T @ (q[4:] - anchor[4:7])
    rate = np.empty(6)
    rate[:3], rate[3:] = R.T @ (v[:3] - anchor[7:10]), R.T @ (v[3:] - anchor[10:])
    local = -c.stiffness * bent - c.damping * rate
    found[:3], found[3:] = R @ local[:3], R @ local[3:]
    return found


@compiled
def advance_held_peg(
    bodies: Bodies, c: Compliance, weight: Array, q: Array, v: Array, anchor: Array, step: float, count: int
) -> tuple[Array, int, Array, Array]:
    """Takes ``count`` time steps, in which the anchor moves on with its velocities; changes q, v and anchor.

    Args:
        bodies: `Bodies`.
        c: `Compliance`.
        weight: (3,), of what it holds, in H, N.
        q: (7,), see `held_wrench`.
        v: (6,), likewise.
        anchor: (13,), likewise.
        step: s.
        count: number of steps.

    Returns:
        The mean torque and force of the compliance on the peg at the tip, in H, (6,); and the contacts of the last
        step: number, `CONTACTS` and normal forces; see `advance_peg`.
    """
    total, damping, free = np.zeros(6), np.zeros(6), np.ones(6)
    for _ in range(count):
        wrench = held_wrench(c, q, v, anchor)
        total += wrench
        wrench[3:] += weight
        _, found, contacts, force = advance_peg(bodies, c.inertia, damping, free, q, v, wrench, step, 1)
        turn(anchor[:4], step * anchor[7:10])
        anchor[4:7] += step * anchor[10:]
    return total / count, found, contacts, force


class HeldPeg(LeafSystem):
    """
    .. pydrake_system::

        name: HeldPeg
        input_ports:
        - anchor
        output_ports:
        - held_wrench
        - reaction_forces
        - as_on_rig

    A peg on a compliance, in steps of ``period``. ``anchor`` (13,) is the pose and the motion at which the compliance
    is at rest, in W: quaternion, w first, tip (m), angular velocity and velocity. ``held_wrench`` (6,) is the mean
    torque and force of the compliance on the peg in the last period, at the tip, in W. ``reaction_forces`` is the same
    as a `SpatialForce` at the sensor, in P, in a list of one. The hole may be elsewhere than in W.
    ``as_on_rig`` (4,) is the height of the tip over the mouth (m), and the angles (rad) of the rig's axes that give the
    same orientation of the peg in the hole.

    The centre of mass of peg and holder is taken to be at the tip.

    Args:
        scenario: resolved, of an arm.
        period: s.
    """

    def __init__(self, scenario: Scenario, *, period: float) -> None:
        super().__init__()
        g = scenario.geometry
        self._step = scenario.contact.time_step / STEPS
        self._count = round(period / self._step)
        self._sensor, self._chamfer = scenario.sensor.height, g.chamfer
        self.compliance = Compliance.of(scenario.arm, STEEL * g.assembly.volume)
        self._constants = self.DeclareAbstractParameter(Value[object](_World.of(scenario)))
        self._anchor = self.DeclareVectorInputPort("anchor", 13)
        self._motion = self.DeclareDiscreteState(np.eye(13)[0])
        self._held = self.DeclareDiscreteState(np.array([0.0, 0.0, 0.0, 0.0, 0.0, self.compliance.weight]))
        self._load = self.DeclareDiscreteState(np.zeros(1))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        held, motion = {self.discrete_state_ticket(self._held)}, {self.discrete_state_ticket(self._motion)}
        self.DeclareVectorOutputPort("held_wrench", 6, self._calc_held, held)
        self.DeclareAbstractOutputPort(
            "reaction_forces", lambda: AbstractValue.Make([SpatialForce.Zero()]), self._calc_reaction, held | motion
        )
        self.DeclareVectorOutputPort("as_on_rig", 4, self._calc_as_on_rig, motion)

    def set_start(self, context: Context, X_WP: RigidTransform) -> None:
        """Puts the peg at a pose in W, at rest; ``context`` is the root context."""
        pose = np.concatenate([X_WP.rotation().ToQuaternion().wxyz(), X_WP.translation(), np.zeros(6)])
        self.GetMyMutableContextFromRoot(context).SetDiscreteState(self._motion, pose)

    def set_trial(self, context: Context, trial: Scenario) -> None:
        """Sets the friction and the place of the hole of another resolved scenario."""
        self._set_world(context, _World.of(trial))

    def set_hole(self, context: Context, X_WH: RigidTransform) -> None:
        """Puts the hole at a pose in W; ``context`` is the root context."""
        pose = np.concatenate([X_WH.rotation().ToQuaternion().wxyz(), X_WH.translation()])
        world = self._world(self.GetMyContextFromRoot(context))
        self._set_world(context, world._replace(hole=pose))

    def pose(self, context: Context) -> RigidTransform:
        """Returns X_WP; ``context`` is the root context."""
        return free_body_pose(self._state(self.GetMyContextFromRoot(context))[:7])

    def peg_in_hole(self, context: Context) -> RigidTransform:
        """Returns X_HP; ``context`` is the root context."""
        own = self.GetMyContextFromRoot(context)
        return free_body_pose(seen_from(self._world(own).hole, self._state(own))[:7])

    def contact_extent(self, context: Context) -> float:
        """Returns the sum of the normal forces in the last step, N; ``context`` is the root context."""
        return float(self.GetMyContextFromRoot(context).get_discrete_state(self._load).value()[0])

    def contacts(self, context: Context) -> list[Contact]:
        """Returns the single contacts of the step that would follow, in H; ``context`` is the root context."""
        own = self.GetMyContextFromRoot(context)
        _, _, found, contacts, forces = self._advanced(own, 1)
        parts = NormalForces(contacts[:found, POINT].copy(), contacts[:found, NORMAL].copy(), forces[:found])
        return single_contacts(parts, RigidTransform(), self.peg_in_hole(context), chamfer=self._chamfer)

    def _world(self, own: Context) -> _World:
        found: _World = own.get_abstract_parameter(self._constants).get_value()
        return found

    def _set_world(self, context: Context, world: _World) -> None:
        own = self.GetMyMutableContextFromRoot(context)
        own.get_mutable_abstract_parameter(self._constants).set_value(world)

    def _state(self, own: Context) -> Array:
        return np.array(own.get_discrete_state(self._motion).value())

    def _advanced(self, own: Context, count: int) -> tuple[Array, Array, int, Array, Array]:
        """Returns the motion (13,) of the peg in H after some steps, and then what `advance_held_peg` returns."""
        bodies, hole = self._world(own)
        state, anchor = seen_from(hole, self._state(own)), seen_from(hole, np.array(self._anchor.Eval(own)))
        weight = -self.compliance.weight * rotation_of(hole[:4])[2]
        held, found, contacts, forces = advance_held_peg(
            bodies, self.compliance, weight, state[:7], state[7:], anchor, self._step, count
        )
        return state, held, found, contacts, forces

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        hole = self._world(context).hole
        state, held, found, _, forces = self._advanced(context, self._count)
        R = rotation_of(hole[:4])
        discrete_state.set_value(self._motion, seen_from(inverse(hole), state))
        discrete_state.set_value(self._held, np.concatenate([R @ held[:3], R @ held[3:]]))
        discrete_state.set_value(self._load, [forces[:found].sum()])

    def _calc_held(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state(self._held).value())

    def _calc_reaction(self, context: Context, output: AbstractValue) -> None:
        held = context.get_discrete_state(self._held).value()
        R_PW = rotation_of(self._state(context)[:4]).T
        torque, force = R_PW @ held[:3], R_PW @ held[3:]
        moment = torque - np.cross([0.0, 0.0, self._sensor], force)
        output.set_value([SpatialForce(tau=moment, f=force)])

    def _calc_as_on_rig(self, context: Context, output: BasicVector) -> None:
        motion = seen_from(self._world(context).hole, self._state(context))
        output.SetFromVector([motion[6], *rig_angles(rotation_of(motion[:4]))])


def rig_angles(R_HP: Array) -> tuple[float, float, float]:
    """Returns the angles (rad) of the axes of a rig with the same orientation (3, 3) of the peg in the hole."""
    R = R_HP.T  # R_WH, of a peg that is upright
    yaw = math.asin(R[0, 2])
    return math.atan2(-R[1, 2], R[2, 2]), yaw, math.atan2(-R[0, 1], R[0, 0])


class _World(NamedTuple):
    """What a trial has of its own: the bodies with their friction, and the pose (7,) of the hole in W, w first."""

    bodies: Bodies
    hole: Array

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        x, y = scenario.arm.hole_offset or (0.0, 0.0)
        return cls(Bodies.of(scenario), np.array([1.0, 0.0, 0.0, 0.0, x, y, 0.0]))
