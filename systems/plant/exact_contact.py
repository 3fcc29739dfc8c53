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

from compiled import compiled
from models import Array
from models.contact_bodies import ContactLaw, Numbers
from models.exact_geometry import GAP, MAX_CONTACTS, SURFACE, TINY

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

MAX_IMPULSES = 3 * MAX_CONTACTS

WORK = 3, MAX_IMPULSES, MAX_IMPULSES
"""Shape of the array in which contacts are solved: two matrices, and rows of a third."""

MOBILITY, SLOPE, ROWS = range(3)
FREE, IMPULSE, GUESS, TRIAL, ERROR, CHANGE, COSINE, SINE, LARGE, SMALL = range(10)
"""Places in this array: change of the velocities (m/s) by the impulses (N s), derivatives of the violations, and rows;
these are the velocities without contact, the impulses, what the solvers try, m/s or N s, and `principal_axes`."""


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
def principal_axes(m_xx: float, m_xy: float, m_yy: float) -> tuple[float, float, float, float]:
    """Returns the first principal axis of the sliding mobility of a contact, and its two principal values, m/s/(N s).

    Args:
        m_xx: change of the sliding velocity with the impulse, m/s/(N s), a symmetric matrix.
        m_xy: likewise.
        m_yy: likewise.
    """
    mean, difference = 0.5 * (m_xx + m_yy), 0.5 * (m_xx - m_yy)
    radius = math.hypot(difference, m_xy)
    along = 0.5 * (1.0 + difference / radius) if radius > 0.0 else 1.0
    return (
        math.sqrt(along),
        math.copysign(math.sqrt(1.0 - along), m_xy),
        mean + radius,
        max(mean - radius, 1e-9 * (mean + radius)),
    )


@compiled
def friction_impulse(
    limit: float, u_x: float, u_y: float, c: float, s: float, large: float, small: float
) -> tuple[float, float]:
    """Returns the impulse (2,) of friction (N s): it stops sliding, or has the size ``limit`` and opposes sliding.

    Args:
        limit: largest impulse, N s.
        u_x: sliding velocity without this impulse, m/s.
        u_y: its other component.
        c: of the mobility, see `principal_axes`, as the next three.
        s: second component of the axis.
        large: value along the axis.
        small: value across the axis.
    """
    if limit <= 0.0:
        return 0.0, 0.0
    first, second = c * u_x + s * u_y, c * u_y - s * u_x
    # Friction p opposes the velocity: (mobility + lag) p = -free, with the smallest lag >= 0 that keeps p in the limit.
    lag = 0.0
    x, y = -first / large, -second / small
    for _ in range(30):
        size = math.hypot(x, y)
        if size <= limit * (1.0 + 1e-12):
            break
        slope = (x * x / (large + lag) + y * y / (small + lag)) / size
        lag += (size / limit - 1.0) * size / slope
        x, y = -first / (large + lag), -second / (small + lag)
    return c * x - s * y, s * x + c * y


