"""The make targets, in a folder whose path has a space."""

import os
import subprocess
import sys
import sysconfig

import pytest

from tests.checkout import ROOT, copy_checkout


@pytest.fixture
def checkout(tmp_path):
    """A copy of the tracked files, with an environment that borrows the installed packages of this one."""
    folder = copy_checkout(tmp_path / "with a space")
    environment = folder / ".venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", environment], check=True)
    packages = next(environment.glob("lib/python*/site-packages"))
    (packages / "borrowed.pth").write_text(sysconfig.get_path("purelib") + "\n")
    (environment / "ready").touch()
    return folder


def make(folder, *arguments):
    """Runs make as a person would, outside the suite's own environment variables."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST", "REQUIRE"))}
    return subprocess.run(
        ["make", *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.nightly
@pytest.mark.slow
def test_demo_and_test_run_in_a_folder_with_a_space(checkout):
    own = (f"PYTHON={sys.executable}", "VENV=.venv")
    done = make(checkout, *own, "demo", "ARGS=--good 2 --bad 0 --trials 1 --jobs 1")
    assert done.returncode == 0, done.stdout + done.stderr
    assert (checkout / "out" / "rig" / "report.html").is_file()
    assert (checkout / "out" / "skill.npz").is_file()
    done = make(checkout, *own, "test", "TESTS=tests/models/test_meshes.py")
    assert done.returncode == 0, done.stdout + done.stderr
    assert " passed in " in done.stdout.splitlines()[-1]


def test_an_interpreter_that_is_missing_is_one_clear_line():
    done = make(ROOT, "PYTHON=python9.99", "demo")
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
