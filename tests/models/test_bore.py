import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models.bore import (
    BrokenEdge,
    cutaway_sector,
    facet_sagitta,
    make_bore,
    minimum_aligned_facets,
    minimum_facets,
    play_error,
)

SIZES = {"radius": 0.01005, "depth": 0.025, "chamfer": 0.0005, "facets": 64, "block_radius": 0.03, "floor": 0.01}

shapes = st.fixed_dictionaries(
    {
        "radius": st.floats(0.002, 0.02),
        "depth": st.floats(0.005, 0.04),
        "chamfer": st.sampled_from([0.0, 0.0005, 0.002]),
        "facets": st.integers(3, 70),
        "block_radius": st.floats(0.023, 0.05),
        "floor": st.floats(0.001, 0.02),
    }
)


def directed_edges(triangles):
    return Counter((int(t[k]), int(t[(k + 1) % 3])) for t in triangles for k in range(3))


def assert_watertight(mesh):
    """Asserts that every edge belongs to exactly two triangles, with opposite directions."""
    edges = directed_edges(mesh.triangles)
    assert edges
    for (a, b), count in edges.items():
        assert count == 1, f"edge {a}-{b} occurs {count} times in one direction"
        assert edges[(b, a)] == 1, f"edge {a}-{b} belongs to one triangle only"


def volume(mesh):
    """The enclosed volume; negative if the normals of the triangles point inwards."""
    return np.linalg.det(mesh.vertices[mesh.triangles]).sum() / 6.0


def closed_volume(*, radius, depth, chamfer, facets, block_radius, floor):
    """Volume of the block's prism minus the bore's prism and the chamfer's frustum."""

    def inscribed(r):
        return 0.5 * facets * r**2 * math.sin(2.0 * math.pi / facets)

    block = inscribed(block_radius) * (depth + floor)
    inner, outer = inscribed(radius), inscribed(radius + chamfer)
    frustum = chamfer / 3.0 * (inner + outer + math.sqrt(inner * outer))
    return block - inner * (depth - chamfer) - frustum


@given(sizes=shapes)
@settings(max_examples=40)
def test_a_block_is_watertight_and_has_the_volume_of_the_closed_form(sizes):
    mesh = make_bore(**sizes)
    assert_watertight(mesh)
    assert volume(mesh) == pytest.approx(closed_volume(**sizes), rel=1e-9)


@given(sizes=shapes, first=st.integers(0, 30), count=st.integers(1, 69))
@settings(max_examples=40)
def test_a_cut_block_is_watertight_and_has_its_share_of_the_volume(sizes, first, count):
    count = min(count, sizes["facets"] - 1)
    mesh = make_bore(**sizes, sector=(first, first + count))
    assert_watertight(mesh)
    assert volume(mesh) == pytest.approx(closed_volume(**sizes) * count / sizes["facets"], rel=1e-9)


@pytest.mark.parametrize("facets", [3, 7, 64, 92])
def test_the_edges_of_the_bore_lie_on_the_cylinder(facets):
    mesh = make_bore(**{**SIZES, "facets": facets})
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    vertical = np.abs(normals[:, 2]) < 1e-9
    to_axis = np.einsum("ij,ij->i", normals, a)  # signed distance of the face's plane from the axis, positive outwards
    bore = vertical & (to_axis < 0)
    assert bore.sum() == 2 * facets  # two triangles per face
    np.testing.assert_allclose(-to_axis[bore], SIZES["radius"] * math.cos(math.pi / facets), rtol=1e-12)
    outer = vertical & (to_axis > 0)
    np.testing.assert_allclose(to_axis[outer], SIZES["block_radius"] * math.cos(math.pi / facets), rtol=1e-12)


def test_the_chamfer_has_45_degrees():
    mesh = make_bore(**SIZES)
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    slanted = np.abs(np.abs(normals[:, 2]) - math.sqrt(0.5)) < 1e-3  # exact at the edges, approximate at the sides
    assert slanted.sum() == 2 * SIZES["facets"]
    assert (normals[slanted][:, 2] > 0).all()
    np.testing.assert_allclose(mesh.vertices[:, 2].max(), 0.0)
    np.testing.assert_allclose(mesh.vertices[:, 2].min(), -SIZES["depth"] - SIZES["floor"])


def test_wavefront_text_gives_the_same_mesh():
    mesh = make_bore(**SIZES)
    vertices, triangles = [], []
    for line in mesh.to_obj().splitlines():
        kind, *numbers = line.split()
        (vertices if kind == "v" else triangles).append([float(n) for n in numbers])
    np.testing.assert_allclose(vertices, mesh.vertices, rtol=1e-8, atol=1e-12)
    np.testing.assert_array_equal(np.array(triangles, dtype=int) - 1, mesh.triangles)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"facets": 2}, "2 facets"),
        ({"radius": -0.01}, "radius -0.01"),
        ({"chamfer": -1e-4}, "chamfer -0.0001"),
        ({"chamfer": 0.025}, "chamfer 0.025"),
        ({"block_radius": 0.0105}, "block radius 0.0105"),
        ({"floor": 0.0}, "floor 0.0"),
    ],
)
def test_impossible_sizes_raise_an_error(change, message):
    with pytest.raises(ValueError, match=message):
        make_bore(**{**SIZES, **change})


