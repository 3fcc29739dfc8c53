"""Shared fixtures (quick scenario, demonstrations, skill), and the skipping of tests whose programs are missing.

The tests that open a page get the marker ``browser``, and tests that draw a diagram have the marker ``graphviz``. Where
the programs that they need are missing, these tests are skipped and the terminal summary says so in one line. With
REQUIRE_BROWSER=1 in the environment they fail instead. Tests with the marker ``lerobot`` are skipped where its packages
are not installed.
"""

from __future__ import annotations

import dis
import fcntl
import inspect
import os
import shutil
import types
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

from experiments.demonstration_set import demonstrate
from models.scenario import Scenario
from skill.data.demonstration import Demonstration, read_demonstrations, write_demonstration
from skill.manipulation_skill import ManipulationSkill
from tests.browser import open_page
from tests.quick_scenario import REQUESTS, make_quick_scenario

# The same examples in every run; `pytest --hypothesis-profile default` draws new ones.
settings.register_profile("repeatable", derandomize=True)
settings.load_profile("repeatable")

PROGRAMS = {  # marker: (alternative names of a program, Debian package) of every program that its tests need
    "browser": [
        (("chromium", "chromium-browser", "google-chrome"), "chromium"),
        (("chromedriver",), "chromium-driver"),
    ],
    "graphviz": [(("dot",), "graphviz")],
}
PACKAGES = {"lerobot": ("lerobot", "lerobot_doctor")}  # marker, which is an extra too: Python packages

# ------------------------------------------------------- missing programs


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "graphviz: runs the program dot; skipped like the browser tests")


@pytest.hookimpl(tryfirst=True)  # before pytest selects by marker
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Marks the tests that open a page."""
    for item in items:
        if isinstance(item, pytest.Function):
            fixtures = [vars(item.module).get(name) for name in item.fixturenames]
            if any(reaches(used, open_page, set()) for used in (item.function, *fixtures)):
                item.add_marker("browser")


def reaches(used: Any, target: Any, visited: set[int]) -> bool:
    """Whether ``used`` is ``target``, or a function or class of the tests whose code leads to it."""
    used = inspect.unwrap(used)
    if used is inspect.unwrap(target):
        return True
    if id(used) in visited or not str(getattr(used, "__module__", "")).startswith("test"):
        return False
    visited.add(id(used))
    if inspect.isclass(used):
        return any(reaches(member, target, visited) for member in vars(used).values() if callable(member))
    if not inspect.isfunction(used):
        return False
    named = [used.__globals__[name] for name in names_in(used.__code__) if name in used.__globals__]
    return any(reaches(thing, target, visited) for thing in named)


def names_in(code: types.CodeType) -> set[str]:
    """The global names that a piece of code and its inner functions use."""
    names = {step.argval for step in dis.get_instructions(code) if step.opname == "LOAD_GLOBAL"}
    return names.union(*(names_in(inner) for inner in code.co_consts if isinstance(inner, types.CodeType)))


def missing_programs(marker: str) -> str:
    """Names what the tests with ``marker`` need: programs that are not on the PATH, or packages; and how to get it."""
    absent = [name for name in PACKAGES.get(marker, ()) if find_spec(name) is None]
    if marker in PACKAGES:
        return f"{' and '.join(absent)} not installed (pip install -e '.[{marker}]')" if absent else ""
    missing = [(names[0], package) for names, package in PROGRAMS[marker] if not any(map(shutil.which, names))]
    if not missing:
        return ""
    programs, packages = zip(*missing, strict=True)
    return f"{' and '.join(programs)} not found (Debian: apt-get install {' '.join(packages)})"


@pytest.hookimpl(tryfirst=True)  # before the fixtures
def pytest_runtest_setup(item: pytest.Item) -> None:
    for marker in (*PROGRAMS, *PACKAGES):
        if item.get_closest_marker(marker) and (missing := missing_programs(marker)):
            if marker in PROGRAMS and os.environ.get("REQUIRE_BROWSER") == "1":
                pytest.fail(f"REQUIRE_BROWSER=1, but {missing}", pytrace=False)
            pytest.skip(f"{marker} test: {missing}")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    reasons = [report.longrepr[2] for report in terminalreporter.stats.get("skipped", []) if report.longrepr]
    counts = Counter({m: sum(f"{m} test:" in reason for reason in reasons) for m in (*PROGRAMS, *PACKAGES)})
    skipped = [f"{n} {m} tests: {missing_programs(m)}" for m, n in counts.items() if n]
    if skipped:
        terminalreporter.write_line(f"skipped {'; '.join(skipped)}")


# --------------------------------------------------------------- fixtures


@pytest.fixture
def quick_scenario() -> Scenario:
    """The quick scenario, with its ranges (not resolved)."""
    return make_quick_scenario()


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Holds a lock between processes."""
    with path.open("w") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield


@pytest.fixture(scope="session")
def demonstration_folder(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """A folder of recordings in the quick scenario, made once for all workers."""
    base = tmp_path_factory.getbasetemp()
    shared = base if worker_id == "master" else base.parent
    folder, done = shared / "demonstrations", shared / "demonstrations.done"
    with locked(shared / "demonstrations.lock"):
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
    with locked(demonstration_folder.parent / "skill.lock"):
        if not path.exists():
            ManipulationSkill().fit(read_demonstrations(demonstration_folder)).save(path)
    return path


@pytest.fixture(scope="session")
def skill(skill_file: Path) -> ManipulationSkill:
    """This skill, loaded."""
    return ManipulationSkill.load(skill_file)
