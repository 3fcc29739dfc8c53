"""Impulses of the contacts of a rigid peg in a rigid hole in a step, compiled.

The contacts are those of `models.exact_geometry`. Each one carries the normal force of Hunt and Crossley (J. Appl.
Mech. 42, 1975) at the end of the step,

    f_n = k max(0, -g) max(0, 1 - d u_n),    g = g_0 + h u_n,

with the gap g_0 at the start of the step, the speed of separation u_n at its end, the stiffness k, the dissipation d
and the step h. Its friction obeys Coulomb's law: the sliding velocity is zero, or friction opposes it with mu f_n. A
contact that sticks does not creep. A step is implicit Euler: for velocities v, with the matrix A of masses, and of the
dampers and springs that are treated implicitly,

    A v = A v_free + sum_i J_i^T p_i.

The impulses p_i = h f_i are found by block Gauss-Seidel iterations over the contacts (Jourdan et al., Comput. Methods
Appl. Mech. Eng. 155, 1998) and Newton's method on all of them (Alart and Curnier, Comput. Methods Appl. Mech. Eng. 92,
1991). Nothing here uses Drake.
"""

from __future__ import annotations

import math

import numpy as np

from compiled import compiled
from models import Array
from models.contact_bodies import ContactLaw, Numbers
from models.exact_geometry import SURFACE, TINY

STEPS = 8
"""Steps in a contact time step of a scenario."""

SWEEPS = 3
"""Number of Gauss-Seidel iterations in the first round; each later round has twice as many."""

NEWTON_STEPS = 12

ROUNDS = 9
"""Maximum number of rounds, each of Gauss-Seidel iterations that give Newton's method a first guess."""

TOLERANCE = 1e-7
"""Largest violation of the laws of contact, relative to the largest impulse."""

SOFTENING = 1e-8
"""Relative increase of a contact's own mobility, so that more contacts than freedoms stick in a unique way. A contact
that sticks under 10 N creeps at about 0.1 nm/s."""


@compiled
def normal_impulse(law: ContactLaw, step: float, gap: float, free: float, mobility: float) -> float:
    """Returns the normal impulse (N s) of a contact whose speed of separation is ``free`` + ``mobility`` * impulse.

    With the law of the module, the speed is the smaller root of a quadratic equation.
    """
    if gap + step * free >= 0.0 or law.dissipation * free >= 1.0:
        return 0.0
    rate = step * law.stiffness * mobility
    a = rate * step * law.dissipation
    b = rate * (gap * law.dissipation - step) - 1.0
    c = free - rate * gap
    speed = 2.0 * c / (math.sqrt(b * b - 4.0 * a * c) - b)
    return (speed - free) / mobility


@compiled
def friction_impulse(
    limit: float, u_x: float, u_y: float, m_xx: float, m_xy: float, m_yy: float
) -> tuple[float, float]:
    """Returns the impulse (2,) of friction (N s): it stops sliding, or has the size ``limit`` and opposes sliding.

    Args:
        limit: largest impulse, N s.
        u_x: sliding velocity without this impulse, m/s.
        u_y: its other component.
        m_xx: change of the sliding velocity with the impulse, m/s/(N s), a symmetric matrix.
        m_xy: likewise.
        m_yy: likewise.
    """
    # In the frame of the principal axes of the mobility.
    mean, difference = 0.5 * (m_xx + m_yy), 0.5 * (m_xx - m_yy)
    radius = math.hypot(difference, m_xy)
    along = 0.5 * (1.0 + difference / radius) if radius > 0.0 else 1.0
    c, s = math.sqrt(along), math.copysign(math.sqrt(1.0 - along), m_xy)
    large, small = mean + radius, max(mean - radius, 1e-9 * (mean + radius))
    first, second = c * u_x + s * u_y, c * u_y - s * u_x
    # Friction p opposes the velocity: (mobility + lag) p = -free, with the smallest lag >= 0 that keeps p in the limit.
    lag = 0.0
    x, y = -first / large, -second / small
    if limit <= 0.0:
        return 0.0, 0.0
    for _ in range(30):
        size = math.hypot(x, y)
        if size <= limit * (1.0 + 1e-12):
            break
        slope = (x * x / (large + lag) + y * y / (small + lag)) / size
        lag += (size / limit - 1.0) * size / slope
        x, y = -first / (large + lag), -second / (small + lag)
    return c * x - s * y, s * x + c * y


