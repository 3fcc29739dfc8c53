"""Parts whose sections mate at once, against hand-worked gaps."""

import math

import numpy as np
import pytest

from models.assembly import Assembly
from models.contact_bodies import ContactLabel
from models.exact_geometry import CONTACTS, GAP, NORMAL, POINT, find_contacts, pose_of, rotations_of_vectors
from models.scenario import load_scenario, parse_scenario

PLUG, STEPPED = load_scenario("two_pin_plug").geometry, load_scenario("stepped_shaft").geometry
UPRIGHT = np.eye(3)[None]
CLEARANCE = 5e-5


@pytest.mark.parametrize("turn", [0.0, 0.002, -0.004, 0.007])
def test_two_pins_leave_a_plug_the_play_of_their_distance(turn):
    """A pin 9.5 mm from the axis moves by 2 a sin(turn / 2)."""
    gap = PLUG.assembly.gap([[0.0, 0.0, -0.010]], rotations_of_vectors([[0.0, 0.0, turn]]))
    assert gap[0] == pytest.approx(CLEARANCE - 2.0 * 0.0095 * math.sin(0.5 * abs(turn)), abs=1e-12)


def test_both_pins_press_at_once_on_a_plug_that_is_turned_too_far():
    contacts, R = np.empty(CONTACTS), rotations_of_vectors([[0.0, 0.0, 0.006]])[0]
    count = find_contacts(PLUG.assembly.bodies, pose_of(np.array([0.0, 0.0, -0.010]), R), contacts)
    on = contacts[:count][contacts[:count, GAP] < 0.0]
    places, pushes = on[:, POINT], on[:, NORMAL]
    moments = np.cross(places, pushes)[:, 2]
    assert {round(1e3 * x / 9.5) for x in places[:, 0]} == {-1, 1}
    assert (moments < 0.0).all()  # both turn it back


DEPTHS = {
    "above the chamfer": (-0.001, (0.00505 + 0.001 - 0.004 + 0.001) / math.sqrt(2.0), ContactLabel.FREE),
    "the tip in the wide bore": (0.003, 0.00505 - 0.004, ContactLabel.FREE),
    "the tip in its bore": (0.0065, CLEARANCE, ContactLabel.FREE),
    "both steps": (0.010, CLEARANCE, ContactLabel.FREE),
    "on the floor": (0.012, 0.0, ContactLabel.SEATED),
}


@pytest.mark.parametrize(("depth", "gap", "label"), DEPTHS.values(), ids=DEPTHS)
def test_the_gap_of_a_stepped_shaft_on_the_axis(depth, gap, label):
    p = [[0.0, 0.0, -depth]]
    assert STEPPED.assembly.gap(p, UPRIGHT)[0] == pytest.approx(gap, abs=1e-12)
    assert STEPPED.assembly.label(p, UPRIGHT, tolerance=1e-9)[0] == label


def test_a_shaft_with_both_steps_in_tilts_less_than_its_shoulder_alone():
    """From the inner edge to the tip the play is 2 c over 10.7 mm, 9.3 mrad; to the shoulder 3.7 mm, 27 mrad."""
    shifts = np.linspace(-2e-4, 2e-4, 401)
    p = np.column_stack([shifts, 0.0 * shifts, np.full(401, -0.0117)])
    shoulder = Assembly(STEPPED.assembly.fits[1:], ())

    def fits(tilt):
        R = rotations_of_vectors(np.tile([0.0, tilt, 0.0], (401, 1)))
        return shoulder.gap(p, R).max() > 0.0, STEPPED.assembly.gap(p, R).max() > 0.0

    assert [fits(tilt) for tilt in (0.0091, 0.0096, 0.0200)] == [(True, True), (True, False), (True, False)]


@pytest.mark.parametrize("geometry", [PLUG, STEPPED], ids=["plug", "shaft"])
def test_pictures_have_the_volume_and_the_reach_of_the_part(geometry):
    mesh = geometry.assembly.peg_mesh(256)
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0
    assert volume == pytest.approx(geometry.assembly.volume, rel=1e-3)
    assert np.hypot(*mesh.vertices[:, :2].T).max() == pytest.approx(geometry.assembly.reach)
    block = geometry.assembly.block_mesh(32, block_radius=geometry.block_radius, floor=geometry.floor)
    assert block.vertices[:, 2].min() == pytest.approx(-geometry.hole_depth - geometry.floor)
    assert block.vertices[:, 2].max() == 0.0


def test_the_volume_is_that_of_the_steps():
    steps = math.pi * (0.004**2 * 0.007 + 0.005**2 * (STEPPED.peg_length - 0.007))
    assert STEPPED.assembly.volume == pytest.approx(steps)
    assert PLUG.assembly.volume == pytest.approx(2.0 * math.pi * 0.004**2 * PLUG.peg_length)


REFUSED = {
    "no row at the tip": ("[[0, 0, 0.004, 0.001, 0]]", "lowest tip at 0"),
    "a radius of zero": ("[[0, 0, 0, 0, 0]]", "positive radii"),
    "four numbers": ("[[0, 0, 0.004, 0]]", "another shape"),
    "pins that overlap": ("[[-0.004, 0, 0.004, 0, 0], [0.004, 0, 0.004, 0, 0]]", "mates 1 and 2 overlap"),
    "steps the wrong way round": ("[[0, 0, 0.005, 0, 0.012], [0, 0, 0.004, 0.014, 0]]", "mates 1 and 2 overlap"),
    "a shoulder on its step": ("[[0, 0, 0.004, 0, 0.012], [0, 0, 0.005, 0.010, 0]]", "mate 2: its tip would be below"),
    "no room for a bore": ("[[0, 0, 0.004, 0, 0.0249], [0, 0, 0.005, 0.014, 0]]", "mate 1: its hole ends 0.1 mm"),
}


@pytest.mark.parametrize(("rows", "message"), REFUSED.values(), ids=REFUSED)
def test_mates_that_describe_no_part_are_refused(rows, message):
    text = f"geometry: {{mates: {rows}, peg_radius: 0.004, hole_radius: 0.00405}}\ncontact: {{engine: exact}}\n"
    with pytest.raises(ValueError, match=rf"a: geometry\.mates is .*{message}"):
        parse_scenario(text, "a")


def test_several_sections_need_the_exact_engine():
    with pytest.raises(
        ValueError, match=r"contact\.engine is drake, expected exact: the mesh of the hole has one section"
    ):
        parse_scenario("geometry: {mates: [[-0.01, 0, 0.004, 0, 0], [0.01, 0, 0.004, 0, 0]]}", "a")


def test_an_assembly_is_that_of_the_stored_geometry():
    from skill.data.geometry import PegHoleGeometry

    stored = PegHoleGeometry.from_metadata(
        {"geometry": PegHoleGeometry.from_metadata({"geometry": vars(PLUG)}, "a").record()}, "a"
    )
    p, R = [[0.0, 0.0, -0.01]], rotations_of_vectors([[0.0, 0.0, 0.003]])
    assert Assembly.of(stored).gap(p, R)[0] == PLUG.assembly.gap(p, R)[0]
