import pytest

from models.scenario import load_scenario
from tests.models.cad.bodies import block, circle, peg, save
from tests.models.cad.test_part import PARTS
from tests.scripts.commands import error_line, invoke


def test_a_pair_of_step_files_becomes_a_scenario_and_a_picture(tmp_path):
    out = tmp_path / "new" / "shaft.yaml"
    result = invoke("part", PARTS / "d_shaft.step", PARTS / "d_shaft_hole.step", "--out", out)
    assert result.exit_code == 0, result.output
    assert "clearance from 0.50 to 20.00 mm below the mouth: 40.00 to 40.00 um" in result.stdout
    assert load_scenario(out).geometry.peg_radius == 0.0055
    assert out.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    again = invoke("part", PARTS / "d_shaft.step", PARTS / "d_shaft_hole.step", "--out", out)
    assert again.exit_code == 0, again.output


@pytest.mark.parametrize("name", ["mine.yaml", "mine.png"])
def test_what_another_program_wrote_is_not_replaced(tmp_path, name):
    (tmp_path / name).write_bytes(b"services: {}\n" if name == "mine.yaml" else b"\x89PNG\r\n\x1a\n")
    files = PARTS / "d_shaft.step", PARTS / "d_shaft_hole.step"
    message = error_line(invoke("part", *files, "--out", tmp_path / "mine.yaml"))
    assert "choose another --out" in message
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_parts_that_do_not_fit_are_refused_and_nothing_is_written(tmp_path):
    files = save(peg(circle(8.1)), tmp_path / "a.stl"), save(block(circle(8.05)), tmp_path / "b.stl")
    out = tmp_path / "part.yaml"
    assert "they interfere by 50.0 um" in error_line(invoke("part", *files, "--out", out))
    assert not out.exists()
