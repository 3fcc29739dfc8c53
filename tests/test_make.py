"""The README's two commands, in a folder whose path has a space."""

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A copy of the tracked files, with an environment that borrows the installed packages of this one."""
    folder = tmp_path_factory.mktemp("a folder") / "with a space"
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, listing.split("\0")):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    environment = folder / ".venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", environment], check=True)
    packages = next(environment.glob("lib/python*/site-packages"))
    (packages / "borrowed.pth").write_text(sysconfig.get_path("purelib") + "\n")
    (environment / "ready").touch()
    return folder


def make(checkout, *arguments):
    """Runs make as a person would, outside the suite's own environment variables."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST", "REQUIRE"))}
    return subprocess.run(
        ["make", f"PYTHON={sys.executable}", "VENV=.venv", *arguments],
        cwd=checkout, env=environment, capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip


def test_make_demo_runs_in_a_folder_with_a_space(checkout):
    done = make(checkout, "demo", "ARGS=--good 2 --bad 0 --trials 1 --jobs 1")
    assert done.returncode == 0, done.stdout + done.stderr
    assert (checkout / "out" / "rig" / "report.html").is_file()
    assert (checkout / "out" / "skill.npz").is_file()


def test_make_test_runs_in_a_folder_with_a_space(checkout):
    subprocess.run(["git", "init", "--quiet"], cwd=checkout, check=True)
    done = make(checkout, "test", "TESTS=tests/models/test_bore.py")
    assert done.returncode == 0, done.stdout + done.stderr
    assert " passed" in done.stdout or "[100%]" in done.stdout


def test_an_interpreter_that_is_missing_is_one_clear_line(checkout):
    done = subprocess.run(
        ["make", "PYTHON=python9.99", "demo"], cwd=checkout, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode != 0
    assert "python9.99 does not run here" in done.stderr


def test_system_packages_that_cannot_be_installed_are_named_in_one_line(tmp_path):
    done = subprocess.run(
        ["/bin/sh", ROOT / ".ci" / "system-packages"],
        env={"PATH": str(tmp_path)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0
    assert done.stdout.splitlines() == [
        "missing commands: chromium chromedriver dot (there is no apt-get); the tests that need them are skipped"
    ]
