"""The data sets as LeRobot itself sees them: loaded by lerobot, checked by lerobot-doctor."""

import json
import os
import subprocess
import sys

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.interfaces.exports.datasets import exported, write_demonstrations, write_runs

pytest.importorskip("lerobot", reason="needs the extra [lerobot]")

pytestmark = [pytest.mark.nightly, pytest.mark.slow]


@pytest.fixture(scope="module", params=[write_demonstrations, write_runs])
def dataset(request, tmp_path_factory):
    return exported(tmp_path_factory.mktemp("lerobot"), request.param)[1]


def test_the_doctor_finds_no_error(dataset):
    code = "import sys; from lerobot_doctor.cli import main; sys.argv = ['lerobot-doctor', *sys.argv[1:]]; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, "check", str(dataset), "--json"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads(done.stdout)
    assert report["summary"]["FAIL"] == 0, report


def test_lerobot_loads_the_frames_and_windows_of_actions(dataset, monkeypatch, tmp_path):
    monkeypatch.setitem(os.environ, "HF_HUB_OFFLINE", "1")
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    windows = {"action": [0.0, 0.02, 0.04]}
    found = LeRobotDataset("local/exported", root=dataset, delta_timestamps=windows)
    frames = pq.read_table(dataset / "data").to_pydict()
    assert (len(found), found.num_episodes, found.fps) == (len(frames["index"]), 3, 50)
    for k in (0, 57, len(found) - 1):
        item = found[k]
        for key in ("observation.state", "observation.environment_state", "observation.wrench"):
            np.testing.assert_array_equal(item[key].numpy(), np.float32(frames[key][k]))
        for key in ("contact_label", "outcome", "next.done", "next.success", "episode_index", "frame_index"):
            assert item[key].item() == frames[key][k]
        np.testing.assert_array_equal(item["action"][0].numpy(), np.float32(frames["action"][k]))
    assert found[len(found) - 1]["action_is_pad"].tolist() == [False, True, True]
    np.testing.assert_allclose(found.meta.stats["action"]["max"], np.max(frames["action"], axis=0), rtol=1e-6)
    assert found.meta.episodes[1]["haptic_skill/outcome"] == "inserted"
