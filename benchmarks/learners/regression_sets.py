"""Regression problems with known truth, for benchmarks.

Each generator takes a number of samples and a seed, and returns a ``Problem``: features, noisy outputs,
groups and noiseless outputs. Judge on other seeds than those learnt from.
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
    """Features X (n, d), outputs y (n, p), groups (n,), noiseless outputs truth (n, p).

    ``judged`` turns outputs of the learner's frame into those of the truth's, the same for all features, and
    ``framed`` turns them back.
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
    """A quasi-static caricature of insertions: a tilted peg is aligned while it goes in.

    Per demonstration: a tilt in any direction up to 3.5 deg, walls of some stiffness, friction 0.2. Once
    the tilt exceeds what the clearance leaves at the present depth, two contacts wedge the peg: a couple
    that grows with the excess, a smaller net lateral force, and axial friction on both. The operator sees
    the tilt with noise, turns it away at 4 / s and feeds the slower the harder the contact. The learner
    sees the wrench and the depth only.

    Outputs: (omega_x, omega_y, feed) in the features' frame, mrad and 0.1 mm a sample of 20 ms; judged in P.
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
            theta = np.linalg.norm(tilt)
            axis = tilt / max(theta, 1e-9)
            free = min(2 * clearance / depth, theta)
            couple = stiffness * (theta - free)  # resists the tilt
            contact = couple / depth  # the force of each of the two contacts
            lateral = 0.3 * contact + 40.0 * theta
            # z cross axis: where the upper end of the peg leans; the mouth pushes it back.
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
