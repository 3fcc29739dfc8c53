"""The messages of the commands about bad input: one line, and no file is written or removed."""

import json

import numpy as np
import pytest

from models.scenario import dump_scenario
from tests.crafted_files import rewrite, sealed_arrays
from tests.quick_scenario import REQUESTS, make_quick_scenario
from tests.scripts.commands import error_line, files, invoke

BAD_SCENARIOS = {
    "an unknown key": ("contact: {fricton: 0.2}", "fricton"),
    "facets too coarse": ("geometry: {facets: 20}", "geometry.facets"),
    "a word for a number": ("contact: {friction: much}", "friction"),
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
    ],
)
def test_an_option_that_replaces_a_value_is_checked_like_the_scenario(tmp_path, skill_file, option, message):
    line = error_line(invoke("rig", "--skill", skill_file, "--out", tmp_path / "rig", *option))
    assert line.endswith(f"command line: {message}")
    assert files(tmp_path) == []


def test_the_error_about_an_unknown_scenario_names_the_known_ones(tmp_path):
    line = error_line(invoke("record", "--scenario", "nominel", "--out", tmp_path / "out"))
    assert "nominel" in line
    assert "nominal" in line
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


@pytest.mark.slow
def test_a_habit_that_never_gives_the_requested_example_is_one_error(tmp_path):
    """A tenth of a second is too short to insert."""
    scenario = make_quick_scenario()
    scenario.recorder.time_limit = 0.1
    path = tmp_path / "hasty.yaml"
    path.write_text(dump_scenario(scenario))
    line = error_line(
        invoke(
            "record",
            *("--good", 1, "--bad", 0, "--jobs", 1, "--scenario", path, "--out", tmp_path / "out"),
        )
    )
    assert "no good example" in line
    assert files(tmp_path) == ["hasty.yaml"]


@pytest.mark.parametrize("fault", ["none", "truncated", "missing column"])
def test_training_on_bad_recordings_is_one_error_and_writes_no_skill(tmp_path, demonstration_folder, fault):
    recordings = tmp_path / "recordings"
    recordings.mkdir()
    if fault != "none":
        source = demonstration_folder / "000.parquet"
        (recordings / "000.parquet").write_bytes(source.read_bytes())
        bad = recordings / "001.parquet"
        if fault == "truncated":
            bad.write_bytes(source.read_bytes()[:-100])
        else:
            bad.write_bytes(source.read_bytes())
            rewrite(bad, "demonstration", lambda f: f.drop(columns="mz"))
    line = error_line(invoke("train", "--demonstrations", recordings, "--out", tmp_path / "skill.npz"))
    messages = {"none": "no demonstrations", "truncated": "001.parquet: not a complete Parquet file"}
    assert messages.get(fault, "001.parquet") in line
    if fault not in messages:
        assert "mz" in line
    assert not (tmp_path / "skill.npz").exists()


def test_training_without_an_insertion_is_one_error(tmp_path, demonstration_folder):
    (tmp_path / "shown").mkdir()
    slams = demonstration_folder / f"{len(REQUESTS) - 1:03d}.parquet"
    (tmp_path / "shown" / "000.parquet").write_bytes(slams.read_bytes())
    line = error_line(invoke("train", "--demonstrations", tmp_path / "shown", "--out", tmp_path / "skill.npz"))
    assert "none of the 1 demonstrations" in line
    assert files(tmp_path) == ["shown/000.parquet"]


@pytest.mark.parametrize("fault", ["missing", "truncated", "no digest", "another version"])
def test_running_with_a_bad_skill_is_one_error_and_writes_nothing(tmp_path, skill_file, fault):
    skill = tmp_path / "skill.npz"
    if fault == "truncated":
        skill.write_bytes(skill_file.read_bytes()[:500])
    elif fault == "no digest":
        with np.load(skill_file) as stored:
            np.savez(skill, **stored)
    elif fault == "another version":
        with np.load(skill_file) as stored:
            arrays = dict(stored)
        header = json.loads(arrays["header"].tobytes())
        header["skill_version"] += 1
        arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
        skill.write_bytes(sealed_arrays(arrays))
    line = error_line(invoke("rig", "--skill", skill, "--out", tmp_path / "rig", "--trials", 1))
    messages = {"missing": "no such skill file", "another version": "version", "no digest": "SHA-256"}
    assert messages.get(fault, "not a skill file") in line
    assert "skill.npz" in line
    assert set(files(tmp_path)) <= {"skill.npz"}


def test_a_tilt_too_large_to_enter_is_one_error_before_the_first_trial(tmp_path, skill_file):
    scenario = tmp_path / "quick.yaml"
    scenario.write_text(dump_scenario(make_quick_scenario()))
    line = error_line(
        invoke(
            "rig",
            *("--skill", skill_file, "--scenario", scenario, "--tilt-deg", 20, "--trials", 8, "--seed", 0),
            *("--out", tmp_path / "rig", "--jobs", 1),
        )
    )
    assert "tilt" in line
    assert files(tmp_path) == ["quick.yaml"]
