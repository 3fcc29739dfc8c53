"""A rigid peg that moves freely in a fixed bore with exact contact, compiled; see `systems.plant.exact_contact`."""

from __future__ import annotations

import math

import numpy as np

from models import Array
from systems.math.compiled import compiled
from systems.plant.exact_contact import MAX_CONTACTS, Bodies, find_contacts, match, solve_contacts, tangents


@compiled
def turn(quaternion: Array, vector: Array) -> None:
    """Turns a quaternion (4,), w first, in place by a rotation vector (3,), rad."""
    angle = math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    half = 0.5 * math.sin(0.5 * angle) / (0.5 * angle) if angle > 1e-9 else 0.5
    w, x, y, z = math.cos(0.5 * angle), half * vector[0], half * vector[1], half * vector[2]
    a, b, c, d = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    quaternion[0] = w * a - x * b - y * c - z * d
    quaternion[1] = w * b + x * a + y * d - z * c
    quaternion[2] = w * c - x * d + y * a + z * b
    quaternion[3] = w * d + x * c - y * b + z * a
    quaternion /= math.sqrt((quaternion**2).sum())


@compiled
def advance_peg(
    bodies: Bodies,
    inertia: Array,
    damping: Array,
    free: Array,
    q: Array,
    v: Array,
    wrench: Array,
    step: float,
    count: int,
) -> tuple[Array, int, Array, Array]:
    """Takes ``count`` time steps.

    Args:
        bodies: `systems.plant.exact_contact.Bodies`.
        inertia: (6,), of rotation about the tip, three times the same, kg m^2, and masses, kg.
        damping: (6,), N m s/rad and N s/m.
        free: (6,), 1 for each freedom, or 0 where it is locked.
        q: (7,), quaternion of R_HP, w first, and centre of the tip in H, m; is changed.
        v: (6,), angular velocity of the peg and velocity of its tip in H, rad/s and m/s; is changed.
        wrench: (6,), applied torque and force at the tip in H, N m and N.
        step: s.
        count: number of steps.

    Returns:
        Torque and force of the contact on the peg at the tip, in H, in the last step, (6,), N m and N; and the
        contacts of the last step: number, points (MAX_CONTACTS, 3) in H, and normal forces (MAX_CONTACTS,).
    """
    gap, point, normal = np.empty(MAX_CONTACTS), np.empty((MAX_CONTACTS, 3)), np.empty((MAX_CONTACTS, 3))
    surface, force, contact, found = np.empty(MAX_CONTACTS, np.int64), np.zeros(MAX_CONTACTS), np.zeros(6), 0
    old_surface, old_impulse = np.full(MAX_CONTACTS, -1), np.zeros((MAX_CONTACTS, 3))
    for _ in range(count):
        a, b, c, d = q[0], q[1], q[2], q[3]
        x_axis = np.array([1.0 - 2.0 * (c * c + d * d), 2.0 * (b * c + a * d), 2.0 * (b * d - a * c)])
        y_axis = np.array([2.0 * (b * c - a * d), 1.0 - 2.0 * (b * b + d * d), 2.0 * (c * d + a * b)])
        found = find_contacts(bodies, q[4:], x_axis, y_axis, gap, point, normal, surface)
        jacobian, impulse = np.zeros((3 * found, 6)), np.zeros(3 * found)
        frame = np.empty((3, 3))
        for i in range(found):
            frame[0] = normal[i]
            frame[1:] = tangents(normal[i, 0], normal[i, 1], normal[i, 2])
            x, y, z = point[i, 0] - q[4], point[i, 1] - q[5], point[i, 2] - q[6]
            for j in range(3):
                f, row = frame[j], jacobian[3 * i + j]
                row[0], row[1], row[2] = y * f[2] - z * f[1], z * f[0] - x * f[2], x * f[1] - y * f[0]
                row[3:] = f
        match(surface[:found], old_surface, old_impulse, impulse)
        mass = inertia + step * damping
        velocity, _ = solve_contacts(
            bodies, step, free / mass, free * (inertia * v + step * wrench) / mass, jacobian, gap[:found], impulse
        )
        v[:] = velocity
        turn(q[:4], step * v[:3])
        q[4:] += step * v[3:]
        contact[:] = 0.0
        old_surface[:] = -1
        for i in range(3 * found):
            contact += jacobian[i] * impulse[i] / step
            old_impulse[i // 3, i % 3] = impulse[i]
        for i in range(found):
            force[i], old_surface[i] = impulse[3 * i] / step, surface[i]
    return contact, found, point, force
