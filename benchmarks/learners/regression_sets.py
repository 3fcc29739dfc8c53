"""Regression problems with known noiseless outputs.

Each generator takes a number of samples and a seed and returns a ``Problem``. Use different seeds for training and
evaluation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array
from skill.features.wrench_features import CanonicalFeatures, NormalisedFeatures, RawFeatures

FEATURES = {"raw": RawFeatures, "normalised": NormalisedFeatures, "canonical": CanonicalFeatures}


@dataclass(frozen=True)
class Problem:
    """A regression problem.

    Attributes:
        X: (n, d), features.
        y: (n, p), noisy outputs, in the frame of the features.
        groups: (n,), number of the group (demonstration) of each sample.
        truth: (n, p), noiseless outputs, in a frame that does not depend on the features.
        judged: converts outputs (n, p) from the frame of the features to that of ``truth``.
        framed: converts outputs (n, p) from the frame of ``truth`` to that of the features.
    """

    X: Array
    y: Array
    groups: NDArray[np.intp]
    truth: Array
    judged: Callable[[Array], Array] = lambda outputs: outputs
    framed: Callable[[Array], Array] = lambda outputs: outputs


def cross(n: int, seed: int) -> Problem:
    """The cross-shaped surface of Schaal and Atkeson, Neural Computation 10, 1998; noise 0.1."""
    rng = np.random.default_rng(seed)
    X = rng.uniform(-1, 1, (n, 2))
    a, b = X[:, 0] ** 2, X[:, 1] ** 2
    truth = np.maximum.reduce([np.exp(-10 * a), np.exp(-50 * b), 1.25 * np.exp(-5 * (a + b))])[:, None]
    return Problem(X, truth + 0.1 * rng.normal(size=truth.shape), np.arange(n), truth)


def friedman(n: int, seed: int) -> Problem:
    """Friedman's first function, Annals of Statistics 19, 1991: five of ten features matter; noise 1."""
    rng = np.random.default_rng(seed)
    X = rng.uniform(0, 1, (n, 10))
    truth = 10 * np.sin(np.pi * X[:, 0] * X[:, 1]) + 20 * (X[:, 2] - 0.5) ** 2 + 10 * X[:, 3] + 5 * X[:, 4]
    truth = truth[:, None]
    return Problem(X, truth + rng.normal(size=truth.shape), np.arange(n), truth)


def insertion(n: int, seed: int, features: str = "canonical", demonstrations: int = 30) -> Problem:
    """A simplified quasi-static model of insertions: a tilted peg is aligned while it goes in.

    Each demonstration has a tilt of at most 3.5 deg in a random direction, a random wall stiffness and friction 0.2.
    When the tilt exceeds what the clearance allows at the present depth, two contacts wedge the peg. They cause a
    couple that grows with the excess, a smaller net lateral force, and axial friction at both contacts. The operator
    sees the tilt with noise, reduces it at a rate of 4 / s, and feeds more slowly under a larger contact force. The
    learner sees only the wrench and the depth.

    The outputs are the turn about x and y and the feed within one sample of 20 ms, in mrad and 0.1 mm. ``y`` is in the
    frame of the features, ``truth`` in P.

    Args:
        n: number of samples, rounded down to a multiple of ``demonstrations``.
        seed: seed of all random draws.
        features: a key of `FEATURES`.
        demonstrations: number of demonstrations.
    """
    rng = np.random.default_rng(seed)
    period, radius, clearance, friction = 0.02, 0.01, 50e-6, 0.2
    length = n // demonstrations
    measured, seen, right = [], [], []
    for _ in range(demonstrations):
        size, direction = np.deg2rad(rng.uniform(0.5, 3.5)), rng.uniform(-np.pi, np.pi)
        tilt = size * np.array([np.cos(direction), np.sin(direction)])  # rotation vector, P about H
        stiffness = 30.0 * np.exp(0.5 * rng.normal())  # N m / rad, of the wedge
        depth = rng.uniform(2e-3, 6e-3)
        for _ in range(length):
            theta = float(np.linalg.norm(tilt))
            axis = tilt / max(theta, 1e-9)
            free = min(2 * clearance / depth, theta)
            couple = stiffness * (theta - free)  # resists the tilt
            contact = couple / depth  # the force of each of the two contacts
            lateral = 0.3 * contact + 40.0 * theta
            # z x axis is the direction in which the upper end of the peg leans; the mouth pushes it back.
            across = np.array([-axis[1], axis[0]])
            wrench = np.zeros(6)
            wrench[:2] = -lateral * across
            wrench[2] = 1.0 + friction * (2 * contact + lateral)
            wrench[3:5] = -couple * axis - depth * lateral * axis
            wrench += rng.normal(size=6) * [0.05, 0.05, 0.1, 5e-4, 5e-4, 5e-4]
            speed = 0.02 / (1.0 + contact / 10.0)
            truth = np.array([*(-4.0 * period * tilt), speed * period])
            action = truth + np.array([*(4.0 * period * np.deg2rad(0.15) * rng.normal(size=2)), 0.0])
            measured.append([*wrench, -depth])
            seen.append(action)
            right.append(truth)
            tilt = tilt + action[:2] + 1e-4 * rng.normal(size=2)
            depth += truth[2]
    M = np.array(measured)
    frame = FEATURES[features](peg_radius=radius)
    units = np.array([1e3, 1e3, 1e4])
    return Problem(
        X=frame.transform(M),
        y=frame.actions_to_frame(M, np.array(seen) * units),
        groups=np.repeat(np.arange(demonstrations), length),
        truth=np.array(right) * units,
        judged=lambda outputs: frame.actions_from_frame(M, outputs),
        framed=lambda outputs: frame.actions_to_frame(M, outputs),
    )
