"""The messages of the commands about bad input: one line, and no file is written or removed."""

import pytest

from tests.scripts.commands import error_line, files, invoke

BAD_SCENARIOS = {
    "an unknown key": ("contact: {fricton: 0.2}", "fricton"),
    "facets too coarse": ("geometry: {facets: 20}", "geometry.facets"),
}


@pytest.mark.parametrize(("text", "expected"), BAD_SCENARIOS.values(), ids=BAD_SCENARIOS)
def test_a_bad_scenario_stops_a_recording_before_it_starts(tmp_path, text, expected):
    scenario = tmp_path / "mine.yaml"
    scenario.write_text(text)
    line = error_line(invoke("record", "--scenario", scenario, "--out", tmp_path / "out", "--jobs", 1))
    assert expected in line
    assert "mine.yaml" in line
    assert files(tmp_path) == ["mine.yaml"]


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (("--tilt-deg", "1e20"), "start.tilt_range is 1.7453292519943296e+18, expected between 0 and 1.5708"),
        (("--friction", "1e13"), "contact.friction is 10000000000000.0, expected between 0 and 1e+12"),
        *(
            (
                ("--wrench", wrong),
                f"controller.wrench is '{wrong}', expected one of ('true', 'zero', 'frozen', 'shuffled') or"
                " scaled:FACTOR, such as scaled:0.5",
            )
            for wrong in ("none", "scaled", "scaled:", "scaled:half", "scaled:nan", "0.5", "")
        ),
    ],
)
def test_an_option_that_replaces_a_value_is_checked_like_the_scenario(tmp_path, skill_file, option, message):
    line = error_line(invoke("rig", "--skill", skill_file, "--out", tmp_path / "rig", *option))
    assert line.endswith(f"command line: {message}")
    assert files(tmp_path) == []


def test_a_trial_that_cannot_begin_is_named_before_there_is_a_progress_bar(tmp_path, skill_file):
    result = invoke("rig", "--skill", skill_file, "--out", tmp_path / "rig", "--tilt-deg", 80)
    assert "expected below 5.72 deg, the largest tilt at which this peg enters this hole" in error_line(result)
    assert result.stdout == ""
    assert files(tmp_path) == []


def test_overwriting_with_a_bad_scenario_removes_nothing(tmp_path, demonstration_folder):
    kept = tmp_path / "mine.parquet"
    kept.write_bytes((demonstration_folder / "000.parquet").read_bytes())
    error_line(invoke("record", "--out", tmp_path, "--overwrite", "--scenario", "nominel"))
    unstable = tmp_path / "unstable.yaml"
    unstable.write_text("coupling: {force_scale: 1.0}")
    assert "not stable" in error_line(
        invoke("record", "--out", tmp_path, "--overwrite", "--scenario", unstable, "--jobs", 1)
    )
    assert files(tmp_path) == ["mine.parquet", "unstable.yaml"]


def test_no_or_too_many_demonstrations_are_an_error(tmp_path):
    for good in (0, 10_001):
        line = error_line(invoke("record", "--good", good, "--bad", 0, "--out", tmp_path / "out"))
        assert f"{good} demonstrations requested; expected --good plus --bad to be 1 to 10,000" in line
    assert files(tmp_path) == []


@pytest.mark.parametrize(("size", "message"), [(None, "no such skill file"), (500, "not a skill file")])
def test_running_with_a_bad_skill_is_one_error_and_writes_nothing(tmp_path, skill_file, size, message):
    skill = tmp_path / "skill.npz"
    if size:
        skill.write_bytes(skill_file.read_bytes()[:size])
    line = error_line(invoke("rig", "--skill", skill, "--out", tmp_path / "rig", "--trials", 1))
    assert message in line
    assert "skill.npz" in line
    assert set(files(tmp_path)) <= {"skill.npz"}