def test_sagitta_of_a_square_and_a_hexagon():
    assert facet_sagitta(1.0, 4) == pytest.approx(1.0 - math.sqrt(0.5))
    assert facet_sagitta(2.0, 6) == pytest.approx(2.0 * (1.0 - math.sqrt(0.75)))


@given(radius=st.floats(0.001, 0.1), share=st.floats(1e-4, 0.3))
def test_minimum_facets_gives_a_sagitta_of_at_most_a_quarter_of_the_clearance(radius, share):
    clearance = share * radius
    n = minimum_facets(radius, clearance)
    assert facet_sagitta(radius, n) <= clearance / 4 * (1 + 1e-6)
    if n > 3:
        assert facet_sagitta(radius, n - 1) > clearance / 4 * (1 - 1e-6)


def test_the_clearance_of_the_paper_needs_63_facets():
    # cos(pi/n) = 1 - 50 um / (4 x 10.05 mm) = 1 - 0.00124378, so pi/n = 0.049881 and n = 62.98
    assert minimum_facets(0.01005, 5e-5) == 63


def test_the_cutaway_is_half_of_the_ring_opposite_the_camera():
    assert cutaway_sector(64) == (24, 56)
    mesh = make_bore(**SIZES, sector=cutaway_sector(64))
    towards_camera = np.array([math.cos(math.radians(45.0)), math.sin(math.radians(45.0)), 0.0])
    assert (mesh.vertices @ towards_camera).max() < 1e-9


def test_23_facets_keep_the_error_of_the_play_below_one_percent():
    # cos(pi/n) = 0.99, so pi/n = 0.14154 and n = 22.2
    assert minimum_aligned_facets() == 23
    assert play_error(23) <= 0.01 < play_error(22)
    assert play_error(24) == pytest.approx(0.00856, rel=1e-3)


def test_the_broken_edge_is_steeper_than_any_peg_that_enters():
    edge = BrokenEdge.of(radius=0.01005, clearance=5e-5, chamfer=5e-4)
    assert edge.height == pytest.approx(20e-6)
    # the largest tilt is 5.718 degrees, and tan(8.577 degrees) = 0.1508
    assert edge.width == pytest.approx(3.017e-6, rel=1e-3)
    assert BrokenEdge.of(radius=0.01005, clearance=5e-5, chamfer=0.0) is None


@given(radius=st.floats(1e-3, 0.1), share=st.floats(1e-4, 0.3), chamfer=st.floats(1e-7, 1e-2))
def test_the_broken_edge_stays_between_the_wall_and_the_chamfer(radius, share, chamfer):
    edge = BrokenEdge.of(radius=radius, clearance=share * radius, chamfer=chamfer)
    assert 0.0 < edge.width <= edge.height <= 0.2 * chamfer * (1 + 1e-12)
    distance = (edge.height - edge.width) / math.sqrt(2.0)  # from the chamfer
    assert distance <= 0.3 * share * radius


def test_a_broken_edge_adds_one_ring_above_the_mouth():
    edge = BrokenEdge(width=3e-6, height=2e-5)
    sharp, broken = make_bore(**SIZES), make_bore(**SIZES, edge=edge)
    assert len(broken.vertices) == len(sharp.vertices) + SIZES["facets"]
    ring = broken.vertices[np.isclose(broken.vertices[:, 2], -SIZES["chamfer"] + 2e-5, rtol=0, atol=1e-9)]
    np.testing.assert_allclose(np.hypot(ring[:, 0], ring[:, 1]), SIZES["radius"] + 3e-6, rtol=1e-12)
    # The band adds material: the triangle between the edge, its own upper corner and the upper edge of the chamfer.
    area = 0.5 * (SIZES["chamfer"] * 2e-5 - SIZES["chamfer"] * 3e-6)
    added = volume(broken) - volume(sharp)
    assert added == pytest.approx(2.0 * math.pi * SIZES["radius"] * area, rel=0.03)


def test_the_inside_is_the_closed_surface_without_outer_side_and_bottom():
    closed, inside = make_bore(**SIZES), make_bore(**SIZES, inside=True)
    faces = [{m.vertices[t].tobytes() for t in m.triangles} for m in (closed, inside)]
    assert faces[1] < faces[0]
    heights, radii = inside.vertices[:, 2], np.hypot(*inside.vertices[:, :2].T)
    assert heights.min() == -SIZES["depth"]
    assert radii.max() == pytest.approx(SIZES["block_radius"])
    left_out = [np.frombuffer(face).reshape(3, 3) for face in faces[0] - faces[1]]
    for corners in left_out:  # on the outer side or on the bottom
        beside = np.allclose(np.hypot(*corners[:, :2].T), SIZES["block_radius"])
        assert beside or np.allclose(corners[:, 2], -SIZES["depth"] - SIZES["floor"])
