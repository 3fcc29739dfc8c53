"""What a command says of its scenario before it begins."""

import pytest

from scripts.command_line import read_scenario


@pytest.mark.parametrize("name", ["nominal", "square", "live"])
def test_nothing_is_said_of_the_nominal_sizes(name, capsys):
    read_scenario(name)
    assert capsys.readouterr().out == ""


def test_what_follows_the_geometry_and_what_may_fail_are_a_line_each(tmp_path, capsys):
    path = tmp_path / "mine.yaml"
    path.write_text("geometry: {peg_radius: 0.02, hole_radius: 0.0201, hole_depth: 0.04, chamfer: 0.0002}")
    scenario = read_scenario(str(path), "exact")
    chosen, doubt = capsys.readouterr().out.splitlines()
    assert chosen.startswith("follows the geometry (SI units): contact.modulus ")
    assert "geometry.peg_length 0.075, " in chosen
    assert scenario.contact.engine == "exact"
    # 5 mm from the pivot at sqrt(2) * 4 deg: 0.49 mm; the lead-in is 0.2 mm, and the clearance 0.1 mm.
    assert doubt == (
        "this peg may not be inserted: its tip starts up to 0.49 mm off the axis, chamfer and clearance take 0.3 mm"
    )


SMALL = "its radius is {} mm; below 6 mm a third of the skills missed two to four of ten trials"


@pytest.mark.parametrize(
    ("sizes", "doubts"),
    [
        ("peg_radius: 0.0059, hole_radius: 0.00593, hole_depth: 0.02", [SMALL.format(5.9)]),
        ("peg_radius: 0.0061, hole_radius: 0.00613, hole_depth: 0.02", []),
        (
            "peg_radius: 0.002, hole_radius: 0.0022, hole_depth: 0.005",
            ["peg_radius (m) 0.002 was not tried, 0.003 to 0.03 were", SMALL.format(2)],
        ),
        ("peg_radius: 0.01, hole_radius: 0.010015", ["C/r 0.0015 was not tried, 0.002 to 0.2 were"]),
        ("peg_radius: 0.01, hole_radius: 0.0101, hole_depth: 0.06", ["hole_depth/r 6 was not tried, 0.5 to 5 were"]),
    ],
)
def test_a_small_peg_and_a_size_that_was_not_tried_are_said(sizes, doubts, tmp_path, capsys):
    path = tmp_path / "mine.yaml"
    path.write_text(f"geometry: {{{sizes}}}")
    read_scenario(str(path))
    assert capsys.readouterr().out.splitlines()[1:] == [f"this peg may not be inserted: {doubt}" for doubt in doubts]
