"""Small systems of linear equations with a positive definite matrix, in compiled code."""

from __future__ import annotations

import math

import numpy as np

from compiled import compiled
from skill.arrays import Array


@compiled
def solve_positive(matrix: Array, right: Array) -> bool:
    """Solves systems in place by Cholesky's method; returns whether the matrix is positive definite.

    Args:
        matrix: (d, d), symmetric; its lower triangle receives the factor.
        right: (d, m), the right sides; receives the solutions.
    """
    d, m = right.shape
    for i in range(d):
        for j in range(i + 1):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            if j < i:
                matrix[i, j] = value / matrix[j, j]
            elif value > 0.0:
                matrix[i, i] = math.sqrt(value)
            else:
                return False
    for c in range(m):
        for i in range(d):
            for k in range(i):
                right[i, c] -= matrix[i, k] * right[k, c]
            right[i, c] /= matrix[i, i]
        for i in range(d - 1, -1, -1):
            for k in range(i + 1, d):
                right[i, c] -= matrix[k, i] * right[k, c]
            right[i, c] /= matrix[i, i]
    return True


@compiled
def solve_least_norm(matrix: Array, right: Array) -> Array:
    """Returns the solution (d,) of least norm; directions without variance beyond rounding have no part in it.

    Args:
        matrix: (d, d), symmetric and not negative.
        right: (d,).
    """
    d = len(right)
    values, vectors = np.linalg.eigh(matrix)
    smallest = 10.0 * d * np.finfo(np.float64).eps * np.abs(values).max()
    found = np.zeros(d)
    for k in range(d):
        if abs(values[k]) > smallest:
            part = 0.0
            for i in range(d):
                part += vectors[i, k] * right[i]
            for i in range(d):
                found[i] += part / values[k] * vectors[i, k]
    return found
