"""The exact contact against hand-worked impulses, the exact geometry and conservation of energy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.contact_bodies import DEPTH, Bodies
from models.scenario import Scenario
from systems.plant.exact_contact import (
    IMPULSE,
    ROUNDS,
    ROWS,
    WORK,
    friction_impulse,
    normal_impulse,
    principal_axes,
    set_frame,
    solve_contacts,
)
from systems.plant.exact_peg import advance_peg

BODIES = Bodies.of(Scenario())
LAW, FLOOR_DEPTH = BODIES.law, BODIES.mates[0, DEPTH]
STEP = 2.5e-4
positive = st.floats(1e-3, 1e3)


@given(st.floats(-1e-5, 1e-5), st.floats(-0.05, 0.05), positive)
def test_the_normal_impulse_obeys_the_law_at_the_end_of_the_step(gap, free, mobility):
    p = normal_impulse(LAW, STEP, gap, free, mobility)
    speed = free + mobility * p
    overlap, damping = max(0.0, -gap - STEP * speed), max(0.0, 1.0 - LAW.dissipation * speed)
    assert p >= 0.0
    assert p == pytest.approx(STEP * LAW.stiffness * overlap * damping, rel=1e-6, abs=1e-12)


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), positive, positive, st.floats(-0.99, 0.99), st.floats(1e-6, 10.0))
def test_friction_sticks_or_opposes_sliding_with_its_limit(x, y, first, second, coupling, limit):
    free, off = np.array([x, y]), coupling * np.sqrt(first * second)
    mobility = np.array([[first, off], [off, second]])
    p = np.array(friction_impulse(limit, x, y, *principal_axes(first, off, second)))
    slide, size = free + mobility @ p, np.linalg.norm(p)
    assert size <= limit * (1.0 + 1e-9)
    if size < limit * (1.0 - 1e-6):
        np.testing.assert_allclose(slide, 0.0, atol=1e-6 * (1.0 + np.linalg.norm(free)))
    else:
        assert np.linalg.norm(slide + p / size * np.linalg.norm(slide)) < 1e-4 * (1e-3 + np.linalg.norm(free))


def test_all_contacts_obey_normal_law_and_friction():
    """One to three contacts in random directions between bodies of random masses, with overlaps up to 2 um."""
    solved = 0
    for seed in range(300):
        rng = np.random.default_rng(seed)
        m, inverse = int(rng.integers(1, 4)), 10.0 ** rng.uniform(-1, 2, 6)
        jacobian = rng.normal(size=(3 * m, 6)) * np.array([0.01, 0.01, 0.01, 1.0, 1.0, 1.0])
        gap, free = rng.uniform(-2e-6, 1e-6, m), rng.normal(size=6) * 0.02
        work, contacts, velocity = np.zeros(WORK), gap.reshape(m, 1), np.empty(6)
        rounds = solve_contacts(LAW, STEP, inverse, free, jacobian, contacts, 3 * m, work, velocity)
        impulse = work[ROWS, IMPULSE, : 3 * m]
        np.testing.assert_allclose(velocity, free + inverse * (jacobian.T @ impulse), atol=1e-12)
        if rounds == ROUNDS:
            continue
        solved += 1
        u, p = (jacobian @ velocity).reshape(m, 3), impulse.reshape(m, 3)
        overlap, damping = np.maximum(0, -gap - STEP * u[:, 0]), np.maximum(0, 1 - LAW.dissipation * u[:, 0])
        scale = p[:, 0].max() + 1e-9
        np.testing.assert_allclose(p[:, 0], STEP * LAW.stiffness * overlap * damping, atol=1e-4 * scale)
        size, slide = np.linalg.norm(p[:, 1:], axis=1), np.linalg.norm(u[:, 1:], axis=1)
        assert (size <= LAW.friction * p[:, 0] + 1e-5 * scale).all()
        sticks = size < LAW.friction * p[:, 0] - 1e-4 * scale
        assert (slide[sticks] < 1e-5).all()
        slips = ~sticks & (slide > 1e-4)
        power = (p[slips, 1:] * u[slips, 1:]).sum(axis=1)
        np.testing.assert_allclose(power, -size[slips] * slide[slips], atol=1e-4 * scale * slide.max())
    assert solved > 290


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_tangents_and_normal_are_a_frame(x, y, z):
    n = np.array([x, y, z])
    if np.linalg.norm(n) > 0.1:
        n /= np.linalg.norm(n)
        frame = np.empty((3, 3))
        set_frame(*n, frame)
        np.testing.assert_array_equal(frame[0], n)
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)


def peg_state(z=0.001, tilt=0.0):
    return np.array([np.cos(tilt / 2), 0.0, np.sin(tilt / 2), 0.0, 0.0, 0.0, z]), np.zeros(6)


INERTIA, UNDAMPED, FREE = np.repeat([2e-4, 0.5], 3), np.zeros(6), np.ones(6)


def test_a_peg_without_contact_falls_as_newton_says():
    q, v = peg_state()
    advance_peg(BODIES, INERTIA, UNDAMPED, FREE, q, v, np.array([0, 0, 0, 0, 0, -1.0]), STEP, 40)
    assert v[5] == pytest.approx(-1.0 / 0.5 * 0.01, rel=1e-9)
    assert q[6] == pytest.approx(0.001 - 0.5 * 2.0 * 0.01**2, abs=3e-6)


def test_the_rotation_of_a_free_peg_is_that_of_its_rotation_vector():
    q, v = peg_state()
    v[:3] = 0.3, -0.2, 0.1
    advance_peg(BODIES, INERTIA, UNDAMPED, FREE, q, v, np.zeros(6), STEP, 400)
    turned = np.array([0.03, -0.02, 0.01])
    angle = np.linalg.norm(turned)
    np.testing.assert_allclose(q[:4], [np.cos(angle / 2), *(np.sin(angle / 2) * turned / angle)], atol=1e-12)


def test_a_pressed_peg_rests_on_the_floor_and_sinks_by_load_over_stiffness():
    q, v = peg_state(z=-FLOOR_DEPTH)
    for _ in range(20):
        contact, found, _, force = advance_peg(
            BODIES, INERTIA, UNDAMPED, FREE, q, v, np.array([0, 0, 0, 0, 0, -9.0]), STEP, 40
        )
    assert found >= 3
    np.testing.assert_allclose(contact, [0, 0, 0, 0, 0, 9.0], atol=1e-6)
    np.testing.assert_allclose(force[:3], 3.0, rtol=1e-3)
    assert -FLOOR_DEPTH - q[6] == pytest.approx(3.0 / LAW.stiffness, rel=1e-3)


def test_a_peg_that_sticks_does_not_creep():
    """On the floor under 10 N, with 1.9 N across: mu is 0.2."""
    q, v = peg_state(z=-FLOOR_DEPTH)
    push = np.array([0, 0, 0, 1.9, 0, -10.0])
    advance_peg(BODIES, INERTIA, UNDAMPED, FREE, q, v, np.array([0, 0, 0, 0, 0, -10.0]), STEP, 400)
    start = q[4]
    advance_peg(BODIES, INERTIA, UNDAMPED, FREE, q, v, push, STEP, 4000)
    assert abs(q[4] - start) < 1e-9
    push[3] = 2.1
    advance_peg(BODIES, INERTIA, UNDAMPED, FREE, q, v, push, STEP, 40)
    assert v[3] == pytest.approx((2.1 - 2.0) / 0.5 * 0.01, rel=0.02)


def test_energy_never_grows():
    """A peg thrown about in the bore without load: what an overlap gives back is below 1 % of its energy."""
    elastic = BODIES._replace(law=LAW._replace(dissipation=0.0))
    hits = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        q, v = peg_state(z=rng.uniform(-0.02, 0.0005), tilt=rng.uniform(-0.0015, 0.0015))
        v[:] = rng.normal(size=6) * np.array([0.3, 0.3, 0.3, 0.03, 0.03, 0.05])
        start = least = 0.5 * (INERTIA * v * v).sum()
        for _ in range(200):
            advance_peg(elastic, INERTIA, UNDAMPED, FREE, q, v, np.zeros(6), STEP, 1)
            energy = 0.5 * (INERTIA * v * v).sum()
            assert energy < least + 0.01 * start
            least = min(least, energy)
        hits += least < 0.99 * start
    assert hits > 20
