"""A peg whose wall pushes it along the canonical x axis: turning about y relieves it, feeding loads it."""

import numpy as np

from skill.features.responses import ResponseFeatures
from skill.features.wrench_features import NormalisedFeatures
from skill.planning.planning_model import PlanningModel
from skill.planning.transitions import transitions

STIFFNESS = 100.0  # N/rad
CLIMB = 2000.0  # N/m
PERIOD = 0.02
N = 60  # samples of a demonstration
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


def made_up_rows(seed=0, demonstrations=6):
    """Transitions of demonstrations in three states: a force of 2 to 6 N, then 1 to 2 N; one of them ends otherwise."""
    rng = np.random.default_rng(seed)
    observed, labels, good = [], [], []
    for k in range(demonstrations):
        forces = np.concatenate([rng.uniform(2.0, 6.0, N // 2), rng.uniform(1.0, 2.0, N // 2)])
        observed.append(series(rng, forces, rng.uniform(-2e-4, 0.0, N - 1)))
        bad = k == demonstrations - 1
        labels.append([0] * (N // 2) + [2 if bad else 1] * (N // 2))
        good.append(not bad)
    return transitions(observed, labels, good, FEATURES, n_states=3, period=PERIOD)


def fitted(rows, values=(0.5, 0.8, 0.0), **parameters):
    P = np.zeros((len(rows.times), 3))
    P[np.arange(len(P)), np.where(rows.loads[:, 0] >= 2.0, 0, 1)] = 1.0
    return PlanningModel(**parameters).fit(rows, memberships=P, values=np.array(values))