@compiled
def gauss_seidel(
    law: ContactLaw, step: float, mobility: Array, free: Array, gap: Array, impulse: Array, sweeps: int
) -> None:
    """Solves one contact after the other, ``sweeps`` times; see `solve_contacts`."""
    n = len(impulse)
    for _ in range(sweeps):
        for i in range(0, n, 3):
            u = free[i]
            for k in range(n):
                if k != i:
                    u += mobility[i, k] * impulse[k]
            impulse[i] = normal_impulse(law, step, gap[i // 3], u, mobility[i, i])
            x, y = free[i + 1], free[i + 2]
            for k in range(n):
                if k != i + 1 and k != i + 2:
                    x += mobility[i + 1, k] * impulse[k]
                    y += mobility[i + 2, k] * impulse[k]
            m_xx, m_xy, m_yy = mobility[i + 1, i + 1], mobility[i + 1, i + 2], mobility[i + 2, i + 2]
            impulse[i + 1], impulse[i + 2] = friction_impulse(law.friction * impulse[i], x, y, m_xx, m_xy, m_yy)


@compiled
def residual(
    law: ContactLaw,
    step: float,
    mobility: Array,
    free: Array,
    gap: Array,
    impulse: Array,
    error: Array,
    slope: Array,
) -> float:
    """Computes by how much impulses violate the laws of the module, in N s (Alart and Curnier, 1991); see `newton`.

    Args:
        law: `ContactLaw`.
        step: h, s.
        mobility: (3m, 3m), see `solve_contacts`.
        free: (3m,), see `solve_contacts`.
        gap: (m,), m.
        impulse: (3m,), N s.
        error: (3m,), receives the violations.
        slope: (3m, 3m), receives their derivatives by the impulses.

    Returns:
        The largest violation.
    """
    n, mu = len(impulse), law.friction
    largest = 0.0
    for i in range(n):
        error[i] = free[i]
        for k in range(n):
            error[i] += mobility[i, k] * impulse[k]  # the velocities, for now
    for i in range(0, n, 3):
        overlap, damping = -gap[i // 3] - step * error[i], 1.0 - law.dissipation * error[i]
        expected, change = 0.0, 0.0
        if overlap > 0.0 and damping > 0.0:
            expected = step * law.stiffness * overlap * damping
            change = -step * law.stiffness * (step * damping + law.dissipation * overlap)
        error[i] = impulse[i] - expected
        for k in range(n):
            slope[i, k] = -change * mobility[i, k]
        slope[i, i] += 1.0
        weight = 2.0 / (mobility[i + 1, i + 1] + mobility[i + 2, i + 2])
        x, y = impulse[i + 1] - weight * error[i + 1], impulse[i + 2] - weight * error[i + 2]
        size, limit = math.hypot(x, y), mu * max(impulse[i], 0.0)
        if size <= limit and limit > 0.0:
            for j in range(i + 1, i + 3):
                error[j] *= weight
                for k in range(n):
                    slope[j, k] = weight * mobility[j, k]
            continue
        x, y = x / max(size, TINY), y / max(size, TINY)
        part = limit / max(size, TINY)
        error[i + 1], error[i + 2] = impulse[i + 1] - limit * x, impulse[i + 2] - limit * y
        for k in range(n):
            first, second = -weight * mobility[i + 1, k], -weight * mobility[i + 2, k]
            if k == i + 1:
                first += 1.0
            if k == i + 2:
                second += 1.0
            along = x * first + y * second
            slope[i + 1, k] = -part * (first - along * x)
            slope[i + 2, k] = -part * (second - along * y)
        slope[i + 1, i + 1] += 1.0
        slope[i + 2, i + 2] += 1.0
        if impulse[i] > 0.0:
            slope[i + 1, i] -= mu * x
            slope[i + 2, i] -= mu * y
    for i in range(n):
        largest = max(largest, abs(error[i]))
    return largest


@compiled
def eliminate(matrix: Array, vector: Array) -> None:
    """Solves a system of linear equations in place by elimination with pivots: ``vector`` receives the solution."""
    n = len(vector)
    for i in range(n):
        best = i
        for k in range(i + 1, n):
            if abs(matrix[k, i]) > abs(matrix[best, i]):
                best = k
        if best != i:
            for j in range(i, n):
                matrix[i, j], matrix[best, j] = matrix[best, j], matrix[i, j]
            vector[i], vector[best] = vector[best], vector[i]
        for k in range(i + 1, n):
            ratio = matrix[k, i] / matrix[i, i]
            if ratio != 0.0:
                for j in range(i + 1, n):
                    matrix[k, j] -= ratio * matrix[i, j]
                vector[k] -= ratio * vector[i]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            vector[i] -= matrix[i, j] * vector[j]
        vector[i] /= matrix[i, i]


@compiled
def newton(law: ContactLaw, step: float, mobility: Array, free: Array, gap: Array, impulse: Array) -> bool:
    """Solves all contacts together from a first guess by Newton's method; returns whether it converged."""
    n = len(impulse)
    error, slope, trial = np.empty(n), np.empty((n, n)), np.empty(n)
    worst = residual(law, step, mobility, free, gap, impulse, error, slope)
    for _ in range(NEWTON_STEPS):
        largest = 0.0
        for i in range(0, n, 3):
            largest = max(largest, impulse[i])
        if worst <= TOLERANCE * largest:
            return True
        change = error.copy()
        eliminate(slope, change)
        part, better = 1.0, False
        while part > 0.05:
            for i in range(n):
                trial[i] = impulse[i] - part * change[i]
            now = residual(law, step, mobility, free, gap, trial, error, slope)
            if now < worst:
                better = True
                break
            part *= 0.5
        if not better:
            return False
        worst = now
        impulse[:] = trial
    return False


@compiled
def solve_contacts(
    law: ContactLaw, step: float, inverse: Array, free: Array, jacobian: Array, gap: Array, impulse: Array
) -> tuple[Array, int]:
    """Returns the velocities (n,) at the end of a step, and the number of rounds.

    Args:
        law: `ContactLaw`.
        step: h, s.
        inverse: (n,), diagonal of the inverse of A; 0 for a freedom that is locked.
        free: (n,), velocities without contact.
        jacobian: (3m, n), of the velocities of the peg relative to the bore along normal and tangents of each contact.
        gap: (m,), at the start of the step, m.
        impulse: (3m,), first guess; receives the impulses along normal and tangents of each contact, N s.
    """
    m, n = len(impulse), len(free)
    mobility, without = np.empty((m, m)), np.zeros(m)
    for i in range(m):
        for k in range(n):
            without[i] += jacobian[i, k] * free[k]
        for j in range(i, m):
            value = 0.0
            for k in range(n):
                value += jacobian[i, k] * inverse[k] * jacobian[j, k]
            mobility[i, j] = mobility[j, i] = value
    for i in range(m):
        mobility[i, i] = mobility[i, i] * (1.0 + SOFTENING) + TINY
    rounds, guess = 0, impulse.copy()
    while m > 0 and rounds < ROUNDS:
        gauss_seidel(law, step, mobility, without, gap, guess, SWEEPS << rounds)
        rounds += 1
        impulse[:] = guess
        if newton(law, step, mobility, without, gap, impulse):
            break
        impulse[:] = guess
    velocity = free.copy()
    for k in range(n):
        for i in range(m):
            velocity[k] += inverse[k] * jacobian[i, k] * impulse[i]
    return velocity, rounds


@compiled
def match(contacts: Array, old_surface: Numbers, old_impulse: Array, impulse: Array) -> None:
    """Copies the impulses of the last step's contacts, by their surfaces, into the first guess of this step's."""
    for i in range(len(impulse) // 3):
        for k in range(len(old_surface)):
            if old_surface[k] == contacts[i, SURFACE]:
                for j in range(3):
                    impulse[3 * i + j] = old_impulse[k, j]
                old_surface[k] = -1
                break


@compiled
def set_frame(n_x: float, n_y: float, n_z: float, frame: Array) -> None:
    """Sets three unit vectors (3, 3): the first is given, the second as near to z as it can be, or to x."""
    frame[0, 0], frame[0, 1], frame[0, 2] = n_x, n_y, n_z
    if abs(n_z) < 0.9:
        across = math.hypot(n_x, n_y)
        frame[1, 0], frame[1, 1], frame[1, 2] = -n_z * n_x / across, -n_z * n_y / across, across
    else:
        across = math.hypot(n_y, n_z)
        frame[1, 0], frame[1, 1], frame[1, 2] = across, -n_x * n_y / across, -n_x * n_z / across
    frame[2, 0] = n_y * frame[1, 2] - n_z * frame[1, 1]
    frame[2, 1] = n_z * frame[1, 0] - n_x * frame[1, 2]
    frame[2, 2] = n_x * frame[1, 1] - n_y * frame[1, 0]
