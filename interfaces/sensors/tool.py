"""What hangs on a sensor, and how the sensor is mounted: both from a few readings at rest.

A tool with the mass m and its centre of mass c in the frame S of the sensor adds, in the gravity g, to the readings

    f = b_f + m R_SW g,    tau = b_tau + c x m R_SW g,

with the biases b. Both are linear in (m, m c, b), so that readings at some orientations R_WS give these by least
squares.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from skill.arrays import Array

GRAVITY = np.array([0.0, 0.0, -9.81])
"""In W, m/s^2."""

LEAST_SPREAD = math.radians(20.0)
"""Least angle, rad, between directions of gravity in S, about two axes, that tells mass and bias apart."""

LARGEST_ERROR = 0.05
"""Largest root mean square of the forces that the model leaves, in units of 1 N and the weight."""

LEAST_PUSH = 2.0
"""Least change of the force in a push, N."""

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Tool:
    """A tool on a sensor.

    Attributes:
        mass: kg.
        centre: (3,), centre of mass in S, m.
        bias: (6,), N and N m.
        force_error, moment_error: root mean square of what the model leaves of the readings, N and N m.
    """

    mass: float
    centre: Array
    bias: Array
    force_error: float
    moment_error: float

    def contact(self, reading: Array, R_WS: Array) -> Array:
        """Returns the wrench (6,) of the contact on the tool in S, about the origin of S, of a reading (6,)."""
        weight = self.mass * (R_WS.T @ GRAVITY)
        return np.asarray(reading - self.bias - np.concatenate([weight, np.cross(self.centre, weight)]))

    def with_bias(self, reading: Array, R_WS: Array) -> Tool:
        """Returns the tool with the bias of a reading (6,) in free air."""
        return replace(self, bias=self.bias + self.contact(reading, R_WS))

    def check(self) -> None:
        """Checks that the readings were those of a weight.

        Raises:
            ValueError: if the mass is negative, or the model leaves much of the readings. The message says why.
        """
        if self.mass < 0.0:
            raise ValueError(
                f"what hangs on the sensor has a mass of {self.mass:.3f} kg: the sensor reports the force of the tool"
                " on the world; change the sign of all six numbers"
            )
        if self.force_error > LARGEST_ERROR * (1.0 + self.mass * 9.81):
            raise ValueError(
                f"a mass of {self.mass:.3f} kg leaves {self.force_error:.2f} N of the readings: the sensor is mounted"
                " turned, its axes are swapped, or something touches the tool"
            )


def identify_tool(R_WS: ArrayLike, readings: ArrayLike) -> Tool:
    """Returns the tool and the biases of readings at rest.

    Args:
        R_WS: (n, 3, 3), orientations of the sensor.
        readings: (n, 6), mean readings there, N and N m.

    Raises:
        ValueError: if the orientations are too much alike.
    """
    R, found = np.asarray(R_WS, dtype=float), np.asarray(readings, dtype=float)
    g = R.transpose(0, 2, 1) @ GRAVITY
    spread = np.linalg.svd(g - g.mean(axis=0), compute_uv=False)[1] / math.sqrt(len(g)) if len(g) > 2 else 0.0
    least = np.linalg.norm(GRAVITY) * math.sin(0.5 * LEAST_SPREAD)
    if spread < least:
        raise ValueError(
            f"{len(g)} orientations in which gravity spreads by {math.degrees(spread / 9.81):.0f} deg about the second"
            f" axis; expected three or more that are turned by {math.degrees(LEAST_SPREAD):.0f} deg about two axes"
        )
    ones = np.tile(np.eye(3), (len(g), 1))
    forces = np.hstack([g.reshape(-1, 1), ones])
    (mass, *force_bias), *_ = np.linalg.lstsq(forces, found[:, :3].ravel(), rcond=None)
    # c x m g = -(g x) m c
    skew = np.array([[[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]] for x, y, z in g]).reshape(-1, 3)
    moments = np.hstack([skew, ones])
    solved, *_ = np.linalg.lstsq(moments, found[:, 3:].ravel(), rcond=None)
    left = forces @ [mass, *force_bias] - found[:, :3].ravel(), moments @ solved - found[:, 3:].ravel()
    return Tool(
        mass=float(mass),
        centre=solved[:3] / mass if mass else np.zeros(3),
        bias=np.array([*force_bias, *solved[3:]]),
        force_error=float(np.sqrt(np.mean(left[0] ** 2))),
        moment_error=float(np.sqrt(np.mean(left[1] ** 2))),
    )


def check_pushes(pushes: Mapping[str, ArrayLike]) -> None:
    """Checks signs and axes of a sensor by pushes on its tool.

    Args:
        pushes: change of the force (3,), N, by the direction in which the tool was pushed, such as ``"+x"``, in the
            frame that the program believes to be S.

    Raises:
        ValueError: if a push is too weak, or is not measured in its direction. The message says what was measured.
    """
    for direction, change in pushes.items():
        force = np.asarray(change, dtype=float)
        axis = int(np.abs(force).argmax())
        if abs(force[axis]) < LEAST_PUSH:
            raise ValueError(
                f"pushed along {direction}: the force changed by {np.abs(force).max():.2f} N; push with at least"
                f" {LEAST_PUSH:g} N"
            )
        measured = ("+" if force[axis] > 0.0 else "-") + AXES[axis]
        if measured != direction:
            raise ValueError(
                f"{direction} is measured as {measured}; expected the force of the world on the tool, along the axes of"
                " the flange: correct the signs of the sensor, or the rotation from the flange to it"
            )
