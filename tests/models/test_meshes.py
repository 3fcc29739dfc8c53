import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.meshes import (
    BrokenEdge,
    cutaway_columns,
    facet_sagitta,
    make_hole,
    make_peg,
    make_prism,
    minimum_facets,
)
from models.section import NAMES, section_of

ROUND = section_of("round")
RADIUS = 0.01005
SIZES = {
    "section": ROUND.scaled(RADIUS),
    "depth": 0.025,
    "chamfer": 0.0005,
    "facets": 64,
    "block_radius": 0.03,
    "floor": 0.01,
}

shapes = st.fixed_dictionaries(
    {
        "section": st.floats(0.002, 0.02).map(ROUND.scaled),
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


def closed_volume(*, section, depth, chamfer, facets, block_radius, floor):
    """Volume of the block's prism minus the bore's prism and the chamfer's frustum."""

    radius = section.outer_radius

    def inscribed(r):
        return 0.5 * facets * r**2 * math.sin(2.0 * math.pi / facets)

    block = inscribed(block_radius) * (depth + floor)
    inner, outer = inscribed(radius), inscribed(radius + chamfer)
    frustum = chamfer / 3.0 * (inner + outer + math.sqrt(inner * outer))
    return block - inner * (depth - chamfer) - frustum


@given(sizes=shapes)
def test_a_block_is_watertight_and_has_the_volume_of_the_closed_form(sizes):
    mesh = make_hole(**sizes)
    assert_watertight(mesh)
    assert volume(mesh) == pytest.approx(closed_volume(**sizes), rel=1e-9)


@given(sizes=shapes)
def test_a_cut_block_is_watertight_and_has_its_share_of_the_volume(sizes):
    mesh, facets = make_hole(**sizes, cutaway=True), sizes["facets"]
    assert_watertight(mesh)
    count = len(cutaway_columns(sizes["section"].polyline(facets))) - 1
    assert count == pytest.approx(facets / 2, abs=1)
    assert volume(mesh) == pytest.approx(closed_volume(**sizes) * count / facets, rel=1e-9)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("cutaway", [False, True])
def test_the_block_of_every_section_is_watertight(name, cutaway):
    hole = section_of(name).scaled(0.01).offset(5e-5)
    sizes = {**SIZES, "section": hole}
    mesh = make_hole(**sizes, cutaway=cutaway, edge=BrokenEdge(width=3e-6, height=2e-5))
    assert_watertight(mesh)
    if not cutaway:  # the block's outer side has the corners of the hole, on a circle
        around = SIZES["block_radius"] * hole.polyline(64) / np.hypot(*hole.polyline(64).T)[:, None]
        after = np.roll(around, -1, axis=0)
        ground = 0.5 * float((around[:, 0] * after[:, 1] - around[:, 1] * after[:, 0]).sum())
        block = ground * (SIZES["depth"] + SIZES["floor"])
        inner, outer = hole.area, hole.offset(SIZES["chamfer"]).area
        chamfer = SIZES["chamfer"] * 0.5 * (inner + outer)
        expected = block - inner * (SIZES["depth"] - SIZES["chamfer"]) - chamfer
        assert volume(mesh) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("name", NAMES)
def test_the_peg_of_every_section_is_filled_with_tetrahedra(name):
    section = section_of(name).scaled(0.01)
    surface, solid = make_prism(section, 0.06, 32), make_peg(section, 0.06, 32)
    assert_watertight(surface)
    a, b, c, d = (solid.vertices[solid.tetrahedra[:, k]] for k in range(4))
    volumes = np.einsum("ni,ni->n", np.cross(b - a, c - a), d - a) / 6.0
    assert volumes.min() > 0.0
    assert volumes.sum() == pytest.approx(volume(surface), rel=1e-9)
    assert volume(surface) == pytest.approx(0.06 * section.area, rel=0.01)
    header = solid.to_vtk().splitlines()[4]
    assert header == f"POINTS {len(solid.vertices)} double"


def test_wavefront_text_gives_the_same_mesh():
    mesh = make_hole(**SIZES)
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
        ({"chamfer": -1e-4}, "chamfer -0.0001"),
        ({"chamfer": 0.025}, "chamfer 0.025"),
        ({"block_radius": 0.0105}, "block radius 0.0105"),
        ({"floor": 0.0}, "floor 0.0"),
    ],
)
def test_impossible_sizes_raise_an_error(change, message):
    with pytest.raises(ValueError, match=message):
        make_hole(**{**SIZES, **change})


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


def test_the_cutaway_is_half_of_the_ring_opposite_the_camera():
    columns = cutaway_columns(SIZES["section"].polyline(64))
    assert (columns[0], columns[-1]) == (24, 56)
    mesh = make_hole(**SIZES, cutaway=True)
    towards_camera = np.array([math.cos(math.radians(45.0)), math.sin(math.radians(45.0)), 0.0])
    assert (mesh.vertices @ towards_camera).max() < 1e-9


def test_the_broken_edge_is_steeper_than_any_peg_that_enters():
    edge = BrokenEdge.of(radius=0.01005, clearance=5e-5, chamfer=5e-4)
    assert edge.height == pytest.approx(20e-6)
    # the largest tilt is 5.718 degrees, and tan(8.577 degrees) = 0.1508
    assert edge.width == pytest.approx(3.017e-6, rel=1e-3)
    assert BrokenEdge.of(radius=0.01005, clearance=5e-5, chamfer=0.0) is None


def test_a_broken_edge_adds_one_ring_above_the_mouth():
    edge = BrokenEdge(width=3e-6, height=2e-5)
    sharp, broken = make_hole(**SIZES), make_hole(**SIZES, edge=edge)
    assert len(broken.vertices) == len(sharp.vertices) + SIZES["facets"]
    ring = broken.vertices[np.isclose(broken.vertices[:, 2], -SIZES["chamfer"] + 2e-5, rtol=0, atol=1e-9)]
    np.testing.assert_allclose(np.hypot(ring[:, 0], ring[:, 1]), RADIUS + 3e-6, rtol=1e-12)
    # The band adds material: the triangle between the edge, its own upper corner and the upper edge of the chamfer.
    area = 0.5 * (SIZES["chamfer"] * 2e-5 - SIZES["chamfer"] * 3e-6)
    added = volume(broken) - volume(sharp)
    assert added == pytest.approx(2.0 * math.pi * RADIUS * area, rel=0.03)


def test_the_inside_is_the_closed_surface_without_outer_side_and_bottom():
    closed, inside = make_hole(**SIZES), make_hole(**SIZES, inside=True)
    faces = [{m.vertices[t].tobytes() for t in m.triangles} for m in (closed, inside)]
    assert faces[1] < faces[0]
    heights, radii = inside.vertices[:, 2], np.hypot(*inside.vertices[:, :2].T)
    assert heights.min() == -SIZES["depth"]
    assert radii.max() == pytest.approx(SIZES["block_radius"])
    left_out = [np.frombuffer(face).reshape(3, 3) for face in faces[0] - faces[1]]
    for corners in left_out:  # on the outer side or on the bottom
        beside = np.allclose(np.hypot(*corners[:, :2].T), SIZES["block_radius"])
        assert beside or np.allclose(corners[:, 2], -SIZES["depth"] - SIZES["floor"])
