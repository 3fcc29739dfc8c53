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
