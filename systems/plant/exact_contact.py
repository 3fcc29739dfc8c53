"""Contact of a rigid peg in a rigid bore in closed form, compiled: the single contacts and their impulses in a step.

The contacts are the local minima of the gap on the circles of `models.contact_geometry`, whose formulas are compiled
here. Each contact carries the normal force of Hunt and Crossley (J. Appl. Mech. 42, 1975) at the end of the step,

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
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from models import Array, contact_geometry
from models.contact_geometry import TINY
from models.scenario import Scenario
from skill.compiled import compiled, inlined

Numbers = NDArray[np.int64]

STEPS = 8
"""Steps in a contact time step of a scenario."""

MAX_CONTACTS = 16

REACH = 2e-5
"""Largest gap of a contact that is given to the solver, m; in a step of 0.25 ms bodies close it at 80 mm/s."""

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

SAMPLES = 48
"""Number of samples on each circle; between two of them the slope of the gap changes its sign once."""

SPACING = 2.0 * np.pi / SAMPLES
COS, SIN = np.cos(SPACING * np.arange(SAMPLES)), np.sin(SPACING * np.arange(SAMPLES))

DIP = 2.0 * REACH
"""Largest gap at the nearer sample of a contact, m."""

MAX_SEARCH = 60
FLAT, NARROW, SHALLOW = 1e-10, 2e-3, 1e-14
"""The search for a minimum ends after so many gaps, where the slope (m/rad) is zero, or, between angles (rad) that are
near to each other, at the lower bound (m) that their tangents give."""

CROSSING = 1e-4
"""Largest distance between the minima on the rim and on an edge where these cross, m."""

RIM, FLOOR, OUTER, INNER = 0, 3, 4, 5
"""Circles, by the number of their first `models.contact_geometry.Surface`."""

rim_gap = inlined(contact_geometry.rim_gap)
edge_gap = inlined(contact_geometry.edge_gap)


class Bodies(NamedTuple):
    """Sizes of peg and bore (m) and the law of their contact.

    Attributes:
        r: radius of the peg.
        R: radius of the bore.
        depth: of the bore.
        chamfer: width and height of the chamfer.
        friction: coefficient mu.
        stiffness: k of a contact, N/m.
        dissipation: d, s/m.
    """

    r: float
    R: float
    depth: float
    chamfer: float
    friction: float
    stiffness: float
    dissipation: float

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """Returns the bodies of a scenario."""
        g, contact = scenario.geometry, scenario.contact
        return cls(
            g.peg_radius,
            g.hole_radius,
            g.hole_depth,
            g.chamfer,
            contact.friction,
            contact.stiffness,
            contact.dissipation,
        )


@compiled
def on_circle(bodies: Bodies, circle: int, angle: float, p: Array, u: Array, v: Array) -> tuple[Any, ...]:
    """Returns gap, its slope over the angle (m/rad), point on the bore (3), normal (3) and surface; all in H."""
    cosine, sine = math.cos(angle), math.sin(angle)
    if circle == RIM:
        x = p[0] + bodies.r * (cosine * u[0] + sine * v[0])
        y = p[1] + bodies.r * (cosine * u[1] + sine * v[1])
        z = p[2] + bodies.r * (cosine * u[2] + sine * v[2])
        gap, n_x, n_y, n_z, surface = rim_gap(bodies.R, bodies.chamfer, x, y, z)
        along_u, along_v = n_x * u[0] + n_y * u[1] + n_z * u[2], n_x * v[0] + n_y * v[1] + n_z * v[2]
        slope = bodies.r * (cosine * along_v - sine * along_u)
        return gap, slope, x - gap * n_x, y - gap * n_y, z - gap * n_z, n_x, n_y, n_z, surface
    radius, z = edge_of(bodies, circle)
    x, y = radius * cosine, radius * sine
    # The axis of the peg is u x v.
    a_x, a_y, a_z = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    gap, n_x, n_y, n_z, _ = edge_gap(bodies.r, x - p[0], y - p[1], z - p[2], a_x, a_y, a_z)
    return gap, radius * (sine * n_x - cosine * n_y), x, y, z, n_x, n_y, n_z, circle


@compiled
def edge_of(bodies: Bodies, circle: int) -> tuple[float, float]:
    """Returns radius and height of an edge of the bore, m."""
    return (bodies.R + bodies.chamfer, 0.0) if circle == OUTER else (bodies.R, -bodies.chamfer)


@compiled
def rim_samples(
    R: float,
    chamfer: float,
    r: float,
    p_x: float,
    p_y: float,
    p_z: float,
    u_x: float,
    u_y: float,
    u_z: float,
    v_x: float,
    v_y: float,
    v_z: float,
    gaps: Array,
    slopes: Array,
) -> None:
    """Computes the gaps of the rim, and their slopes over the angle, at all samples."""
    for k in range(SAMPLES):
        c, s = r * COS[k], r * SIN[k]
        x, y, z = p_x + c * u_x + s * v_x, p_y + c * u_y + s * v_y, p_z + c * u_z + s * v_z
        gap, n_x, n_y, n_z, _ = rim_gap(R, chamfer, x, y, z)
        gaps[k] = gap
        slopes[k] = c * (n_x * v_x + n_y * v_y + n_z * v_z) - s * (n_x * u_x + n_y * u_y + n_z * u_z)


@compiled
def edge_samples(
    radius: float,
    height: float,
    r: float,
    p_x: float,
    p_y: float,
    p_z: float,
    a_x: float,
    a_y: float,
    a_z: float,
    gaps: Array,
    slopes: Array,
) -> None:
    """Computes the gaps of an edge of the bore, and their slopes over the angle, at all samples."""
    for k in range(SAMPLES):
        c, s = radius * COS[k], radius * SIN[k]
        gap, n_x, n_y, _, _ = edge_gap(r, c - p_x, s - p_y, height - p_z, a_x, a_y, a_z)
        gaps[k], slopes[k] = gap, s * n_x - c * n_y


@compiled
def lowest_angle(
    bodies: Bodies,
    circle: int,
    low: float,
    high: float,
    g_low: float,
    g_high: float,
    falling: float,
    rising: float,
    p: Array,
    u: Array,
    v: Array,
) -> float:
    """Returns where the gap has a minimum between two angles.

    It is sought where a line through the slopes is zero, as it is on a smooth stretch, and where the tangents meet, as
    at a corner of the bore, where the slope jumps.

    Args:
        bodies: `Bodies`.
        circle: on which the minimum is.
        low: angle, rad.
        high: a larger angle, rad.
        g_low: gap at the first angle, m.
        g_high: gap at the second angle, m.
        falling: slope at the first angle, at most 0, m/rad.
        rising: slope at the second angle, above 0, m/rad.
        p: see `find_contacts`.
        u: likewise.
        v: likewise.
    """
    angle = low
    for k in range(MAX_SEARCH):
        share, width = falling / (falling - rising), high - low
        meet = (g_high - g_low - rising * width) / ((falling - rising) * width)
        if k % 3 > 0:
            share = meet if k % 3 == 1 and 0.0 < meet < 1.0 else 0.5
        angle = low + share * width
        g, slope = on_circle(bodies, circle, angle, p, u, v)[:2]
        if abs(slope) < FLAT or (width < NARROW and 0.0 < meet < 1.0 and g - g_low - falling * meet * width < SHALLOW):
            break
        if slope > 0.0:
            high, g_high, rising = angle, g, slope
        else:
            low, g_low, falling = angle, g, slope
    return angle


@compiled
def find_minima(
    bodies: Bodies,
    p: Array,
    u: Array,
    v: Array,
    gap: Array,
    point: Array,
    normal: Array,
    surface: Numbers,
    angle: Array,
) -> int:
    """Finds the minima of the gap that are below `REACH`, on the rim and on both edges, and the points on the floor.

    Args:
        bodies: see `find_contacts`, as are those up to ``surface``.
        p: likewise.
        u: likewise.
        v: likewise.
        gap: likewise.
        point: likewise.
        normal: likewise.
        surface: likewise.
        angle: (MAX_CONTACTS,), receives their angles on their circles, rad.

    Returns:
        The number of minima.
    """
    count = 0
    lowest = p[2] - bodies.r * math.hypot(u[2], v[2])
    if lowest > REACH:
        return count
    gaps, slopes = np.empty(SAMPLES), np.empty(SAMPLES)
    a_x, a_y, a_z = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    for circle in (RIM, OUTER, INNER):
        # No gap on the circle is below a bound that takes no samples.
        if circle == RIM:
            if bodies.R - math.hypot(p[0], p[1]) - bodies.r > REACH:
                continue
            rim_samples(
                bodies.R, bodies.chamfer, bodies.r, p[0], p[1], p[2], u[0], u[1], u[2], v[0], v[1], v[2], gaps, slopes
            )
        else:
            radius, height = edge_of(bodies, circle)
            up = (height - p[2]) / a_z
            off = math.hypot(p[0] + up * a_x, p[1] + up * a_y)
            if max(lowest - height, a_z * (radius - off) - bodies.r) > REACH:
                continue
            edge_samples(radius, height, bodies.r, p[0], p[1], p[2], a_x, a_y, a_z, gaps, slopes)
        for k in range(SAMPLES):
            after = (k + 1) % SAMPLES
            falling, rising = slopes[k], slopes[after]
            # Between samples the gap is lower than at them by less than this on a smooth stretch.
            if falling > 0.0 or rising <= 0.0 or min(gaps[k], gaps[after]) > DIP:
                continue
            t = lowest_angle(
                bodies, circle, SPACING * k, SPACING * (k + 1), gaps[k], gaps[after], falling, rising, p, u, v
            )
            g, _, x, y, z, n_x, n_y, n_z, kind = on_circle(bodies, circle, t, p, u, v)
            if g < REACH and count < MAX_CONTACTS - 3:
                gap[count], surface[count], angle[count] = g, kind, t
                point[count, 0], point[count, 1], point[count, 2] = x, y, z
                normal[count, 0], normal[count, 1], normal[count, 2] = n_x, n_y, n_z
                count += 1
    # A flat tip rests on the floor at three points: the lowest one of the rim, and two at 120 degrees from it.
    if lowest + bodies.depth < REACH:
        first = math.atan2(-v[2], -u[2])
        for k in range(3):
            t = first + 2.0 * np.pi * k / 3.0
            for i in range(3):
                point[count, i] = p[i] + bodies.r * (math.cos(t) * u[i] + math.sin(t) * v[i])
                normal[count, i] = 0.0
            g = point[count, 2] + bodies.depth
            if g < REACH:
                gap[count], surface[count], angle[count] = g, FLOOR, t
                point[count, 2], normal[count, 2] = -bodies.depth, 1.0
                count += 1
    return count


@compiled
def crossing(
    circle: int, rim_angle: float, edge_angle: float, u: Array, v: Array, normal: Array
) -> tuple[bool, float, float, float]:
    """Returns whether the rim and an edge can touch where they cross, and the normal of this contact.

    It is perpendicular to both, and lies between the normals of the surfaces that meet at each of them.

    Args:
        circle: of the edge.
        rim_angle: of the place on the rim, rad.
        edge_angle: of the place on the edge, rad.
        u: see `find_contacts`.
        v: likewise.
        normal: (3,), that of the nearest surface, for the sign.
    """
    c, s, c_e, s_e = math.cos(rim_angle), math.sin(rim_angle), math.cos(edge_angle), math.sin(edge_angle)
    t_x, t_y, t_z = c * v[0] - s * u[0], c * v[1] - s * u[1], c * v[2] - s * u[2]  # along the rim
    x, y, z = -t_z * c_e, -t_z * s_e, t_x * c_e + t_y * s_e  # the edge is along (-s_e, c_e, 0)
    size = math.copysign(max(TINY, math.sqrt(x * x + y * y + z * z)), x * normal[0] + y * normal[1] + z * normal[2])
    x, y, z = x / size, y / size, z / size
    inwards = -(x * c_e + y * s_e)
    outwards = x * (c * u[0] + s * v[0]) + y * (c * u[1] + s * v[1]) + z * (c * u[2] + s * v[2])
    along = x * (u[1] * v[2] - u[2] * v[1]) + y * (u[2] * v[0] - u[0] * v[2]) + z * (u[0] * v[1] - u[1] * v[0])
    within = min(inwards, z - inwards) if circle == OUTER else min(z, inwards - z)
    return min(within, along, -outwards) > -1e-9, x, y, z


@compiled
def find_contacts(
    bodies: Bodies, p: Array, u: Array, v: Array, gap: Array, point: Array, normal: Array, surface: Numbers
) -> int:
    """Finds the contacts of a pose whose gap is below `REACH`.

    They are the minima of the gap on the three circles. Where the rim crosses an edge of the bore, there is a minimum
    on both; these become one contact, the normal of which is perpendicular to both circles. While the bodies do not
    overlap, it is that of the minima; where they do, the nearest surface is one of those beside the edge.

    Args:
        bodies: `Bodies`.
        p: (3,), centre of the tip in H, m.
        u: (3,), unit vector across the peg in H.
        v: (3,), another one; u x v is the axis away from the tip.
        gap: (MAX_CONTACTS,), receives the gaps, m.
        point: (MAX_CONTACTS, 3), receives the points on the bore in H, m.
        normal: (MAX_CONTACTS, 3), receives the directions in H in which the bore pushes the peg.
        surface: (MAX_CONTACTS,), receives the surfaces.

    Returns:
        The number of contacts.
    """
    angle = np.empty(MAX_CONTACTS)
    found = find_minima(bodies, p, u, v, gap, point, normal, surface, angle)
    count = 0
    for e in range(found):
        crosses = False
        if surface[e] == OUTER or surface[e] == INNER:
            for i in range(count):
                if surface[i] >= FLOOR:  # no minimum on the rim, or one that crosses another edge
                    continue
                d_x, d_y, d_z = point[i, 0] - point[e, 0], point[i, 1] - point[e, 1], point[i, 2] - point[e, 2]
                if d_x * d_x + d_y * d_y + d_z * d_z > CROSSING**2:
                    continue
                crosses, x, y, z = crossing(surface[e], angle[i], angle[e], u, v, normal[i])
                if crosses:
                    aligned = normal[i, 0] * x + normal[i, 1] * y + normal[i, 2] * z
                    gap[i], surface[i] = d_x * x + d_y * y + d_z * z + gap[i] * aligned, surface[e]
                    point[i] = point[e]
                    normal[i, 0], normal[i, 1], normal[i, 2] = x, y, z
                    break
        if not crosses:
            gap[count], surface[count], angle[count] = gap[e], surface[e], angle[e]
            point[count], normal[count] = point[e], normal[e]
            count += 1
    return count


@compiled
def normal_impulse(bodies: Bodies, step: float, gap: float, free: float, mobility: float) -> float:
    """Returns the normal impulse (N s) of a contact whose speed of separation is ``free`` + ``mobility`` * impulse.

    With the law of the module, the speed is the smaller root of a quadratic equation.
    """
    if gap + step * free >= 0.0 or bodies.dissipation * free >= 1.0:
        return 0.0
    rate = step * bodies.stiffness * mobility
    a = rate * step * bodies.dissipation
    b = rate * (gap * bodies.dissipation - step) - 1.0
    c = free - rate * gap
    speed = 2.0 * c / (math.sqrt(b * b - 4.0 * a * c) - b)
    return (speed - free) / mobility


@compiled
def friction_impulse(limit: float, free: Array, mobility: Array) -> tuple[float, float]:
    """Returns the impulse (2,) of friction (N s): it stops sliding, or has the size ``limit`` and opposes sliding.

    Args:
        limit: largest impulse, N s.
        free: (2,), sliding velocity without this impulse, m/s.
        mobility: (2, 2), change of the sliding velocity with the impulse, m/s/(N s).
    """
    # In the frame of the principal axes of the mobility.
    mean, difference = 0.5 * (mobility[0, 0] + mobility[1, 1]), 0.5 * (mobility[0, 0] - mobility[1, 1])
    radius = math.hypot(difference, mobility[0, 1])
    along = 0.5 * (1.0 + difference / radius) if radius > 0.0 else 1.0
    c, s = math.sqrt(along), math.copysign(math.sqrt(1.0 - along), mobility[0, 1])
    large, small = mean + radius, max(mean - radius, 1e-9 * (mean + radius))
    first, second = c * free[0] + s * free[1], c * free[1] - s * free[0]
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
    bodies: Bodies, step: float, mobility: Array, free: Array, gap: Array, impulse: Array, sweeps: int
) -> None:
    """Solves one contact after the other, ``sweeps`` times; see `solve_contacts`."""
    n, slide = len(impulse), np.empty(2)
    for _ in range(sweeps):
        for i in range(0, n, 3):
            u = free[i]
            for k in range(n):
                if k != i:
                    u += mobility[i, k] * impulse[k]
            impulse[i] = normal_impulse(bodies, step, gap[i // 3], u, mobility[i, i])
            for j in range(2):
                slide[j] = free[i + 1 + j]
                for k in range(n):
                    if k != i + 1 and k != i + 2:
                        slide[j] += mobility[i + 1 + j, k] * impulse[k]
            block = mobility[i + 1 : i + 3, i + 1 : i + 3]
            impulse[i + 1], impulse[i + 2] = friction_impulse(bodies.friction * impulse[i], slide, block)


@compiled
def residual(
    bodies: Bodies,
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
        bodies: `Bodies`.
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
    n, mu = len(impulse), bodies.friction
    largest = 0.0
    for i in range(n):
        error[i] = free[i]
        for k in range(n):
            error[i] += mobility[i, k] * impulse[k]  # the velocities, for now
    for i in range(0, n, 3):
        overlap, damping = -gap[i // 3] - step * error[i], 1.0 - bodies.dissipation * error[i]
        law, change = 0.0, 0.0
        if overlap > 0.0 and damping > 0.0:
            law = step * bodies.stiffness * overlap * damping
            change = -step * bodies.stiffness * (step * damping + bodies.dissipation * overlap)
        error[i] = impulse[i] - law
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
def newton(bodies: Bodies, step: float, mobility: Array, free: Array, gap: Array, impulse: Array) -> bool:
    """Solves all contacts together from a first guess by Newton's method; returns whether it converged."""
    n = len(impulse)
    error, slope, trial = np.empty(n), np.empty((n, n)), np.empty(n)
    worst = residual(bodies, step, mobility, free, gap, impulse, error, slope)
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
            now = residual(bodies, step, mobility, free, gap, trial, error, slope)
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
    bodies: Bodies, step: float, inverse: Array, free: Array, jacobian: Array, gap: Array, impulse: Array
) -> tuple[Array, int]:
    """Returns the velocities (n,) at the end of a step, and the number of rounds.

    Args:
        bodies: `Bodies`.
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
        gauss_seidel(bodies, step, mobility, without, gap, guess, SWEEPS << rounds)
        rounds += 1
        impulse[:] = guess
        if newton(bodies, step, mobility, without, gap, impulse):
            break
        impulse[:] = guess
    velocity = free.copy()
    for k in range(n):
        for i in range(m):
            velocity[k] += inverse[k] * jacobian[i, k] * impulse[i]
    return velocity, rounds


@compiled
def match(surface: Numbers, old_surface: Numbers, old_impulse: Array, impulse: Array) -> None:
    """Copies the impulses of the last step's contacts, by their surfaces, into the first guess of this step's."""
    for i in range(len(surface)):
        for k in range(len(old_surface)):
            if old_surface[k] == surface[i]:
                impulse[3 * i : 3 * i + 3] = old_impulse[k]
                old_surface[k] = -1
                break


@compiled
def tangents(n_x: float, n_y: float, n_z: float) -> Array:
    """Returns two unit vectors (2, 3) across a unit vector; the first one is as near to z as it can be, or to x."""
    t = np.zeros((2, 3))
    if abs(n_z) < 0.9:
        across = math.hypot(n_x, n_y)
        t[0, 0], t[0, 1], t[0, 2] = -n_z * n_x / across, -n_z * n_y / across, across
    else:
        across = math.hypot(n_y, n_z)
        t[0, 0], t[0, 1], t[0, 2] = across, -n_x * n_y / across, -n_x * n_z / across
    t[1, 0] = n_y * t[0, 2] - n_z * t[0, 1]
    t[1, 1] = n_z * t[0, 0] - n_x * t[0, 2]
    t[1, 2] = n_x * t[0, 1] - n_y * t[0, 0]
    return t
