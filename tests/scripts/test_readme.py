"""Every command of README's table runs once, small, but `twin` and `arm` (test_arm.py) and `demo` (test_make.py)."""

import re

import pytest

from tests.checkout import ROOT
from tests.scripts.commands import HAPTIC_SKILL, run_python

PARTS = ROOT / "models" / "parts"
COMMANDS = [
    "record --good 4 --bad 1 --jobs 1",
    "train",
    "rig --trials 2 --jobs 1",
    "replay out/rig/run_0000.parquet --no-open",
    "correct --practice 2 --rounds 1 --jobs 1",
    "practise --engine exact --rounds 1 --starts 2 --checks 2 --held-out 2 --jobs 1",
    f"part {PARTS}/d_shaft.step {PARTS}/d_shaft_hole.step",
    "sweep small.yaml --jobs 1",
    "scoreboard out/sweeps/small",
    "states recording.csv again.csv",
    "export lerobot out/demonstrations out/lerobot",
    "import lerobot out/lerobot out/again",
    "export mcap out/rig/run_0000.parquet",
]
ELSEWHERE = {"twin", "arm"}
RECORDING = """
import numpy as np
for name in ("recording", "again"):
    time, force = np.arange(300) / 100, np.repeat([[0, 0, 0], [5, 0, -5], [0, 0, -20]], 100, axis=0)
    rows = np.column_stack([time, force + np.random.default_rng(0).normal(size=force.shape)])
    np.savetxt(f"{name}.csv", rows, delimiter=",", header="time,fx,fy,fz", comments="")
"""


def test_every_command_of_the_table_is_tried():
    table = re.findall(r"^\| .*`.*\|$", (ROOT / "README.md").read_text(), flags=re.M)
    named = {name for row in table for name in re.findall(r"`haptic-skill (\w+)", row)}
    assert named <= {command.split()[0] for command in COMMANDS} | ELSEWHERE


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(3000)
def test_each_command_ends_well(tmp_path):
    assert run_python("-c", RECORDING, cwd=tmp_path).returncode == 0
    sweep = (ROOT / "benchmarks" / "sweeps" / "example.yaml").read_text()
    few = sweep.replace("good: 24, bad: 6", "good: 4, bad: 1").replace("number: 50", "number: 1")
    (tmp_path / "small.yaml").write_text(few)
    for command in COMMANDS:
        done = run_python(*HAPTIC_SKILL, *command.split(), cwd=tmp_path, timeout=1200)
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
