"""A peg whose wall pushes it along the canonical x axis: turning about y relieves it, feeding loads it."""

import numpy as np

from skill.features.wrench_features import NormalisedFeatures
from skill.policy.planning_model import PlanningModel
from skill.policy.transitions import Transitions, transitions

STIFFNESS = 100.0  # N/rad
CLIMB = 2000.0  # N/m
PERIOD = 0.02
N = 60  # samples of a demonstration
FEATURES, RADIUS = NormalisedFeatures(), 0.01  # without a canonical frame, so that axes stay


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
    parts = []
    for k in range(demonstrations):
        forces = np.concatenate([rng.uniform(2.0, 6.0, N // 2), rng.uniform(1.0, 2.0, N // 2)])
        observed = series(rng, forces, rng.uniform(-2e-4, 0.0, N - 1))
        good = k < demonstrations - 1
        parts.append(transitions_of(observed, [0] * (N // 2) + [1 if good else 2] * (N // 2), good, n_states=3))
    return Transitions.joined(parts)


def transitions_of(observed, labels, good, *, n_states):
    return transitions(
        observed,
        np.array(labels),
        good=good,
        n_states=n_states,
        features=FEATURES,
        peg_radius=RADIUS,
        period=PERIOD,
    )


def fitted(rows, values=(0.5, 0.8, 0.0), **parameters):
    P = np.zeros((len(rows.times), 3))
    P[np.arange(len(P)), np.where(rows.loads[:, 0] >= 2.0, 0, 1)] = 1.0
    X = FEATURES.transform(rows.measured)
    return PlanningModel.learnt(rows, features=X, memberships=P, values=np.array(values), **parameters)
