"""What several tests share: a quick scenario, real demonstrations in it, and a skill learnt from them."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import settings

from models.scenario import Scenario
from skill.data.demonstration import Demonstration, read_demonstrations, write_demonstration
from skill.manipulation_skill import ManipulationSkill
from systems.runs.demonstration_set import demonstrate
from tests.quick_scenario import SHOWN, make_quick_scenario

# The same examples in every run; `pytest --hypothesis-profile default` looks for new ones.
settings.register_profile("repeatable", derandomize=True)
settings.load_profile("repeatable")


@pytest.fixture
def quick_scenario() -> Scenario:
    """Not resolved."""
    return make_quick_scenario()


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Holds a lock between processes."""
    with path.open("w") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield


@pytest.fixture(scope="session")
def demonstration_folder(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """Real recordings, made once for all workers."""
    own = tmp_path_factory.getbasetemp()
    shared = own if worker_id == "master" else own.parent
    folder, done = shared / "demonstrations", shared / "demonstrations.done"
    with locked(shared / "demonstrations.lock"):
        if not done.exists():
            for number, request in enumerate(SHOWN):
                shown = demonstrate(make_quick_scenario(), request, seed=0)
                write_demonstration(shown, folder / f"{number:03d}.parquet")
            done.touch()
    return folder


@pytest.fixture(scope="session")
def demonstrations(demonstration_folder: Path) -> list[Demonstration]:
    """Five good ones and a bad one."""
    return read_demonstrations(demonstration_folder)


@pytest.fixture(scope="session")
def skill_file(demonstration_folder: Path) -> Path:
    """A skill learnt from the recordings."""
    path = demonstration_folder.parent / "skill.npz"
    with locked(demonstration_folder.parent / "skill.lock"):
        if not path.exists():
            ManipulationSkill().fit(read_demonstrations(demonstration_folder)).save(path)
    return path


@pytest.fixture(scope="session")
def skill(skill_file: Path) -> ManipulationSkill:
    """The same, loaded."""
    return ManipulationSkill.load(skill_file)