@compiled
def gauss_seidel(law: ContactLaw, step: float, contacts: Array, m: int, work: Array, sweeps: int) -> None:
    """Solves one contact after the other, ``sweeps`` times; see `solve_contacts`."""
    for _ in range(sweeps):
        for i in range(0, m, 3):
            u = work[ROWS, FREE, i]
            for k in range(m):
                if k != i:
                    u += work[MOBILITY, i, k] * work[ROWS, GUESS, k]
            normal = normal_impulse(law, step, contacts[i // 3, GAP], u, work[MOBILITY, i, i])
            work[ROWS, GUESS, i] = normal
            x, y = work[ROWS, FREE, i + 1], work[ROWS, FREE, i + 2]
            for k in range(m):
                if k != i + 1 and k != i + 2:
                    x += work[MOBILITY, i + 1, k] * work[ROWS, GUESS, k]
                    y += work[MOBILITY, i + 2, k] * work[ROWS, GUESS, k]
            c, s = work[ROWS, COSINE, i], work[ROWS, SINE, i]
            x, y = friction_impulse(law.friction * normal, x, y, c, s, work[ROWS, LARGE, i], work[ROWS, SMALL, i])
            work[ROWS, GUESS, i + 1], work[ROWS, GUESS, i + 2] = x, y


@compiled
def residual(law: ContactLaw, step: float, contacts: Array, m: int, work: Array, row: int) -> float:
    """Computes by how much impulses violate the laws of the module, in N s (Alart and Curnier, 1991); see `newton`.

    Args:
        law: `ContactLaw`.
        step: h, s.
        contacts: see `solve_contacts`.
        m: number of the impulses.
        work: `WORK`; ``ERROR`` receives the violations, ``SLOPE`` their derivatives by the impulses.
        row: of the impulses, `IMPULSE` or `TRIAL`.

    Returns:
        The largest violation.
    """
    mu, largest = law.friction, 0.0
    for i in range(m):
        work[ROWS, ERROR, i] = work[ROWS, FREE, i]
        for k in range(m):
            work[ROWS, ERROR, i] += work[MOBILITY, i, k] * work[ROWS, row, k]  # the velocities, for now
    for i in range(0, m, 3):
        speed, normal = work[ROWS, ERROR, i], work[ROWS, row, i]
        overlap, damping = -contacts[i // 3, GAP] - step * speed, 1.0 - law.dissipation * speed
        expected, change = 0.0, 0.0
        if overlap > 0.0 and damping > 0.0:
            expected = step * law.stiffness * overlap * damping
            change = -step * law.stiffness * (step * damping + law.dissipation * overlap)
        work[ROWS, ERROR, i] = normal - expected
        for k in range(m):
            work[SLOPE, i, k] = -change * work[MOBILITY, i, k]
        work[SLOPE, i, i] += 1.0
        weight = 2.0 / (work[MOBILITY, i + 1, i + 1] + work[MOBILITY, i + 2, i + 2])
        x = work[ROWS, row, i + 1] - weight * work[ROWS, ERROR, i + 1]
        y = work[ROWS, row, i + 2] - weight * work[ROWS, ERROR, i + 2]
        size, limit = math.hypot(x, y), mu * max(normal, 0.0)
        if size <= limit and limit > 0.0:
            for j in range(i + 1, i + 3):
                work[ROWS, ERROR, j] *= weight
                for k in range(m):
                    work[SLOPE, j, k] = weight * work[MOBILITY, j, k]
            continue
        x, y = x / max(size, TINY), y / max(size, TINY)
        part = limit / max(size, TINY)
        work[ROWS, ERROR, i + 1] = work[ROWS, row, i + 1] - limit * x
        work[ROWS, ERROR, i + 2] = work[ROWS, row, i + 2] - limit * y
        for k in range(m):
            first, second = -weight * work[MOBILITY, i + 1, k], -weight * work[MOBILITY, i + 2, k]
            if k == i + 1:
                first += 1.0
            if k == i + 2:
                second += 1.0
            along = x * first + y * second
            work[SLOPE, i + 1, k] = -part * (first - along * x)
            work[SLOPE, i + 2, k] = -part * (second - along * y)
        work[SLOPE, i + 1, i + 1] += 1.0
        work[SLOPE, i + 2, i + 2] += 1.0
        if normal > 0.0:
            work[SLOPE, i + 1, i] -= mu * x
            work[SLOPE, i + 2, i] -= mu * y
    for i in range(m):
        largest = max(largest, abs(work[ROWS, ERROR, i]))
    return largest


@compiled
def eliminate(m: int, work: Array) -> None:
    """Solves ``SLOPE`` times ``CHANGE`` equal to ``ERROR`` of `WORK` by elimination with pivots; changes the slope."""
    for i in range(m):
        work[ROWS, CHANGE, i] = work[ROWS, ERROR, i]
    for i in range(m):
        best = i
        for k in range(i + 1, m):
            if abs(work[SLOPE, k, i]) > abs(work[SLOPE, best, i]):
                best = k
        if best != i:
            for j in range(i, m):
                work[SLOPE, i, j], work[SLOPE, best, j] = work[SLOPE, best, j], work[SLOPE, i, j]
            work[ROWS, CHANGE, i], work[ROWS, CHANGE, best] = work[ROWS, CHANGE, best], work[ROWS, CHANGE, i]
        for k in range(i + 1, m):
            ratio = work[SLOPE, k, i] / work[SLOPE, i, i]
            if ratio != 0.0:
                for j in range(i + 1, m):
                    work[SLOPE, k, j] -= ratio * work[SLOPE, i, j]
                work[ROWS, CHANGE, k] -= ratio * work[ROWS, CHANGE, i]
    for i in range(m - 1, -1, -1):
        for j in range(i + 1, m):
            work[ROWS, CHANGE, i] -= work[SLOPE, i, j] * work[ROWS, CHANGE, j]
        work[ROWS, CHANGE, i] /= work[SLOPE, i, i]


@compiled
def newton(law: ContactLaw, step: float, contacts: Array, m: int, work: Array) -> bool:
    """Solves all contacts together from a first guess by Newton's method; returns whether it converged."""
    worst = residual(law, step, contacts, m, work, IMPULSE)
    for _ in range(NEWTON_STEPS):
        largest = 0.0
        for i in range(0, m, 3):
            largest = max(largest, work[ROWS, IMPULSE, i])
        if worst <= TOLERANCE * largest:
            return True
        eliminate(m, work)
        part, better = 1.0, False
        while part > 0.05:
            for i in range(m):
                work[ROWS, TRIAL, i] = work[ROWS, IMPULSE, i] - part * work[ROWS, CHANGE, i]
            now = residual(law, step, contacts, m, work, TRIAL)
            if now < worst:
                better = True
                break
            part *= 0.5
        if not better:
            return False
        worst = now
        for i in range(m):
            work[ROWS, IMPULSE, i] = work[ROWS, TRIAL, i]
    return False


@compiled
def solve_contacts(
    law: ContactLaw,
    step: float,
    inverse: Array,
    free: Array,
    jacobian: Array,
    contacts: Array,
    m: int,
    work: Array,
    velocity: Array,
) -> int:
    """Finds the impulses of the contacts of a step, and the velocities at its end.

    Args:
        law: `ContactLaw`.
        step: h, s.
        inverse: (n,), diagonal of the inverse of A; 0 for a freedom that is locked.
        free: (n,), velocities without contact.
        jacobian: (m or more, n), of the velocities of the peg relative to the bore along normal and tangents of each
            contact.
        contacts: of `models.exact_geometry.find_contacts`, with their gaps at the start of the step.
        m: number of the impulses, three for each contact.
        work: `WORK`; ``IMPULSE`` holds a first guess, and receives the impulses along normal and tangents, N s.
        velocity: (n,), receives the velocities at the end.

    Returns:
        The number of rounds.
    """
    n = len(free)
    for i in range(m):
        without = 0.0
        for k in range(n):
            without += jacobian[i, k] * free[k]
        work[ROWS, FREE, i] = without
        for j in range(i, m):
            value = 0.0
            for k in range(n):
                value += jacobian[i, k] * inverse[k] * jacobian[j, k]
            work[MOBILITY, i, j] = work[MOBILITY, j, i] = value
    for i in range(m):
        work[MOBILITY, i, i] = work[MOBILITY, i, i] * (1.0 + SOFTENING) + TINY
        work[ROWS, GUESS, i] = work[ROWS, IMPULSE, i]
    for i in range(0, m, 3):
        m_xx, m_xy, m_yy = work[MOBILITY, i + 1, i + 1], work[MOBILITY, i + 1, i + 2], work[MOBILITY, i + 2, i + 2]
        c, s, large, small = principal_axes(m_xx, m_xy, m_yy)
        work[ROWS, COSINE, i], work[ROWS, SINE, i], work[ROWS, LARGE, i], work[ROWS, SMALL, i] = c, s, large, small
    rounds = 0
    while m > 0 and rounds < ROUNDS:
        gauss_seidel(law, step, contacts, m, work, SWEEPS << rounds)
        rounds += 1
        for i in range(m):
            work[ROWS, IMPULSE, i] = work[ROWS, GUESS, i]
        if newton(law, step, contacts, m, work):
            break
        for i in range(m):
            work[ROWS, IMPULSE, i] = work[ROWS, GUESS, i]
    for k in range(n):
        velocity[k] = free[k]
        for i in range(m):
            velocity[k] += inverse[k] * jacobian[i, k] * work[ROWS, IMPULSE, i]
    return rounds


@compiled
def match(contacts: Array, count: int, old_surface: Numbers, old_impulse: Array, work: Array) -> None:
    """Sets the first guess of the impulses: those of the last step's contacts on the same surfaces, or zero."""
    for i in range(count):
        for j in range(3):
            work[ROWS, IMPULSE, 3 * i + j] = 0.0
        for k in range(len(old_surface)):
            if old_surface[k] == contacts[i, SURFACE]:
                for j in range(3):
                    work[ROWS, IMPULSE, 3 * i + j] = old_impulse[k, j]
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
