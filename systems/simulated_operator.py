"""A simulated person who sees the tilt, late and inexactly, and feels the rendered force."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from models.scenario import Operator
from systems.noise import standard_normal
from systems.rotation import from_rotation_vector, rotation_between

# The operator's state: what the hand does from the last decision on.
DEPTH, TILT, SPEED, TURN, DECIDED, HINDERED = 0, slice(1, 3), 3, slice(4, 6), 6, 7
OFFSET, SLIDE = slice(8, 10), slice(10, 12)
STATE_SIZE = 12
HINDERED_SHARE = 0.5  # of the comfortable force: pushing harder than this is felt as being stuck


class SimulatedOperator(LeafSystem):
    """
    .. pydrake_system::

        name: SimulatedOperator
        input_ports:
        - peg_pose
        - rendered_wrench
        output_ports:
        - hand_pose

    The hand holds the probe by its depth s along its own axis a, the tilt (theta_x, theta_y) of that axis, and the
    offset of the axis from the mouth's centre. Every decision period it sets, and then holds, the rates

        d theta/dt = clip(-k_sight seen(t - delay)) + k_touch m_felt,
        ds/dt      = v max(-1/2, 1 - F_felt/F_comfortable),

    where ``seen`` is the true tilt of the peg plus a personal bias and white noise (zero inside a dead zone), m_felt
    the rendered moment across the axis and F_felt the rendered push along it. An offset that is seen is closed like a
    tilt. A person whose patience ends pulls the peg out again. Tremor is a sine on depth and tilt. The pose is that of
    the probe in H; ``peg_pose`` is X_HP.
    """

    def __init__(
        self, *, operator: Operator, seed: int, start_height: float, tilt: list[float], offset: list[float]
    ) -> None:
        super().__init__()
        self._operator = operator
        self._seed = seed
        self._start_depth = -start_height
        self._peg_pose = self.DeclareAbstractInputPort("peg_pose", Value[RigidTransform]())
        self._rendered_wrench = self.DeclareVectorInputPort("rendered_wrench", 6)
        start = np.zeros(STATE_SIZE)
        start[DEPTH], start[TILT], start[OFFSET] = self._start_depth, tilt, offset
        self._hand = self.DeclareDiscreteState(start)
        # What was seen, newest first; the oldest entry is what reaches the hand now.
        delay = max(1, round(operator.sight_delay / operator.decision_period))
        self._seen = self.DeclareDiscreteState(np.tile([*tilt, *offset], delay))
        self._phase = 2.0 * math.pi * np.random.default_rng([seed, 9]).random(3)
        self.DeclarePeriodicDiscreteUpdateEvent(operator.decision_period, 0.0, self._decide)
        self._hand_pose = self.DeclareAbstractOutputPort(
            "hand_pose",
            Value[RigidTransform],
            self._calc_hand_pose,
            {self.discrete_state_ticket(self._hand), self.time_ticket()},
        )

    def hand_pose(self, hand: NDArray[np.float64], time: float) -> RigidTransform:
        """X_HD of a hand state at ``time`` (s)."""
        o = self._operator
        elapsed = time - hand[DECIDED]
        wobble = np.sin(2.0 * math.pi * o.tremor_frequency * time + self._phase)
        depth = hand[DEPTH] + hand[SPEED] * elapsed + o.tremor * wobble[0]
        tilt = hand[TILT] + hand[TURN] * elapsed + o.tremor_angle * wobble[1:]
        offset = hand[OFFSET] + hand[SLIDE] * elapsed
        R_HD = from_rotation_vector(np.array([tilt[0], tilt[1], 0.0]))
        return RigidTransform(R_HD, np.array([*offset, 0.0]) - depth * R_HD.col(2))

    def _calc_hand_pose(self, context: Context, output: Value) -> None:
        output.set_value(self.hand_pose(context.get_discrete_state(self._hand).value(), context.get_time()))

    def _decide(self, context: Context, discrete_state: DiscreteValues) -> None:
        o = self._operator
        now = context.get_time()
        hand = context.get_discrete_state(self._hand).value().copy()
        elapsed = now - hand[DECIDED]
        hand[DEPTH] += hand[SPEED] * elapsed
        hand[TILT] += hand[TURN] * elapsed
        hand[OFFSET] += hand[SLIDE] * elapsed
        hand[DECIDED] = now

        X_HP = self._peg_pose.Eval(context)
        tilt, offset = seen_misalignment(X_HP)
        tick = round(now / o.decision_period)
        noise = o.sight_noise * standard_normal(self._seed, "sight", tick, 2)
        bias = np.asarray(o.sight_bias if o.sight_bias is not None else [0.0, 0.0])
        memory = context.get_discrete_state(self._seen).value().reshape(-1, 4)
        late = memory[-1]
        newest = np.concatenate([tilt + bias + noise, offset])
        discrete_state.get_mutable_vector(self._seen).SetFromVector(np.vstack([newest, memory[:-1]]).ravel())

        torque, force = np.split(self._rendered_wrench.Eval(context), 2)
        R_HD = from_rotation_vector(np.array([*hand[TILT], 0.0]))
        push = float(force @ R_HD.col(2))  # the force on the probe, out of the hole
        turn = -o.align_gain * late[:2] if np.linalg.norm(late[:2]) > o.dead_zone else np.zeros(2)
        fastest = np.linalg.norm(turn)
        if fastest > o.align_rate:
            turn *= o.align_rate / fastest
        hand[TURN] = turn + o.touch_gain * torque[:2]
        hand[SLIDE] = -o.align_gain * late[2:]
        hand[SPEED] = o.insertion_speed * max(-0.5, 1.0 - push / o.comfortable_force)
        if push > HINDERED_SHARE * o.comfortable_force:
            hand[HINDERED] += o.decision_period
        if hand[HINDERED] > o.patience:
            hand[SPEED] = -o.insertion_speed
            hand[TURN] = 0.0
        discrete_state.get_mutable_vector(self._hand).SetFromVector(hand)


def seen_misalignment(X_HP: RigidTransform) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What an eye could tell of the peg: tilt of its axis (rad, about x and y), offset of its axis at the mouth (m)."""
    axis = X_HP.rotation().col(2)
    tilt = rotation_between(np.array([0.0, 0.0, 1.0]), axis)[:2]
    tip = X_HP.translation()
    return tilt, (tip - axis * (tip[2] / axis[2]))[:2]
