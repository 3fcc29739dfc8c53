"""Synthetic demonstrations whose answers follow a few laws, one for each context."""

import numpy as np


def make_mixture(slopes, *, groups=24, length=40, noise=0.3, seed=0):
    """Answers y = slope_k(x) u + noise of groups whose context k changes from group to group.

    Returns:
        Features (n, 2), inputs (n, 2), outputs (n, 2), group (n,), and the context of each group.
    """
    rng = np.random.default_rng(seed)
    contexts = np.arange(groups) % len(slopes)
    X = rng.normal(size=(groups * length, 2))
    U = rng.normal(size=(groups * length, 2))
    group = np.repeat(np.arange(groups), length)
    slope = np.asarray(slopes, dtype=float)[contexts[group]]
    answer = slope * (1.0 + 0.3 * np.sin(X[:, 0])) * U[:, 0] + 0.2 * U[:, 1]
    Y = np.column_stack([answer, X[:, 1]]) + noise * rng.normal(size=(len(X), 2))
    return X, U, Y, group, contexts


def agreement(responsibilities, contexts):
    """Share of groups that lie with the majority of their context."""
    found = responsibilities.argmax(axis=1)
    return sum(np.bincount(contexts[found == k]).max() for k in np.unique(found)) / len(contexts)
