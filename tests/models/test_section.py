"""Outlines against closed forms, and against dense polygons."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.section import CORNER, FLAT, KIND, NAMES, POLYGONS, SIZE, point_on, rounded_corners, section_of

SQUARE = [(1, -1), (1, 1), (-1, 1), (-1, -1)]
NOTCHED = [(1, -1), (1, 1), (0.5, 1), (0.15, 0.4), (-0.15, 0.4), (-0.5, 1), (-1, 1), (-1, -1)]
sections = st.sampled_from([section_of(shape) for shape in (*NAMES, SQUARE, NOTCHED)])


def polygon_area(points):
    after = np.roll(points, -1, axis=0)
    return 0.5 * float((points[:, 0] * after[:, 1] - points[:, 1] * after[:, 0]).sum())


@pytest.mark.parametrize(
    ("name", "area", "order", "inner", "outer"),
    [
        ("round", math.pi, 0, 1.0, 1.0),
        ("square", 4.0 - (4.0 - math.pi) * CORNER**2, 4, 1.0, math.sqrt(2.0) * (1.0 - CORNER) + CORNER),
        ("rectangle", 6.0 - (4.0 - math.pi) * CORNER**2, 2, 1.0, math.hypot(1.5 - CORNER, 1.0 - CORNER) + CORNER),
        ("hexagon", 2.0 * math.sqrt(3.0) - (2.0 * math.sqrt(3.0) - math.pi) * CORNER**2, 6, 1.0, None),
        ("d", None, 1, FLAT, 1.0),
        ("key", None, 1, 1.0, None),
    ],
)
def test_named_sections_have_the_sizes_of_closed_forms(name, area, order, inner, outer):
    section = section_of(name)
    assert section.order == order
    assert section.inner_radius == pytest.approx(inner)
    assert section.mirror == pytest.approx(0.0)
    if area is not None:
        assert section.area == pytest.approx(area)
    if outer is not None:
        assert section.outer_radius == pytest.approx(outer)


@given(sections)
def test_pieces_join_and_their_area_is_that_of_a_dense_polygon(section):
    ends = [point_on(piece, np.array([0.0, 1.0])) for piece in section.pieces]
    for (_, last), (first, _) in zip(ends, ends[1:] + ends[:1], strict=True):
        np.testing.assert_allclose(last, first, atol=1e-12)
    points = section.polyline(4000)
    assert section.area == pytest.approx(polygon_area(points), rel=1e-5)
    assert np.hypot(*points.T).max() == pytest.approx(section.outer_radius, rel=1e-5)
    assert np.hypot(*section.polyline(4000).T).min() >= section.inner_radius - 1e-12


@given(sections, st.floats(-math.pi, math.pi))
def test_a_section_reaches_as_far_as_its_farthest_point(section, angle):
    along = math.cos(angle), math.sin(angle)
    assert section.reach(*along) == pytest.approx((section.polyline(4000) @ along).max(), abs=1e-6)


@given(st.sampled_from(list(POLYGONS)), st.floats(-math.pi, math.pi))
def test_a_turned_polygon_reaches_as_far_in_the_turned_direction(name, angle):
    turned = section_of(rounded_corners(name, angle))
    assert turned.reach(math.cos(angle), math.sin(angle)) == pytest.approx(section_of(name).reach(1.0, 0.0))


@given(sections, st.floats(0.0, 0.05))
def test_the_offset_outline_is_everywhere_as_far_outside(section, distance):
    outside = section.offset(distance)
    points, there = section.polyline(2000), outside.polyline(2000)
    assert len(points) == len(there)
    round_corners = all(piece[SIZE] > 0.0 for piece in section.pieces if piece[KIND] != 0.0)
    away = np.linalg.norm(there - points, axis=1)
    if round_corners:
        np.testing.assert_allclose(away, distance, atol=1e-12)
    else:  # a mitre is further away
        assert away.min() >= distance - 1e-12
        assert away.max() <= 1.6 * distance + 1e-12


def test_a_mitred_square_stays_a_square():
    points = section_of(SQUARE).offset(0.25).polyline(8)
    np.testing.assert_allclose(sorted(map(tuple, points)), [(-1.25, -1.25), (-1.25, 1.25), (1.25, -1.25), (1.25, 1.25)])


def test_symmetry_of_a_polygon_without_any():
    section = section_of([(1, -1), (1, 1), (-1, 1.2), (-1, -1)])
    assert (section.order, section.mirror) == (1, None)


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ("oval", "expected one of"),
        ([(1, 0), (0, 1)], "2 corners"),
        (SQUARE[::-1], "not counter-clockwise"),
        ([(x + 3, y) for x, y in SQUARE], "not seen from the axis"),
        ([(x, y, 1.2) for x, y in SQUARE], "too large radii"),
        ([(1, -1), (1, -1), (-1, 1)], "at one place"),
        ([(1, -1), (1, math.nan), (-1, 1)], "not finite"),
    ],
)
def test_shapes_that_are_no_section_raise_an_error(shape, message):
    with pytest.raises(ValueError, match=message):
        section_of(shape)


def test_an_offset_that_closes_a_concave_arc_raises_an_error():
    with pytest.raises(ValueError, match="too small for an offset"):
        section_of("key").offset(0.2)
