"""Synthetic samples of a smooth function."""

import numpy as np


def wavy(n=400, d=3, noise=0.1, seed=0):
    """Features (n, d), uniform in [-1, 1], and two noisy outputs (n, 2)."""
    rng = np.random.default_rng(seed)
    X = rng.uniform(-1, 1, (n, d))
    Y = np.column_stack([np.sin(3 * X[:, 0]) + X[:, 1] ** 2, X @ np.arange(1.0, d + 1)])
    return X, Y + noise * rng.normal(size=Y.shape)
