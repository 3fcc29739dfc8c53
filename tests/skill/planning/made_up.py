"""A peg whose wall pushes it along the canonical x axis: turning about y relieves it, feeding loads it."""

import numpy as np

from skill.features.responses import ResponseFeatures
from skill.features.wrench_features import NormalisedFeatures

STIFFNESS = 100.0  # N/rad
CLIMB = 2000.0  # N/m
PERIOD = 0.02
FEATURES = ResponseFeatures(NormalisedFeatures(), peg_radius=0.01)  # without a canonical frame, so that axes stay


def series(rng, forces, feeds):
    """Observations (n, 9) of a demonstration with lateral forces (n,), N, and feeds (n - 1,), m.

    The turns about y are those which the law of the wall needs for the forces; those about x are noise.
    """
    n = len(forces)
    z = -0.002 + np.concatenate([[0.0], np.cumsum(feeds)])
    turned = np.column_stack([np.cumsum(rng.normal(0.0, 1e-4, n)), -(forces - CLIMB * -z) / STIFFNESS])
    measured = np.zeros((n, 7))
    measured[:, 0], measured[:, 2], measured[:, 6] = forces, 5.0, z
    return np.column_stack([measured, turned])
