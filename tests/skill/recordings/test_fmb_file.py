"""Trajectories of FMB, synthetic ones of its documented schema: refused, with a command that converts them."""

import re
import shlex
import subprocess
import sys

import numpy as np
import pytest

from skill.recordings.reading import read_recordings


class Program:
    """Writes a file when its pickle is opened."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (open, (str(self.path), "w"))


@pytest.mark.parametrize("name", ["trajectory_1_0.npy", "a (2)'s.npy"])
@pytest.mark.parametrize("primitives", [np.array, np.bytes_, list], ids=["str", "bytes", "list"])
def test_the_command_of_the_refusal_converts_a_trajectory(tmp_path, name, primitives):
    rng = np.random.default_rng(0)
    force, torque = rng.normal(size=(30, 3)).astype(np.float32), rng.normal(size=(30, 3)).astype(np.float32)
    phases = ["grasp"] * 12 + ["insert"] * 18
    trajectory = {
        "obs/side_1": np.zeros((30, 4, 4, 3), dtype=np.uint8),
        "obs/tcp_pose": np.ones((30, 7)),
        "obs/tcp_force": force,
        "obs/tcp_torque": torque,
        "primitive": np.array(phases, dtype=bytes) if primitives is np.bytes_ else primitives(phases),
        "object_info": {"length": "L"},
    }
    path = tmp_path / name
    np.save(path, trajectory, allow_pickle=True)
    with pytest.raises(ValueError, match=re.escape(f"{path}: an .npy file has no names")) as refused:
        read_recordings(path)
    command = str(refused.value).partition("run: python ")[2]
    subprocess.run([sys.executable, *shlex.split(command)], check=True)
    [recording] = read_recordings(path.with_suffix(".npz"))
    np.testing.assert_array_equal(recording.values, np.hstack([force, torque]))
    assert recording.channels == ("fx", "fy", "fz", "mx", "my", "mz")
    assert recording.rate == pytest.approx(10.0)
    assert list(recording.phases) == phases


def test_a_pickle_is_not_opened(tmp_path):
    np.save(tmp_path / "a.npy", np.array(Program(tmp_path / "run"), dtype=object), allow_pickle=True)
    with pytest.raises(ValueError, match="which is not opened here"):
        read_recordings(tmp_path / "a.npy")
    assert not (tmp_path / "run").exists()
    np.load(tmp_path / "a.npy", allow_pickle=True)  # the pickle does what it says
    assert (tmp_path / "run").exists()
