"""Files of REASSEMBLE, synthetic ones with the schema of its README: one recording for each action."""

import re

import numpy as np
import pytest

h5py = pytest.importorskip("h5py", reason="needs the extra [recordings]")

from skill.recordings.reading import read_recordings  # noqa: E402

START = 1736427437.25  # s since 1970, as in the files
RATE = 1000.0
ACTIONS = {  # number: begin and end, s; text; skills
    "0": (0.0, 0.2, "No action.", []),
    "1": (0.2, 1.0, "Pick peg 4.", [(0.2, 0.5, "Approach"), (0.5, 0.9, "Grasp"), (0.9, 1.0, "Lift")]),
    "2": (1.1, 1.6, "Insert peg 4.", [(1.1, 1.3, "Approach"), (1.4, 1.6, "Push")]),
    "10": (1.6, 2.0, "Remove peg 4.", [(1.6, 2.0, "Pull")]),
}


def write(path, actions=ACTIONS, *, column=False, text="vlen", n=2000):
    """Writes a file; its wrench is 1 to 6 times the number of the sample."""
    time = START + np.arange(n) / RATE
    wrench = np.outer(np.arange(n), np.arange(1.0, 7.0))
    with h5py.File(path, "w") as file:
        file["hama1"] = np.void(b"\x00\x00\x00\x18ftypmp42")  # a video
        file["hand_audio"] = np.frombuffer(b"ID3", dtype=np.uint8).astype(np.int64)
        file["events"] = np.zeros((7, 3), dtype=np.int64)
        arrays = {"measured_force": wrench[:, :3], "measured_torque": wrench[:, 3:], "pose": np.ones((n // 2, 7))}
        for name, values in arrays.items():
            file[f"robot_state/{name}"] = values
            stamps = time if len(values) == n else time[::2]
            file[f"timestamps/{name}"] = stamps[:, None] if column else stamps
        for number, (begin, end, what, skills) in actions.items():
            group = file.create_group(f"segments_info/{number}")
            _segment(group, begin, end, what, text)
            for k, skill in enumerate(skills):
                _segment(group.create_group(f"low_level/{k}"), *skill, text)
    return path


def _segment(group, begin, end, what, text):
    group["start"], group["end"], group["success"] = START + begin, START + end, True
    group["text"] = what if text == "vlen" else np.bytes_(what)


@pytest.mark.parametrize("form", [{}, {"column": True}, {"text": "fixed"}])
def test_each_action_is_a_recording_and_its_skills_are_phases(tmp_path, form):
    path = write(tmp_path / "2025-01-09-13-57-17.h5", **form)
    found = read_recordings(path)
    assert [r.name for r in found] == [f"2025-01-09-13-57-17.h5, trial {k}" for k in (0, 1, 2, 10)]
    assert {r.channels for r in found} == {("fx", "fy", "fz", "mx", "my", "mz")}
    for recording, (begin, end, *_) in zip(found, ACTIONS.values(), strict=True):
        first, last = round(begin * RATE), round(end * RATE)
        np.testing.assert_allclose(recording.time, START + np.arange(first, last) / RATE, rtol=0, atol=1e-6)
        np.testing.assert_array_equal(recording.values, np.outer(np.arange(first, last), np.arange(1.0, 7.0)))
    assert set(found[0].phases) == {"No action."}
    assert list(found[1].phases) == ["Approach"] * 300 + ["Grasp"] * 400 + ["Lift"] * 100
    assert list(found[2].phases) == ["Approach"] * 200 + ["Insert peg 4."] * 100 + ["Push"] * 200


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: f.pop("robot_state"), "no array 'robot_state/measured_force'"),
        (lambda f: f.pop("timestamps/measured_force"), "no array 'timestamps/measured_force'"),
        (lambda f: _replace(f, "robot_state/measured_torque", np.zeros((9, 3))), "[2000, 2000, 9] times, forces and"),
        (lambda f: _replace(f, "robot_state/measured_force", np.zeros((2000, 7))), "shape (2000, 7), expected numbers"),
        (lambda f: _replace(f, "robot_state/measured_force", np.zeros(2000, "S1")), "has type |S1"),
        (lambda f: _replace(f, "robot_state/measured_force", 1.0), "shape (), expected numbers (n, 3)"),
        (lambda f: f["segments_info/1"].pop("end"), "'end'"),
        (lambda f: f.move("segments_info/1", "segments_info/one"), "invalid literal for int()"),
    ],
)
def test_a_file_of_another_schema_is_refused(tmp_path, change, message):
    path = write(tmp_path / "a.h5")
    with h5py.File(path, "a") as file:
        change(file)
    with pytest.raises(ValueError, match=re.escape(f"{path}: not a complete HDF5 file of REASSEMBLE (")) as caught:
        read_recordings(path)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def _replace(file, name, values):
    del file[name]
    file[name] = values


def test_without_actions_there_are_no_recordings(tmp_path):
    for actions in ({}, {"0": (5.0, 6.0, "Pick peg 4.", [])}):  # the second has no sample
        with pytest.raises(ValueError, match=r"a\.h5: no samples"):
            read_recordings(write(tmp_path / "a.h5", actions))


@pytest.mark.parametrize("size", [0, 7, 4000])
def test_a_damaged_file_is_refused(tmp_path, size):
    path = write(tmp_path / "a.h5")
    path.write_bytes(path.read_bytes()[:size])
    with pytest.raises(ValueError, match=r"a\.h5: not a complete HDF5 file of REASSEMBLE"):
        read_recordings(path)


def test_a_value_that_is_missing_names_its_sample(tmp_path):
    path = write(tmp_path / "a.h5")
    with h5py.File(path, "a") as file:
        file["robot_state/measured_force"][1250, 1] = np.nan  # after a gap between actions
    with pytest.raises(ValueError, match=r"a\.h5: column 'fy' has no value in sample 1250 "):
        read_recordings(path)
