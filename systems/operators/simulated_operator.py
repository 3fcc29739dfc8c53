"""A simulated person who sees the tilt, late and inexactly, and feels the rendered force."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from models.scenario import OperatorParameters
from systems.math.noise import standard_normal
from systems.math.rotation import from_rotation_vector, rotation_between

# The hand's state: where it was at the last decision, and what it does from there on.
DEPTH, TILT, OFFSET, DECIDED, HINDERED = 0, slice(1, 3), slice(3, 5), 5, 6
SPEED, TURN, SLIDE = 7, slice(8, 10), slice(10, 12)
BEGUN, TILT_MOVE, OFFSET_MOVE = 12, slice(13, 15), slice(15, 17)  # the correction under way, and its whole size
STATE_SIZE = 17
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
    offset of the axis from the mouth's centre. Two channels tell it what to do.

    Sight is late and inexact: the peg's true tilt and offset a delay ago, plus a personal bias and white noise, and
    nothing inside a dead zone. It acts intermittently: once every correction period T_c the hand begins a stroke of

        d theta = -clip(k_sight seen) T_c,

    which it carries out blindly, with a minimum-jerk speed, in the correction time; an offset likewise. Touch is the
    rendered wrench alone, and acts at every decision:

        d theta/dt = k_touch m_felt,    d offset/dt = k_slide f_felt,    ds/dt = v max(-1/2, 1 - F_felt/F_comfortable),

    with m and f the moment and force across the axis, and F the push along it. A person whose patience ends pulls the
    peg out again. Tremor is a sine on every coordinate. The pose is that of the probe in H; ``peg_pose`` is X_HP.
    """

    def __init__(
        self, *, operator: OperatorParameters, seed: int, start_height: float, tilt: list[float], offset: list[float]
    ) -> None:
        super().__init__()
        self._operator = operator
        self._seed = seed
        self._peg_pose = self.DeclareAbstractInputPort("peg_pose", Value[RigidTransform]())
        self._rendered_wrench = self.DeclareVectorInputPort("rendered_wrench", 6)
        rng = np.random.default_rng([seed, 9])
        self._phase = 2.0 * math.pi * rng.random(5)
        start = np.zeros(STATE_SIZE)
        start[DEPTH], start[TILT], start[OFFSET] = -start_height, tilt, offset
        # The first correction comes within one period, at a moment of its own.
        start[BEGUN] = (
            rng.uniform(operator.correction_time - operator.correction_period, 0.0) - operator.correction_time
        )
        self._hand = self.DeclareDiscreteState(start)
        # What was seen, newest first; the oldest entry is what reaches the hand now.
        delay = max(1, round(operator.sight_delay / operator.decision_period))
        self._seen = self.DeclareDiscreteState(np.tile([*tilt, *offset], delay))
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
        depth, tilt, offset = self._steady_hand(hand, time)
        wobble = np.sin(2.0 * math.pi * o.tremor_frequency * time + self._phase)
        depth += o.tremor * wobble[0]
        tilt = tilt + o.tremor_angle * wobble[1:3]
        offset = offset + o.tremor * wobble[3:5]
        R_HD = from_rotation_vector(np.array([tilt[0], tilt[1], 0.0]))
        return RigidTransform(R_HD, np.array([offset[0], offset[1], 0.0]) - depth * R_HD.col(2))

    def _steady_hand(
        self, hand: NDArray[np.float64], time: float
    ) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
        """Depth, tilt and offset at ``time``, without the tremor."""
        elapsed = time - hand[DECIDED]
        duration = self._operator.correction_time
        stroke = minimum_jerk((time - hand[BEGUN]) / duration) - minimum_jerk((hand[DECIDED] - hand[BEGUN]) / duration)
        return (
            float(hand[DEPTH] + hand[SPEED] * elapsed),
            hand[TILT] + hand[TURN] * elapsed + hand[TILT_MOVE] * stroke,
            hand[OFFSET] + hand[SLIDE] * elapsed + hand[OFFSET_MOVE] * stroke,
        )

    def _calc_hand_pose(self, context: Context, output: Value) -> None:
        output.set_value(self.hand_pose(context.get_discrete_state(self._hand).value(), context.get_time()))

    def _decide(self, context: Context, discrete_state: DiscreteValues) -> None:
        o = self._operator
        now = context.get_time()
        hand = context.get_discrete_state(self._hand).value().copy()
        hand[DEPTH], hand[TILT], hand[OFFSET] = self._steady_hand(hand, now)
        hand[DECIDED] = now

        memory = context.get_discrete_state(self._seen).value().reshape(-1, 4)
        late = memory[-1]
        newest = self._look(self._peg_pose.Eval(context), tick=round(now / o.decision_period))
        discrete_state.get_mutable_vector(self._seen).SetFromVector(np.vstack([newest, memory[:-1]]).ravel())
        if now - hand[BEGUN] > o.correction_period - 0.5 * o.decision_period:
            hand[BEGUN] = now
            hand[TILT_MOVE], hand[OFFSET_MOVE] = self._plan(late[:2], late[2:])

        torque, force = np.split(self._rendered_wrench.Eval(context), 2)
        R_HD = from_rotation_vector(np.array([*hand[TILT], 0.0]))
        push = float(force @ R_HD.col(2))  # the force on the probe, out of the hole
        across = force - push * R_HD.col(2)
        hand[TURN] = o.touch_gain * torque[:2]
        hand[SLIDE] = o.touch_slide * across[:2]
        hand[SPEED] = o.insertion_speed * max(-0.5, 1.0 - push / o.comfortable_force)
        if push > HINDERED_SHARE * o.comfortable_force:
            hand[HINDERED] += o.decision_period
        if hand[HINDERED] > o.patience:
            hand[SPEED] = -o.insertion_speed
            hand[TURN], hand[SLIDE], hand[TILT_MOVE], hand[OFFSET_MOVE] = 0.0, 0.0, 0.0, 0.0
        discrete_state.get_mutable_vector(self._hand).SetFromVector(hand)

    def _look(self, X_HP: RigidTransform, *, tick: int) -> NDArray[np.float64]:
        """Tilt and offset as they are seen now; they reach the hand after the delay."""
        o = self._operator
        tilt, offset = seen_misalignment(X_HP)
        noise = standard_normal(self._seed, "sight", tick, 4)
        tilt_bias = o.sight_bias if o.sight_bias is not None else [0.0, 0.0]
        offset_bias = o.offset_bias if o.offset_bias is not None else [0.0, 0.0]
        return np.concatenate(
            [tilt + tilt_bias + o.sight_noise * noise[:2], offset + offset_bias + o.offset_noise * noise[2:]]
        )

    def _plan(
        self, tilt: NDArray[np.float64], offset: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The stroke that answers a tilt and an offset that have been seen."""
        o = self._operator
        turn = -o.align_gain * tilt if np.linalg.norm(tilt) > o.dead_zone else np.zeros(2)
        fastest = np.linalg.norm(turn)
        if fastest > o.align_rate:
            turn *= o.align_rate / fastest
        slide = -o.align_gain * offset if np.linalg.norm(offset) > o.offset_dead_zone else np.zeros(2)
        return turn * o.correction_period, slide * o.correction_period


def minimum_jerk(share: float) -> float:
    """How far a minimum-jerk stroke has come after this share of its time: 0 before it, 1 after it."""
    s = min(1.0, max(0.0, share))
    return s**3 * (10.0 + s * (6.0 * s - 15.0))


def seen_misalignment(X_HP: RigidTransform) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What an eye could tell of the peg: tilt of its axis (rad, about x and y), offset of its axis at the mouth (m)."""
    axis = X_HP.rotation().col(2)
    tilt = rotation_between(np.array([0.0, 0.0, 1.0]), axis)[:2]
    tip = X_HP.translation()
    return tilt, (tip - axis * (tip[2] / axis[2]))[:2]
