"""Pairs of bodies with known sizes, and bodies that are no peg and hole."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from models.cad.pair import ANGLES, fit
from models.cad.scenario_file import part_text, remarks, scenario_of
from models.cad.solid_file import read_solid
from models.scenario import load_scenario
from models.section import section_of
from tests.models.cad.bodies import block, circle, lofted, peg, save

PARTS = Path(__file__).parents[3] / "models" / "parts"
FINE = 240
TRIANGLE = [[1.5, -1.0, 0.3], [0.2, 1.6, 0.2], [-1.4, -0.9, 0.4]]
KITE = [[1.2, -1.0], [0.9, 1.0], [-0.8, 1.1], [-1.0, -0.9]]  # sharp corners, and no symmetry


def pair(tmp_path, peg_body, block_body, **options):
    files = [save(body, tmp_path / f"{k}.stl", **options) for k, body in enumerate((peg_body, block_body))]
    return fit(*map(read_solid, files))


def outlines(shape, size, clearance, chamfer=0.0):
    """Dense outlines of peg, hole and mouth, mm."""
    section = section_of(shape).scaled(size)
    return [section.offset(d).polyline(FINE) for d in (0.0, clearance, clearance + chamfer)]


@pytest.mark.parametrize("shape", ["square", "hexagon", "rectangle", "key", "d", TRIANGLE, KITE])
def test_the_clearance_of_a_section_is_that_of_its_bodies(tmp_path, shape):
    own, hole, mouth = outlines(shape, 8.0, 0.04, 0.6)
    found = pair(tmp_path, peg(own), block(hole, mouth=mouth, chamfer=0.6))
    (mating,) = found.matings
    assert mating.clearance.shape == (ANGLES,)
    assert mating.depths == pytest.approx((0.0006, 0.020), abs=1e-8)
    assert 1e3 * mating.clearance.min() == pytest.approx(0.04, abs=1e-4)
    assert mating.clearance.max() == pytest.approx(mating.clearance.min(), abs=1e-7)
    assert (found.depth, found.length, found.floor) == pytest.approx((0.020, 0.040, 0.010), abs=1e-8)
    assert (found.chamfer, found.chamfer_height) == pytest.approx((6e-4, 6e-4), rel=0.02)
    scenario = scenario_of(found)
    assert scenario.geometry.clearance == pytest.approx(4e-5, abs=2e-8)
    made, drawn = scenario.geometry.assembly.fits[0].peg, section_of(shape).scaled(0.008)
    assert made.area == pytest.approx(drawn.area, rel=1e-5)
    assert (made.order, made.mirror is None) == (drawn.order, drawn.mirror is None)


def test_a_round_peg_is_a_circle_again(tmp_path):
    found = pair(tmp_path, peg(circle(4.0)), block(circle(4.0085)))
    assert found.guide.is_round
    assert found.clearance == pytest.approx(8.5e-6, abs=2e-8)
    geometry = scenario_of(found).geometry
    assert (geometry.is_round, geometry.peg_radius, geometry.chamfer) == (True, 0.004, 0.0)


@pytest.mark.parametrize("turn", [[1, 0, 0], [0, 1, 0], [-1, 0, 0]])
def test_the_axis_is_found_in_any_direction_and_place(tmp_path, turn):
    own, hole, _ = outlines("d", 8.0, 0.04)
    found = pair(tmp_path, peg(own), block(hole), turn=turn, shift=(3.0, -4.0, 5.0))
    assert found.axis == {(1, 0, 0): "-y", (0, 1, 0): "+x", (-1, 0, 0): "+y"}[tuple(turn)]
    assert found.clearance == pytest.approx(4e-5, abs=2e-8)
    assert abs(complex(*found.moved)) == 0.0


def test_a_peg_that_is_drawn_elsewhere_is_moved_to_where_the_clearance_is_even(tmp_path):
    own, hole, _ = outlines("square", 8.0, 0.04)
    files = save(peg(own), tmp_path / "a.stl", shift=(2.0, 1.0, 30.0)), save(block(hole), tmp_path / "b.stl")
    found = fit(*map(read_solid, files))
    assert found.moved == pytest.approx((-2e-3, -1e-3), abs=1e-7)
    assert np.ptp(found.guide.clearance) < 1e-6
    assert any("moved" in line for line in remarks(found))


def test_two_diameters_have_two_clearances_of_which_one_guides(tmp_path):
    own = lofted([(0.0, circle(8.0)), (30.0, circle(8.0)), (30.0, circle(9.0)), (50.0, circle(9.0))])
    around = circle(30.0)
    rings = [(-40.0, around), (0.0, around), (0.0, circle(9.5)), (-10.0, circle(9.5)), (-10.0, circle(8.05))]
    found = pair(tmp_path, own, lofted([*rings, (-30.0, circle(8.05))]))
    assert [mating.depths for mating in found.matings] == [
        pytest.approx((0.0, 0.010), abs=1e-8),
        pytest.approx((0.010, 0.030), abs=1e-8),
    ]
    assert [mating.clearance.min() for mating in found.matings] == pytest.approx([1.5e-3, 5e-5], abs=2e-8)
    assert found.guide is found.matings[1]


def stepped_peg(tip, shoulder):
    """A peg of 40 mm whose shoulder is 11 mm above its tip."""
    return lofted([(0.0, tip), (11.0, tip), (11.0, shoulder), (40.0, shoulder)])


def stepped_block(deep, wide, chamfer=0.0):
    """A block with a hole of 20 mm that is wide in the upper 10 mm."""
    around, n = circle(30.0, len(deep)), len(deep)
    mouths = [wide, deep] if chamfer == 0.0 else [circle(np.hypot(*p[0]) + chamfer, n) for p in (wide, deep)]
    rings = [(0.0, mouths[0]), (-chamfer, wide), (-10.0, wide), (-10.0, mouths[1]), (-10.0 - chamfer, deep)]
    return lofted([(-40.0, around), (0.0, around), *rings, (-20.0, deep)])


@pytest.mark.parametrize("chamfer", [0.0, 0.5])
def test_two_round_steps_that_both_guide_the_peg_become_mates(tmp_path, chamfer):
    bodies = stepped_peg(circle(4.0), circle(5.0)), stepped_block(circle(4.05), circle(5.05), chamfer)
    found = pair(tmp_path, *bodies)
    scenario = scenario_of(found)
    steps = [[0.0, 0.0, 0.004, 0.0, 0.010], [0.0, 0.0, 0.005, 0.011, 0.0]]
    np.testing.assert_allclose(scenario.geometry.mates, steps, atol=2e-8)
    assert (scenario.contact.engine, scenario.geometry.peg_radius) == ("exact", 0.004)
    assert scenario.geometry.clearance == pytest.approx(5e-5, abs=2e-8)
    assert any(line.startswith("steps: 4.0000, 5.0000 mm") for line in remarks(found))
    path = tmp_path / "part.yaml"
    path.write_text(part_text(found))
    assert load_scenario(str(path)).geometry.mates == scenario.geometry.mates


def test_a_chamfered_tip_and_a_steep_lead_in_are_said_to_be_left_out(tmp_path):
    own = lofted([(0.0, circle(7.5)), (0.5, circle(8.0)), (40.0, circle(8.0))])
    found = pair(tmp_path, own, block(circle(8.05), mouth=circle(8.45), chamfer=1.0))
    assert (found.tip, found.chamfer, found.chamfer_height) == pytest.approx((5e-4, 4e-4, 1e-3), rel=0.01)
    assert scenario_of(found).geometry.chamfer == pytest.approx(9e-4, abs=1e-5)
    said = [line for line in remarks(found) if line.startswith("left out")]
    assert len(said) == 2


def test_an_uneven_clearance_is_stated_by_angle_and_simulated_by_its_smallest(tmp_path):
    own, hole = (
        section_of([[x * sx, y * sy, 1.0] for sx, sy in ((1, -1), (1, 1), (-1, 1), (-1, -1))]).polyline(FINE)
        for x, y in ((12.0, 8.0), (12.04, 8.06))
    )
    found = pair(tmp_path, peg(own), block(hole))
    by_angle = found.guide.clearance
    assert 1e6 * by_angle[[0, 90, 180, 270]] == pytest.approx([40.0, 60.0, 40.0, 60.0], abs=0.2)
    assert scenario_of(found).geometry.clearance == pytest.approx(by_angle.min(), abs=2e-8)
    assert any(line.startswith("left out: the clearance varies") for line in remarks(found))


def test_a_through_hole_gets_a_floor(tmp_path):
    around, hole = circle(30.0), circle(8.05)
    bore = lofted([(-20.0, hole), (-20.0, around), (0.0, around), (0.0, hole), (-20.0, hole)])
    bore.update_faces(~np.any(bore.faces >= 5 * len(hole), axis=1))  # without the fans
    found = pair(tmp_path, peg(circle(8.0)), bore)
    assert found.through
    assert found.depth == pytest.approx(0.020, abs=1e-8)
    assert scenario_of(found).geometry.floor > 0.0


def test_the_file_reads_back_as_the_scenario(tmp_path):
    found = fit(read_solid(PARTS / "d_shaft.step"), read_solid(PARTS / "d_shaft_hole.step"))
    section = found.guide.section
    assert (section.inner_radius, section.outer_radius) == pytest.approx((0.0055, 0.008), abs=1e-7)  # in its own unit
    path = tmp_path / "part.yaml"
    path.write_text(part_text(found))
    assert set(yaml.safe_load(path.read_text())) == {"geometry"}
    own, again = scenario_of(found), load_scenario(path)
    for name in ("peg_radius", "hole_radius", "hole_depth", "chamfer", "corners"):
        assert getattr(again.geometry, name) == getattr(own.geometry, name)
    assert again.contact.modulus != own.contact.modulus  # by the rule of the clearance
    assert path.read_text().splitlines()[1] == "# the hole opens along +z; 20.000 mm deep"


def broken(body, change):
    """A body with a fault."""
    body = body.copy()
    if change == "open":
        body.update_faces(np.arange(len(body.faces)) != 5)
    elif change == "inside out":
        body.invert()
    return body


@pytest.mark.parametrize(
    ("own", "hole", "message"),
    [
        (broken(peg(circle(8.0)), "open"), block(circle(8.05)), "0.stl: the surface is open: 3 of"),
        (peg(circle(8.0)), broken(block(circle(8.05)), "inside out"), "1.stl: the surface is inside out"),
        (peg(circle(8.1)), block(circle(8.05)), "they interfere by 50.0 um"),
        (
            peg(circle(4.0)),
            block(circle(8.05)),
            "a clearance of 4.05 mm at a radius of 4 mm; expected a peg and its own",
        ),
        (peg(circle(8.0)), peg(circle(8.05)), "1.stl: no hole that opens along x, y or z"),
        (peg(circle(8.0) / 25.4), block(circle(8.05)), "0.stl seems to be in inches"),
        (peg(circle(8.0)), block(circle(8.05) / 25.4), "1.stl seems to be in inches"),
        (lofted([(0.0, circle(7.0)), (40.0, circle(8.0))]), block(circle(8.05)), "0.stl: the peg is not prismatic"),
        (peg(circle(8.0)), block(circle(8.05), mouth=circle(12.0), chamfer=20.0), "1.stl: the hole is not prismatic"),
        (peg(outlines("square", 8.0, 0.0)[0]), block(circle(11.6, 240)), "clearance around the peg is"),
        (
            stepped_peg(outlines("square", 6.0, 0.0)[0], outlines("square", 8.0, 0.0)[0]),
            stepped_block(outlines("square", 6.0, 0.05)[1], outlines("square", 8.0, 0.05)[1]),
            "sections of several sizes guide the peg, 6.000 and 8.000 mm inside, and one is not round",
        ),
    ],
)
def test_bodies_that_are_no_peg_and_hole_are_refused_with_the_reason(tmp_path, own, hole, message):
    with pytest.raises(ValueError, match=message):
        pair(tmp_path, own, hole)


def test_files_in_inches_are_read_if_the_unit_is_given(tmp_path):
    bodies = peg(circle(8.0)), block(circle(8.05))
    files = [save(body, tmp_path / f"{k}.stl", scale=1.0 / 25.4) for k, body in enumerate(bodies)]
    assert fit(*(read_solid(file, "inch") for file in files)).clearance == pytest.approx(5e-5, abs=2e-8)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.obj", "", "the suffix '.obj', expected one of"),
        ("a.stl", "nothing", "a.stl: "),
        *(("a.step", text, "a.step: no triangles in it, expected the surface of one body") for text in ("", "nothing")),
    ],
)
def test_files_that_hold_no_body_are_refused(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=message):
        read_solid(tmp_path / name)


def test_a_file_with_two_bodies_is_refused(tmp_path):
    both = peg(circle(8.0)) + peg(circle(3.0) + np.array([40.0, 0.0]))
    with pytest.raises(ValueError, match="2 bodies, expected one"):
        read_solid(save(both, tmp_path / "a.stl"))
