"""Shared fixtures (quick scenario, demonstrations, skill), and the skipping of tests whose programs are missing.

Tests with the marker ``browser`` open a page, and those with the marker ``graphviz`` draw a diagram. Where the programs
that they need are missing, they are skipped, or fail if REQUIRE_BROWSER=1 is in the environment.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from filelock import FileLock
from hypothesis import settings

from experiments.demonstration_set import demonstrate
from models.scenario import Scenario
from skill.data.demonstration import Demonstration, read_demonstrations, write_demonstration
from skill.manipulation_skill import ManipulationSkill
from tests import browser
from tests.quick_scenario import REQUESTS, make_quick_scenario

# The same examples in every run, however busy the machine is; `make test-nightly` draws new ones.
settings.register_profile("daily", derandomize=True, deadline=None, max_examples=25)
settings.register_profile("nightly", deadline=None, max_examples=200)
settings.load_profile("daily")

PROGRAMS = {  # marker: (alternative names of a program, Debian package) of every program that its tests need
    "browser": [
        (("chromium", "chromium-browser", "google-chrome"), "chromium"),
        (("chromedriver",), "chromium-driver"),
    ],
    "graphviz": [(("dot",), "graphviz")],
}


def missing_programs(marker: str) -> str:
    """Names the programs that the tests with ``marker`` need and that are not on the PATH, and how to get them."""
    missing = [(names[0], package) for names, package in PROGRAMS[marker] if not any(map(shutil.which, names))]
    if not missing:
        return ""
    programs, packages = zip(*missing, strict=True)
    return f"{' and '.join(programs)} not found (Debian: apt-get install {' '.join(packages)})"


@pytest.hookimpl(tryfirst=True)  # before the fixtures
def pytest_runtest_setup(item: pytest.Item) -> None:
    for marker in PROGRAMS:
        if item.get_closest_marker(marker) and (missing := missing_programs(marker)):
            if os.environ.get("REQUIRE_BROWSER") == "1":
                pytest.fail(f"REQUIRE_BROWSER=1, but {missing}", pytrace=False)
            pytest.skip(f"{marker} test: {missing}")


def pytest_unconfigure() -> None:
    """Closes the browser that the tests shared."""
    browser.shared.close()


@pytest.fixture
def quick_scenario() -> Scenario:
    """The quick scenario, with its ranges (not resolved)."""
    return make_quick_scenario()


@pytest.fixture(scope="session")
def demonstration_folder(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """A folder of recordings in the quick scenario, made once for all workers."""
    base = tmp_path_factory.getbasetemp()
    shared = base if worker_id == "master" else base.parent
    folder, done = shared / "demonstrations", shared / "demonstrations.done"
    with FileLock(shared / "demonstrations.lock"):
        if not done.exists():
            for number, request in enumerate(REQUESTS):
                demonstration = demonstrate(make_quick_scenario(), request, seed=0)
                write_demonstration(demonstration, folder / f"{number:03d}.parquet")
            done.touch()
    return folder


@pytest.fixture(scope="session")
def demonstrations(demonstration_folder: Path) -> list[Demonstration]:
    """Five good demonstrations and a bad one."""
    return read_demonstrations(demonstration_folder)


@pytest.fixture(scope="session")
def skill_file(demonstration_folder: Path) -> Path:
    """The file of a skill that was trained on these demonstrations."""
    path = demonstration_folder.parent / "skill.npz"
    with FileLock(demonstration_folder.parent / "skill.lock"):
        if not path.exists():
            ManipulationSkill().fit(read_demonstrations(demonstration_folder)).save(path)
    return path


@pytest.fixture(scope="session")
def skill(skill_file: Path) -> ManipulationSkill:
    """This skill, loaded."""
    return ManipulationSkill.load(skill_file)
