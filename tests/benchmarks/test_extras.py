"""A benchmark without its optional packages says in one line which extra to install."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.extras import EXTRAS, require_packages

ROOT = Path(__file__).resolve().parents[2]
COMMANDS = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in (ROOT / "benchmarks").rglob("*.py")
    if "    run(main)\n" in path.read_text()
)
WITHOUT_EXTRAS = {
    "clustering",
    "clustering_speed",
    "intention",
    "regression",
    "regression_intervals",
}  # in benchmarks.learners
WITHOUT_EXTRAS_AT_THE_TOP = {"benchmarks.forward_models", "benchmarks.rig_cost"}
WITH_PEERS_ONLY = {"benchmarks.recordings"}
OTHERS = {
    **{"benchmarks.rig.gym_cost": "gym,sim", "benchmarks.rig.reinforcement": "gym,rl,sim"},
    "benchmarks.rig.arena": "lerobot,sim",
}
WITH_PEERS = {"benchmarks.learners.contact_states", "benchmarks.physics.engines", "benchmarks.rig.mujoco"}

RUN_WITHOUT = """
import runpy, sys

blocked, module = set(sys.argv[1].split(",")), sys.argv[2]

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in blocked:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Blocked())
sys.argv = [module, "-h"]
runpy.run_module(module, run_name="__main__", alter_sys=True)
"""


def run_without(packages, module):
    """Runs ``python -m module -h`` in an interpreter without these packages."""
    command = [sys.executable, "-c", RUN_WITHOUT, ",".join(packages), module]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_all_benchmarks_are_found():
    assert set(COMMANDS) >= WITH_PEERS | WITH_PEERS_ONLY | {f"benchmarks.learners.{name}" for name in WITHOUT_EXTRAS}
    assert len(COMMANDS) >= 12


@pytest.mark.slow
@pytest.mark.parametrize("module", COMMANDS)
def test_a_benchmark_without_its_extras_names_them_in_one_line(module):
    done = run_without(EXTRAS, module)
    if module in WITHOUT_EXTRAS_AT_THE_TOP or module.removeprefix("benchmarks.learners.") in WITHOUT_EXTRAS:
        assert done.returncode == 0, done.stderr
        return
    names = "peers,sim" if module in WITH_PEERS else "peers" if module in WITH_PEERS_ONLY else "sim"
    names = OTHERS.get(module, names)
    assert done.returncode == 1
    assert done.stdout == ""
    assert re.fullmatch(r"error: this benchmark needs the extras? \[(.+)\]: pip install -e '\.\[\1\]'\n", done.stderr)
    assert f"[{names}]" in done.stderr


@pytest.mark.parametrize("module", sorted(WITH_PEERS | WITH_PEERS_ONLY))
def test_only_the_missing_extra_is_named(module):
    done = run_without(["hmmlearn", "mujoco", "ruptures"], module)
    assert done.returncode == 1
    assert done.stderr == "error: this benchmark needs the extra [peers]: pip install -e '.[peers]'\n"


def test_installed_packages_are_accepted():
    require_packages("pydrake", "yaml")
