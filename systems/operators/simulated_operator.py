"""Simulates an operator who sees the misalignment, late and inexactly, and feels the rendered wrench."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from models.operator import OperatorParameters
from systems.math.noise import standard_normal
from systems.math.rotation import clocking_angle, from_rotation_vector, rotation_between

HINDERED_SHARE = 0.5  # share of the comfortable force above which a push counts as hindered


@dataclass(frozen=True)
class HandState:
    """State of the hand; `as_list` and `from_vector` convert it to and from a discrete state (20,).

    Depth, tilt, offset and clocking are those at the last decision, without tremor; the rates and the stroke describe
    the motion since then.

    Attributes:
        depth: Depth of the probe along its axis, m.
        tilt: Tilt of the axis about x and y (2,), rad.
        offset: Offset of the axis at the mouth (2,), m.
        decided: Time of the last decision, s.
        hindered: Total time of hindered pushing, s.
        speed: Rate of the depth, m/s.
        turn_rate: Rate of the tilt due to touch (2,), rad/s.
        slide_rate: Rate of the offset due to touch (2,), m/s.
        stroke_start: Time at which the present visual correction began, s.
        stroke_turn: Whole change of the tilt in this correction (2,), rad.
        stroke_slide: Whole change of the offset in this correction (2,), m.
        clocking: Angle about the axis, rad.
        clocking_rate: Rate of the clocking due to touch, rad/s.
        stroke_clocking: Whole change of the clocking in this correction, rad.
    """

    depth: float
    tilt: NDArray[np.float64]
    offset: NDArray[np.float64]
    decided: float = 0.0
    hindered: float = 0.0
    speed: float = 0.0
    turn_rate: NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))
    slide_rate: NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))
    stroke_start: float = 0.0
    stroke_turn: NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))
    stroke_slide: NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))
    clocking: float = 0.0
    clocking_rate: float = 0.0
    stroke_clocking: float = 0.0

    @classmethod
    def from_vector(cls, v: NDArray[np.float64]) -> HandState:
        """The inverse of `as_list`."""
        return cls(
            depth=v[0],
            tilt=v[1:3],
            offset=v[3:5],
            decided=v[5],
            hindered=v[6],
            speed=v[7],
            turn_rate=v[8:10],
            slide_rate=v[10:12],
            stroke_start=v[12],
            stroke_turn=v[13:15],
            stroke_slide=v[15:17],
            clocking=v[17],
            clocking_rate=v[18],
            stroke_clocking=v[19],
        )

    def as_list(self) -> list[float]:
        """All fields in their order, arrays expanded."""
        return [
            *(self.depth, *self.tilt, *self.offset),
            *(self.decided, self.hindered),
            *(self.speed, *self.turn_rate, *self.slide_rate),
            *(self.stroke_start, *self.stroke_turn, *self.stroke_slide),
            *(self.clocking, self.clocking_rate, self.stroke_clocking),
        ]


class SimulatedOperator(LeafSystem):
    """
    .. pydrake_system::

        name: SimulatedOperator
        input_ports:
        - peg_pose
        - rendered_wrench
        output_ports:
        - hand_pose

    The hand holds the probe at a depth s along its axis a, with a tilt (theta_x, theta_y) of the axis and an offset of
    the axis from the centre of the mouth. It reacts to sight and to touch.

    Sight is late and inexact: the operator sees the true tilt and offset of the peg after a delay, with a personal bias
    and white noise, and ignores values inside a dead zone. Once per correction period T_c the hand begins a stroke of

        d theta = -clip(k_sight seen) T_c

    and completes it without feedback, with a minimum-jerk speed, in the correction time. An offset is corrected in the
    same way. Touch uses the rendered wrench and acts at every decision:

        d theta/dt = k_touch m_felt,    d offset/dt = k_slide f_felt,    ds/dt = v max(-1/2, 1 - F_felt/F_comfortable),

    where m and f are the moment and force across the axis, and F is the push along it. An operator whose patience ends
    pulls the peg out. Tremor adds a sine to every coordinate. ``hand_pose`` is the pose X_HD of the probe, ``peg_pose``
    is X_HP, and ``rendered_wrench`` is [torque; force] in H.

    Where the fixture leaves the angle about the axis, the operator sees and feels it as one of the tilts; the moment is
    then that along the axis.

    Args:
        operator: Parameters of one person, as drawn by `draw_person`.
        seed: Seed of the noise, the tremor's phases and the time of the first correction.
        start_height: Initial height of the tip above the mouth, along the axis, m; negative inside the hole.
        tilt: Initial tilt about x and y (2,), rad.
        offset: Initial offset along x and y (2,), m.
        clocking: Initial angle about the axis, rad; None where the operator does not turn the peg about its axis.
    """

    def __init__(
        self,
        *,
        operator: OperatorParameters,
        seed: int,
        start_height: float,
        tilt: list[float],
        offset: list[float],
        clocking: float | None = None,
    ) -> None:
        super().__init__()
        self._operator = operator
        self._seed = seed
        self._peg_pose = self.DeclareAbstractInputPort("peg_pose", Value[RigidTransform]())
        self._rendered_wrench = self.DeclareVectorInputPort("rendered_wrench", 6)
        rng = np.random.default_rng([seed, 9])
        self._phase = 2.0 * math.pi * rng.random(5)
        # The first correction begins at a random time within one period. The stroke before it is complete.
        begun = rng.uniform(operator.correction_time - operator.correction_period, 0.0) - operator.correction_time
        self._clocks, angle = clocking is not None, clocking or 0.0
        start = HandState(
            depth=-start_height, tilt=np.array(tilt), offset=np.array(offset), stroke_start=begun, clocking=angle
        )
        self._hand = self.DeclareDiscreteState(start.as_list())
        # The seen tilts, offsets and clocking angles, newest first; the hand reacts to the oldest.
        delay = max(1, round(operator.sight_delay / operator.decision_period))
        self._seen = self.DeclareDiscreteState(np.tile([*tilt, *offset, angle], delay))
        self.DeclarePeriodicDiscreteUpdateEvent(operator.decision_period, 0.0, self._decide)
        self._hand_pose = self.DeclareAbstractOutputPort(
            "hand_pose",
            Value[RigidTransform],
            self._calc_hand_pose,
            {self.discrete_state_ticket(self._hand), self.time_ticket()},
        )

    def hand_pose(self, hand: HandState, time: float) -> RigidTransform:
        """Returns X_HD of a hand state at ``time`` (s), with the tremor."""
        o = self._operator
        depth, tilt, offset, clocking = self._steady_hand(hand, time)
        wave = np.sin(2.0 * math.pi * o.tremor_frequency * time + self._phase)
        depth += o.tremor * wave[0]
        tilt = tilt + o.tremor_angle * wave[1:3]
        offset = offset + o.tremor * wave[3:5]
        R_HD = from_rotation_vector(np.array([tilt[0], tilt[1], 0.0])) @ RotationMatrix.MakeZRotation(clocking)
        return RigidTransform(R_HD, np.array([offset[0], offset[1], 0.0]) - depth * R_HD.col(2))

    def _steady_hand(
        self, hand: HandState, time: float
    ) -> tuple[float, NDArray[np.float64], NDArray[np.float64], float]:
        """Returns depth, tilt, offset and clocking at ``time`` (s), without the tremor."""
        elapsed = time - hand.decided
        duration = self._operator.correction_time
        before = minimum_jerk((hand.decided - hand.stroke_start) / duration)
        stroke = minimum_jerk((time - hand.stroke_start) / duration) - before
        return (
            float(hand.depth + hand.speed * elapsed),
            hand.tilt + hand.turn_rate * elapsed + hand.stroke_turn * stroke,
            hand.offset + hand.slide_rate * elapsed + hand.stroke_slide * stroke,
            float(hand.clocking + hand.clocking_rate * elapsed + hand.stroke_clocking * stroke),
        )

    def _calc_hand_pose(self, context: Context, output: Value) -> None:
        hand = HandState.from_vector(context.get_discrete_state(self._hand).value())
        output.set_value(self.hand_pose(hand, context.get_time()))

    def _decide(self, context: Context, discrete_state: DiscreteValues) -> None:
        o = self._operator
        now = context.get_time()
        hand = HandState.from_vector(context.get_discrete_state(self._hand).value())
        depth, tilt, offset, clocking = self._steady_hand(hand, now)
        hand = replace(hand, depth=depth, tilt=tilt, offset=offset, clocking=clocking, decided=now)

        memory = context.get_discrete_state(self._seen).value().reshape(-1, 5)
        newest = self._look(self._peg_pose.Eval(context), tick=round(now / o.decision_period))
        discrete_state.get_mutable_vector(self._seen).SetFromVector(np.vstack([newest, memory[:-1]]).ravel())
        if now - hand.stroke_start > o.correction_period - 0.5 * o.decision_period:
            hand = replace(
                hand,
                stroke_start=now,
                stroke_turn=self._stroke(memory[-1, :2], o.dead_zone, o.align_rate),
                stroke_slide=self._stroke(memory[-1, 2:4], o.offset_dead_zone),
                stroke_clocking=float(self._stroke(memory[-1, 4:], o.dead_zone, o.align_rate)[0]),
            )

        hand = self._react(hand, self._rendered_wrench.Eval(context))
        discrete_state.get_mutable_vector(self._hand).SetFromVector(hand.as_list())

    def _react(self, hand: HandState, wrench: NDArray[np.float64]) -> HandState:
        """Returns the hand with the rates that answer the rendered wrench [torque; force] (6,)."""
        o = self._operator
        torque, force = np.split(wrench, 2)
        R_HD = from_rotation_vector(np.array([*hand.tilt, 0.0]))
        push = float(force @ R_HD.col(2))  # force on the probe out of the hole
        across = force - push * R_HD.col(2)
        hindered = hand.hindered
        if push > HINDERED_SHARE * o.comfortable_force:
            hindered += o.decision_period
        if hindered > o.patience:
            zero = np.zeros(2)
            pulling = replace(hand, hindered=hindered, speed=-o.insertion_speed, turn_rate=zero, slide_rate=zero)
            return replace(pulling, stroke_turn=zero, stroke_slide=zero, clocking_rate=0.0, stroke_clocking=0.0)
        return replace(
            hand,
            hindered=hindered,
            speed=o.insertion_speed * max(-0.5, 1.0 - push / o.comfortable_force),
            turn_rate=o.touch_gain * torque[:2],
            slide_rate=o.touch_slide * across[:2],
            clocking_rate=o.touch_gain * float(torque @ R_HD.col(2)) if self._clocks else 0.0,
        )

    def _look(self, X_HP: RigidTransform, *, tick: int) -> NDArray[np.float64]:
        """Returns the seen tilt, offset and clocking (5,) of a peg at X_HP, with bias and noise."""
        o = self._operator
        tilt, offset = seen_misalignment(X_HP)
        noise = standard_normal(self._seed, "sight", tick, 4)
        tilt_bias = o.sight_bias if o.sight_bias is not None else [0.0, 0.0]
        offset_bias = o.offset_bias if o.offset_bias is not None else [0.0, 0.0]
        clocking = np.zeros(1)
        if self._clocks:
            own_noise = standard_normal(self._seed, "sight about the axis", tick, 1)
            clocking = clocking_angle(X_HP.rotation()) + (o.clocking_bias or 0.0) + o.sight_noise * own_noise
        return np.concatenate(
            [tilt + tilt_bias + o.sight_noise * noise[:2], offset + offset_bias + o.offset_noise * noise[2:], clocking]
        )

    def _stroke(self, seen: NDArray[np.float64], dead_zone: float, largest: float = math.inf) -> NDArray[np.float64]:
        """Returns the whole change (n,) in the stroke that answers what is seen (n,), rad or m.

        Args:
            seen: Angles or an offset.
            dead_zone: What is smaller is not corrected.
            largest: Mean rate of the change at most, in units of 1/s of ``seen``.
        """
        o = self._operator
        rate = -o.align_gain * seen if np.linalg.norm(seen) > dead_zone else np.zeros(len(seen))
        size = np.linalg.norm(rate)
        if size > largest:
            rate *= largest / size
        return rate * o.correction_period


def minimum_jerk(share: float) -> float:
    """Returns the completed share of a minimum-jerk stroke after a ``share`` of its time; both are in [0, 1]."""
    s = min(1.0, max(0.0, share))
    return s**3 * (10.0 + s * (6.0 * s - 15.0))


def seen_misalignment(X_HP: RigidTransform) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the visible misalignment of a peg.

    Args:
        X_HP: Pose of the peg.

    Returns:
        The tilt of its axis about x and y (2,), rad, and the offset of its axis at the mouth (2,), m.
    """
    axis = X_HP.rotation().col(2)
    tilt = rotation_between(np.array([0.0, 0.0, 1.0]), axis)[:2]
    tip = X_HP.translation()
    return tilt, (tip - axis * (tip[2] / axis[2]))[:2]
