"""The servo's own peg: simulated at 1 kHz against the local model of the contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.scenario import Scenario
from skill.arrays import Array
from systems.math.rotation import from_rotation_vector, rotation_vector
from systems.servo.local_contact import LocalContact, Springs

CORRECTION = 0.012  # in units of s, over which a difference from the simulation is removed
ROUNDS = 5  # of the search for the springs that push; three are rarely exceeded
SLIP_SPEED = 1e-3  # in units of m/s, below which friction is proportional to the speed


@dataclass(frozen=True)
class PegState:
    """State of the local peg; `as_vector` and `from_vector` convert it to and from a discrete state (26,).

    Attributes:
        position: of the tip (3,), in H, m.
        turn: rotation vector of R_HP (3,), rad.
        velocity: [angular velocity; velocity] (6,), in H, rad/s and m/s.
        correction: what each tick adds (12,): rotation (rad), position (m), and the velocity's two parts.
        ticks: number of ticks for which it is added.
        seen: time of the model that was seen last, s.
    """

    position: Array
    turn: Array
    velocity: Array
    correction: Array
    ticks: float
    seen: float

    def as_vector(self) -> Array:
        """Returns (26,)."""
        return np.concatenate(
            [self.position, self.turn, self.velocity, self.correction, np.array([self.ticks, self.seen])]
        )

    @classmethod
    def from_vector(cls, v: Array) -> PegState:
        """Inverts `as_vector`."""
        return cls(v[0:3], v[3:6], v[6:12], v[12:24], float(v[24]), float(v[25]))


class LocalPeg(LeafSystem):
    """
    .. pydrake_system::

        name: LocalPeg
        input_ports:
        - peg_forces
        - contact
        output_ports:
        - peg_state

    A free body with the virtual peg's mass and inertia, which takes the place of the plant: the same forces act on it,
    and ``peg_state`` is a state like the plant's. ``contact`` is a `LocalContact`. One tick h solves

        (M + h D + h sum_i J_i^T (h k_i + d f_i) J_i) V' = M V + h (F + sum_i J_i^T f_i),

    in which F is the force of coupling and guide, and the springs i are those that push after the tick: k_i their
    stiffness, f_i their elastic force at the present pose, J_i V the speed of the peg along the normal, d the
    simulation's dissipation (Hunt and Crossley). D is the friction coefficient times the normal force over the slip
    speed, tangential at each spring.
    Springs, dissipation and friction are implicit, so that the tick is stable however stiff they are.

    When a new model arrives, its motion is carried on to the present with its velocity. The difference from the motion
    of the local peg is divided over the next ticks of `CORRECTION`, so that the force has no step.

    Args:
        scenario: of the simulation.
        period: of a tick, s.
        X_HP_start: pose at the start.
    """

    def __init__(self, *, scenario: Scenario, period: float, X_HP_start: RigidTransform) -> None:
        super().__init__()
        c = scenario.coupling
        self._period = period
        self._friction, self._dissipation = scenario.contact.friction, scenario.contact.dissipation
        self._mass = np.diag(np.repeat([c.peg_inertia, c.peg_mass], 3))
        self._ticks = max(1, round(CORRECTION / period))
        self._peg_forces = self.DeclareAbstractInputPort(
            "peg_forces", AbstractValue.Make([ExternallyAppliedSpatialForce()])
        )
        start = PegState(
            position=X_HP_start.translation(),
            turn=rotation_vector(X_HP_start.rotation()),
            velocity=np.zeros(6),
            correction=np.zeros(12),
            ticks=0,
            seen=0.0,
        )
        none = LocalContact(0.0, X_HP_start, np.zeros(6), Springs.none())
        self._contact = self.DeclareAbstractInputPort("contact", AbstractValue.Make(none))
        self._state = self.DeclareDiscreteState(start.as_vector())
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        self.DeclareVectorOutputPort("peg_state", 13, self._calc_state, {self.discrete_state_ticket(self._state)})

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        old = PegState.from_vector(context.get_discrete_state(self._state).value())
        model = self._contact.Eval(context)
        applied = self._peg_forces.Eval(context)[0].F_Bq_W
        force = np.concatenate([applied.rotational(), applied.translational()])
        R_HP = from_rotation_vector(old.turn)
        moved = np.concatenate(
            [rotation_vector(R_HP @ model.X_HP.rotation().inverse()), old.position - model.X_HP.translation()]
        )
        velocity = self.next_velocity(old.velocity, force, model.springs, moved, model.X_HP.translation())
        position = old.position + self._period * velocity[3:]
        R_HP = from_rotation_vector(self._period * velocity[:3]) @ R_HP
        correction, ticks = old.correction, old.ticks
        if model.time != old.seen:
            ahead = context.get_time() + self._period - model.time
            turn = from_rotation_vector(ahead * model.V_HP[:3]) @ model.X_HP.rotation() @ R_HP.inverse()
            there = model.X_HP.translation() + ahead * model.V_HP[3:]
            difference = [rotation_vector(turn), there - position, model.V_HP - velocity]
            correction, ticks = np.concatenate(difference) / self._ticks, self._ticks
        if ticks:
            R_HP = from_rotation_vector(correction[:3]) @ R_HP
            position, velocity, ticks = position + correction[3:6], velocity + correction[6:], ticks - 1
        new = PegState(position, rotation_vector(R_HP), velocity, correction, ticks, model.time)
        discrete_state.get_mutable_vector(self._state).SetFromVector(new.as_vector())

    def next_velocity(self, V_HP: Array, force: Array, springs: Springs, moved: Array, origin: Array) -> Array:
        """Returns the velocity (6,) after a tick.

        Args:
            V_HP: (6,), [angular velocity; velocity] before it, in H.
            force: (6,), [torque; force] of coupling and guide at the tip, in H.
            springs: of the contact.
            moved: (6,), rotation vector and displacement of the peg since the pose of the springs, in H.
            origin: (3,), tip at the pose of the springs, m.
        """
        h, k, f = self._period, springs.stiffnesses, springs.forces
        impulse = self._mass @ V_HP + h * force
        if not len(f):
            return impulse / self._mass.diagonal()
        r, n = springs.points - origin, springs.normals
        (x, y, z), (nx, ny, nz) = r.T, n.T
        J = np.column_stack([y * nz - z * ny, z * nx - x * nz, x * ny - y * nx, n])
        f = f - k * (J @ moved)
        normal_forces = np.maximum(0.0, f - h * k * (J @ V_HP))
        matrix = self._mass + h * self._friction_damping(V_HP, r, J, normal_forces)
        pushing = f > 0.0
        for _ in range(ROUNDS):
            Jp = J[pushing]
            damping = h * k[pushing] + self._dissipation * np.maximum(0.0, f[pushing])
            V = np.linalg.solve(matrix + h * Jp.T @ (damping[:, None] * Jp), impulse + h * Jp.T @ f[pushing])
            before, pushing = pushing, f - h * k * (J @ V) > 0.0
            if (before == pushing).all():
                break
        return np.asarray(V)

    def _friction_damping(self, V_HP: Array, r: Array, J: Array, forces: Array) -> Array:
        """(6, 6), damping matrix of the friction at points r from the tip.

        Sum of w (G^T G - J_i^T J_i), in which G = [-[r]x, 1] gives the velocity at r, J_i V is its part along the
        normal, and w is the weight of the point, friction coefficient times normal force over the slip speed.

        Args:
            V_HP: (6,), [angular velocity; velocity], in H.
            r: (n, 3), points, in H, m.
            J: (n, 6), rows of the normals.
            forces: (n,), normal forces, N.
        """
        (x, y, z), (wx, wy, wz) = r.T, V_HP[:3]
        velocity = V_HP[3:] + np.column_stack([wy * z - wz * y, wz * x - wx * z, wx * y - wy * x])
        slip = np.sqrt(np.maximum(0.0, (velocity * velocity).sum(axis=1) - (J @ V_HP) ** 2))
        weights = self._friction * forces / np.maximum(slip, SLIP_SPEED)
        second = r.T @ (weights[:, None] * r)
        sx, sy, sz = weights @ r
        found: Array = np.zeros((6, 6))
        found[:3, :3] = second.trace() * np.eye(3) - second
        found[:3, 3:] = [[0.0, -sz, sy], [sz, 0.0, -sx], [-sy, sx, 0.0]]
        found[3:, :3] = found[:3, 3:].T
        found[3:, 3:] = weights.sum() * np.eye(3)
        found -= J.T @ (weights[:, None] * J)
        return found

    def _calc_state(self, context: Context, output: BasicVector) -> None:
        state = PegState.from_vector(context.get_discrete_state(self._state).value())
        q = from_rotation_vector(state.turn).ToQuaternion().wxyz()
        output.SetFromVector(np.concatenate([q, state.position, state.velocity]))
