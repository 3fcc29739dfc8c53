"""A wheel with a shipped skill installs into a clean environment, and its commands run there."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from models.scenario import dump_scenario
from tests.checkout import ROOT, copy_checkout

pytestmark = [pytest.mark.slow, pytest.mark.nightly]


def run(*command, cwd):
    done = subprocess.run([str(part) for part in command], cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_wheel_installs_and_inserts_with_the_skill_that_it_ships(skill_file, quick_scenario, tmp_path):
    sources, outside = tmp_path / "sources", tmp_path / "outside"
    outside.mkdir()
    copy_checkout(sources, without=("tests",))
    shutil.copyfile(skill_file, sources / "skill" / "default_skill.npz")
    run(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", tmp_path, sources, cwd=outside)
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    assert {"skill/default_skill.npz", "models/rig.sdf", "interfaces/reports/replay.js", "haptic_skill.py"} <= set(
        names
    )
    panel = [path.relative_to(ROOT).as_posix() for path in (ROOT / "interfaces" / "live" / "panel").iterdir()]
    assert {Path(name).suffix for name in panel} == {".html", ".css", ".js"}
    assert set(panel) <= set(names)
    assert not [name for name in names if name.startswith(("tests", "benchmarks", "docs"))]

    run(sys.executable, "-m", "venv", tmp_path / "clean", cwd=outside)
    python = tmp_path / "clean" / "bin" / "python"
    constraints = ROOT / "constraints" / f"3.{sys.version_info.minor}.txt"
    limited = ["--constraint", constraints] if constraints.is_file() else []
    run(python, "-m", "pip", "install", "--quiet", f"{wheel}[sim]", *limited, cwd=outside)
    (outside / "quick.yaml").write_text(dump_scenario(quick_scenario))
    command = tmp_path / "clean" / "bin" / "haptic-skill"
    assert "rig" in run(command, "--help", cwd=outside)
    printed = run(command, "rig", "--trials", "1", "--scenario", "quick.yaml", "--jobs", "1", cwd=outside)
    assert "the skill that comes with the program acts" in " ".join(printed.split())
    assert (outside / "out" / "rig" / "report.html").is_file()
