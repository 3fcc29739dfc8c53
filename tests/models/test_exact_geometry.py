"""Compares the exact contact geometry with brute-force searches over the surfaces."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.contact_bodies import OUTER, WALL, ContactLabel
from models.contact_theory import two_point_depth
from models.exact_geometry import BESIDE, FAR, GAP, NORMAL, POINT, SURFACE, rotations_of_vectors
from models.scenario import Geometry
from models.section import CORNER
from tests.models.exact_search import found_minima

R, r, C, DEPTH = 0.01005, 0.010, 0.0005, 0.025
SIZES = {"peg_radius": r, "hole_radius": R, "hole_depth": DEPTH, "chamfer": C}
DUT = Geometry(**SIZES).assembly
PROFILE = np.array([(0.2, 0.0), (R + C, 0.0), (R, -C), (R, -DEPTH), (0.0, -DEPTH)])

poses = st.tuples(
    st.floats(-0.06, 0.06),
    st.floats(-0.06, 0.06),
    st.floats(-0.001, 0.001),
    st.floats(-0.001, 0.001),
    st.floats(-0.026, 0.004),
)


def pose(tilt_x, tilt_y, x, y, z):
    """Position of the tip, and the rotation of the peg."""
    return np.array([[x, y, z]]), rotations_of_vectors([[tilt_x, tilt_y, 0.0]])


def distance_to_block(q):
    """Distance of points (..., 3) from the profile of the block, m; negative inside the block."""
    s = np.stack([np.hypot(q[..., 0], q[..., 1]), q[..., 2]], axis=-1)
    best = np.full(s.shape[:-1], np.inf)
    for a, b in itertools.pairwise(PROFILE):
        t = np.clip(((s - a) @ (b - a)) / ((b - a) @ (b - a)), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(s - a - t[..., None] * (b - a), axis=-1))
    rho, z = s[..., 0], s[..., 1]
    wall = np.where(z > 0, np.inf, np.where(z > -C, R + C + z, R))
    inside_block = (rho > wall) | (z < -DEPTH)
    return np.where(inside_block, -best, best)


def peg_surface(p, a, angle, s):
    """Points of the peg: at height s on its side for s > 0, at radius r (1 + s) on its tip for s in [-1, 0]."""
    u = np.cross([0.0, 1.0, 0.0], a)
    u /= np.linalg.norm(u)
    v = np.cross(a, u)
    radial = np.cos(angle)[..., None] * u + np.sin(angle)[..., None] * v
    size = r * np.clip(1.0 + s, 0.0, 1.0)
    return p + size[..., None] * radial + np.maximum(s, 0.0)[..., None] * a


def min_on_circle(f):
    """Minimum over ten thousand samples, and a thousand more around each of the best thirty."""
    t = np.linspace(0.0, 2 * np.pi, 10_000, endpoint=False)
    best = t[np.argsort(f(t))[:30]]
    return f(best[:, None] + np.linspace(-1e-3, 1e-3, 1001)).min()


@pytest.mark.slow
@given(poses)
def test_the_overlap_equals_that_of_densely_sampled_circles(values):
    p, a = pose(*values)
    gap = DUT.gap(p, a)[0]

    def rim(t):
        return distance_to_block(peg_surface(p[0], a[0, :, 2], t, np.zeros_like(t)))

    def edge(t, rho, z):
        e = np.stack([rho * np.cos(t), rho * np.sin(t), np.full_like(t, z)], axis=-1)
        along = (e - p[0]) @ a[0, :, 2]
        beside = np.linalg.norm(e - p[0] - along[..., None] * a[0, :, 2], axis=-1) - r
        outside = np.hypot(np.minimum(along, 0.0), np.maximum(beside, 0.0))
        return np.where((along > 0) & (beside < 0), np.maximum(beside, -along), np.where(along > 0, beside, outside))

    overlap = min(
        min_on_circle(rim), min_on_circle(lambda t: edge(t, R, -C)), min_on_circle(lambda t: edge(t, R + C, 0.0))
    )
    assert (gap < 0) == (overlap < 0) or abs(gap) < 1e-9
    # In the corner of wall and floor, the gap is the deeper of two overlaps; the distance is that to the corner.
    if p[0, 2] > -DEPTH + 1e-3:
        assert gap == pytest.approx(overlap, abs=1e-9)


@pytest.mark.slow
@given(poses)
def test_contact_points_lie_on_both_bodies_and_normals_are_unit_vectors(values):
    p, a = pose(*values)
    contacts = found_minima(DUT.bodies, p[0], a[0], FAR)
    assert len(contacts)
    assert np.linalg.norm(contacts[:, NORMAL], axis=1) == pytest.approx(1.0, abs=1e-9)
    on_peg = contacts[:, POINT] + contacts[:, NORMAL] * contacts[:, [GAP]] - p[0]
    along = on_peg @ a[0, :, 2]
    across = np.linalg.norm(on_peg - along[:, None] * a[0, :, 2], axis=1)
    rim, beside = contacts[:, SURFACE] < OUTER, contacts[:, BESIDE] == 1.0
    assert along[rim] == pytest.approx(0.0, abs=1e-12)
    assert across[rim | beside] == pytest.approx(r, abs=1e-12)
    touching = (contacts[:, SURFACE] == WALL) & (contacts[:, GAP] < 1e-4)
    assert np.hypot(*contacts[touching, 1:3].T) == pytest.approx(R, abs=1e-12)


@pytest.mark.parametrize("degrees", [0.5, 1.0, 2.0, 3.0, 5.0])
def test_two_point_contact_begins_exactly_at_the_two_point_depth(degrees):
    t = np.radians(degrees)
    h = float(two_point_depth(t, peg_radius=r, hole_radius=R))
    p, a = pose(0.0, t, -R + r * np.cos(t), 0.0, -C - h)
    assert DUT.gap(p, a)[0] == pytest.approx(0.0, abs=1e-12)
    assert DUT.label(p, a, tolerance=1e-9)[0] == ContactLabel.TWO_POINT
    assert DUT.label(p + np.array([0, 0, 1e-5]), a, tolerance=1e-9)[0] == ContactLabel.TIP
    assert DUT.label(p - np.array([-1e-8, 0, 1e-5]), a)[0] == ContactLabel.MOUTH


def test_every_label_occurs_at_a_pose_constructed_for_it():
    tilted = np.radians(1.0)
    cases = {
        ContactLabel.FREE: pose(0, 0, 0, 0, 0.001),
        ContactLabel.FACE: pose(0, 0, 0.002, 0, 0.0),
        ContactLabel.CHAMFER: pose(0, 0, 0.0003, 0, -C + 0.00025),
        ContactLabel.MOUTH: pose(0, tilted, R - r / np.cos(tilted) - 0.004 * np.tan(tilted), 0, -C - 0.004),
        ContactLabel.TIP: pose(0, tilted, -R + r * np.cos(tilted), 0, -C - 0.003),
        ContactLabel.LINE: pose(0, 0, R - r, 0, -0.015),
        ContactLabel.SEATED: pose(0, 0, 0, 0, -DEPTH),
    }
    for expected, (p, a) in cases.items():
        assert DUT.label(p, a, tolerance=1e-8)[0] == expected, expected.label
    assert len({label.label for label in ContactLabel}) == len(ContactLabel)


def test_a_square_peg_can_clock_until_its_corners_touch():
    """The centre of a corner turns at (a - q) sqrt(2) from the axis, and is q from the side that it touches."""
    dut = Geometry(**SIZES, section="square").assembly
    inner, clearance = r * (1.0 - CORNER), R - r
    largest = np.pi / 4 - np.arccos((inner + clearance) / (np.sqrt(2.0) * inner))
    for turn, expected in ((largest, 0.0), (-largest, 0.0), (0.5 * largest, None)):
        gap = dut.gap([[0.0, 0.0, -0.01]], rotations_of_vectors([[0.0, 0.0, turn]]))[0]
        assert gap > 1e-5 if expected is None else gap == pytest.approx(expected, abs=1e-12)


def sharp_square():
    corners = [[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]]
    return Geometry(**SIZES, corners=corners).assembly


@pytest.mark.parametrize("degrees", [0.5, 1.0, 2.0])
def test_two_point_depth_of_a_square_in_the_plane_of_a_diagonal(degrees):
    """There, corners and play are sqrt(2) times as large; but the tip touches with the corners on the axis of the tilt.

    These do not come nearer to the axis of the peg when it tilts, by r (1 - cos t) at each side.
    """
    dut, t = sharp_square(), np.radians(degrees)
    h = float(two_point_depth(t, peg_radius=np.sqrt(2.0) * r, hole_radius=np.sqrt(2.0) * R))
    h -= np.sqrt(2.0) * r * (1.0 - np.cos(t)) / np.tan(t)
    aside, tilt = -(R - r), t * np.sqrt(0.5)  # along x and along y
    p, R_HP = pose(-tilt, tilt, aside, aside, -C - h)
    assert dut.gap(p, R_HP)[0] == pytest.approx(0.0, abs=1e-12)
    assert dut.label(p, R_HP, tolerance=1e-9)[0] == ContactLabel.TWO_POINT
