"""What several tests share: a quick scenario, real demonstrations in it, and a skill learnt from them."""

from __future__ import annotations

import fcntl
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import settings

ROOT = Path(__file__).resolve().parent.parent
# This folder comes first on the path, and tests/skill must not hide skill.
sys.path.insert(0, str(ROOT))

from models.scenario import Scenario  # noqa: E402
from skill.demonstration import Demonstration, read_demonstrations, write_demonstration  # noqa: E402
from skill.manipulation_skill import ManipulationSkill  # noqa: E402
from systems.demonstration_set import Request, demonstrate  # noqa: E402

# The same examples in every run; `pytest --hypothesis-profile default` looks for new ones.
settings.register_profile("repeatable", derandomize=True)
settings.load_profile("repeatable")

SHOWN = [*(Request(number, "expert", True) for number in range(5)), Request(5, "slams", False)]


def make_quick_scenario() -> Scenario:
    """A shallow hole, reached at once: an insertion takes half a second."""
    scenario = Scenario()
    scenario.geometry.hole_depth = 0.012
    scenario.geometry.peg_length = 0.040
    scenario.start.height = 0.001
    # Five demonstrations cannot show as much as thirty: the gimbal's pivot and the friction vary less.
    scenario.rig.pivot_range = scenario.rig.demonstrated_pivot_range = 0.001
    scenario.contact.friction_spread = 0.1
    scenario.recorder.time_limit = 3.0
    scenario.trial.time_limit = 3.0
    return scenario


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
