"""The interface of an arm with a protocol of its own."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from skill.arrays import Array


class ArmState(NamedTuple):
    """What an arm reports of itself.

    Attributes:
        time: on the clock of the arm, s.
        angles: (n,), of the joints, rad.
        rates: (n,), of the joints, rad/s.
        wrench: (6,), the arm's own estimate of the force (N) and then of the moment (N m) of the world on its flange,
            about the origin of the flange, along the axes of the base.
        fault: why the arm does not move, in its own words; "" if it does.
    """

    time: float
    angles: Array
    rates: Array
    wrench: Array
    fault: str


class RobotArm(Protocol):
    """An arm that follows joint motions. Its own limits of force and speed stay in force.

    Attributes:
        period: time between two commands that `follow` can use, s.
    """

    period: float

    def state(self) -> ArmState:
        """Returns the newest state; it waits for none.

        Raises:
            ConnectionError: if the arm no longer answers.
        """

    def move_to(self, angles: Array, speed: float) -> None:
        """Moves to joint angles (n,), rad, and waits until the arm is there; no joint is faster than ``speed``, rad/s.

        Raises:
            ConnectionError: if the arm stops on the way. The message says why.
        """

    def follow(self, angles: Array, rates: Array) -> None:
        """Lets the joints be at angles (n,), rad, now, and move on with rates (n,), rad/s.

        The arm stops by itself where this is not said again for some `period`.

        Raises:
            ConnectionError: if the arm has stopped. The message says why.
        """

    def set_tool(self, mass: float, centre: Array) -> None:
        """Says what the arm carries: a mass (kg) and its centre (3,) in the frame of the flange, m."""

    def stop(self) -> None:
        """Stops the arm as fast as it can, and lets it hold its place."""

    def close(self) -> None:
        """Stops the arm and ends the connection."""
