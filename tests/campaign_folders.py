"""The commands of the kill campaign, and what must hold in their folders after a kill and after a completion."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import yaml
from PIL import Image

from experiments.outputs.output_set import LIVE, NEW, READY, finish_replacement, read_index
from models.scenario import dump_scenario
from skill.data.demonstration import read_demonstration
from skill.data.rig_run import read_rig_run
from skill.manipulation_skill import ManipulationSkill
from tests.interfaces.live.live_session import QUICK
from tests.quick_scenario import make_quick_scenario

QUICK_DEMONSTRATIONS = {
    "geometry": {"hole_depth": 0.003, "peg_length": 0.02, "facets": 32, "hole_radius": 0.0102},
    "start": {"height": 2e-4, "tilt": [0.0, 0.0]},
    "recorder": {"rough_force": 500.0},
    "operator": {"insertion_speed": 0.06},
}
QUICK_LIVE = {**QUICK, "recorder": {"time_limit": 5.0, "rough_force": 500.0}}

Mark = tuple[int, bytes]
"""The time at which a file was written, and the digest of its content."""


class Lane:
    """A command that is killed and started again.

    Attributes:
        name: of the command.
        folder: that it writes into.
        changes: number of changes of the folder that the command makes, about.
    """

    name = ""
    changes = 0

    def __init__(self, base: Path) -> None:
        self.base = base
        self.folder = base / self.name
        self.round = 0
        self.known: dict[str, Mark] = {}  # the finished files, by name

    def command(self, jobs: int) -> list[object]:
        """The module and its arguments."""
        raise NotImplementedError

    def faults_after_kill(self) -> list[str]:
        """What is wrong in the folder after a kill."""
        raise NotImplementedError

    def faults_after_completion(self) -> list[str]:
        """What is wrong in the folder after a completion; the next command has another request."""
        raise NotImplementedError

    def hidden(self) -> list[str]:
        """A fault for each hidden or temporary file in the folder."""
        return [f"{path.name} stays" for path in sorted(self.folder.glob(".*"))]


class SetLane(Lane):
    """A command that fills a folder with the set of one request.

    Attributes:
        read: reads an item.
        old: marks of the last complete set, by name.
    """

    read: Callable[[Path], Any]

    def __init__(self, base: Path) -> None:
        super().__init__(base)
        self.old: dict[str, Mark] = {}

    def places(self) -> Iterator[Path]:
        """The folders that may hold files of a set."""
        yield from (place for place in (self.folder, self.folder / NEW, self.folder / READY) if place.is_dir())

    def faults_after_kill(self) -> list[str]:
        """What is wrong after a kill; finishes an interrupted replacement, as every command does."""
        faults = []
        for place in self.places():
            faults += self._faults_of_items(place)
        finish_replacement(self.folder)
        whole = marks(self.folder)
        new = {name: mark for place in self.places() for name, mark in marks(place).items()}
        index = read_index(self.folder)
        is_new = index is not None and (index.request or {}).get("seed") == self.round
        if self.old and not is_new and whole != self.old:
            faults.append("the old set is not whole")
        if is_new and self.old and index is not None and index.finished(self.folder) != index.items:
            faults.append("a part of the new set has replaced the old one")
        made = new if is_new or not self.old else marks(self.folder / NEW)
        lost = [name for name, mark in self.known.items() if made.get(name) != mark]
        if lost:
            faults.append(f"lost or made again: {lost}")
        # A command that was killed between its last file and its end is complete; --overwrite then makes all anew.
        is_complete = is_new and index is not None and index.is_complete(self.folder)
        self.known = {} if is_complete and self.old else made
        return faults

    def faults_after_completion(self) -> list[str]:
        faults = self._faults_of_items(self.folder) + self.hidden()
        now = marks(self.folder)
        again = [name for name, mark in self.known.items() if now.get(name) != mark]
        if again:
            faults.append(f"made again: {again}")
        index = read_index(self.folder)
        if index is None or not index.is_complete(self.folder) or (index.request or {}).get("seed") != self.round:
            faults.append("the set is not complete")
        elif not {path.name for path in self.folder.iterdir()} <= {*index.names, "index.json"}:
            faults.append("a file is not in the index")
        self.old, self.known = now, {}
        self.round += 1
        return faults

    def _faults_of_items(self, place: Path) -> list[str]:
        faults = []
        index = read_index(place)
        for path in sorted(place.glob("*.parquet")):
            try:
                self.read(path)
            except ValueError as error:
                faults.append(f"not readable: {error}")
            if place.name != READY and (index is None or path.name not in index.items) and path.name not in self.old:
                faults.append(f"{path} is not in the index")
        return faults


class RecordLane(SetLane):
    """Records six demonstrations, with another seed each time."""

    name = "record"
    changes = 30
    read = staticmethod(read_demonstration)

    def command(self, jobs: int) -> list[object]:
        scenario = self.base / "record.yaml"
        scenario.write_text(yaml.safe_dump(QUICK_DEMONSTRATIONS))
        return [
            *("haptic_skill", "record", "--out", self.folder, "--scenario", scenario, "--jobs", jobs),
            *("--good", 6, "--bad", 0, "--seed", self.round, *(["--overwrite"] if self.old else [])),
        ]


class RigLane(SetLane):
    """Runs five short trials, with other numbers each time."""

    name = "rig"
    changes = 35
    read = staticmethod(read_rig_run)

    def command(self, jobs: int) -> list[object]:
        return [
            *("haptic_skill", "rig", "--out", self.folder, "--scenario", short_trials(self.base), "--jobs", jobs),
            *("--skill", self.base / "skill.npz", "--trials", 5, "--seed", self.round),
            *(["--overwrite"] if self.old else []),
        ]

    def _faults_of_items(self, place: Path) -> list[str]:
        """The results agree with the runs; a kill between the two leaves one run that is not in the results yet."""
        faults = super()._faults_of_items(place)
        if place.name == READY or faults:
            return faults
        runs = [self.read(path).result for path in sorted(place.glob("*.parquet"))]
        path = place / "results.json"
        if not path.exists() and (place / READY).exists():
            return faults  # an interrupted replacement: the results move last
        results = json.loads(path.read_text()) if path.exists() else []
        if [r for r in runs if r in results] != results or len(runs) - len(results) > 1:
            faults.append(f"{path}: {len(results)} results for {len(runs)} runs, or others")
        return faults

    def faults_after_completion(self) -> list[str]:
        results = json.loads((self.folder / "results.json").read_text())
        missing = [] if len(results) == 5 else [f"{len(results)} results of 5"]
        missing += [] if (self.folder / "report.html").stat().st_size > 1000 else ["no report"]
        return missing + super().faults_after_completion()


class TrainLane(Lane):
    """Trains a skill, with another seed each time."""

    name = "train"
    changes = 5

    def command(self, jobs: int) -> list[object]:
        out = self.folder / "skill.npz"
        return [*("haptic_skill", "train", "--demonstrations", self.base / "shown", "--out", out, "--seed", self.round)]

    def faults_after_kill(self) -> list[str]:
        """The skill is the old or the new one, and whole."""
        path = self.folder / "skill.npz"
        if not path.exists():
            return ["the old skill is lost"] if self.round else []
        ManipulationSkill.load(path)
        return []

    def faults_after_completion(self) -> list[str]:
        """The skill is the new one."""
        seed = ManipulationSkill.load(self.folder / "skill.npz").random_state
        faults = [] if seed == self.round else [f"the skill has seed {seed}"]
        self.round += 1
        return faults + self.hidden()


class PractiseLane(Lane):
    """Practises one round, with another seed each time."""

    name = "practise"
    changes = 40

    def command(self, jobs: int) -> list[object]:
        return [
            *("haptic_skill", "practise", "--out", self.folder / "p.npz", "--scenario", short_trials(self.base)),
            *("--skill", self.base / "skill.npz", "--jobs", jobs, "--seed", self.round),
            *("--rounds", 1, "--starts", 1, "--checks", 1, "--held-out", 2),
        ]

    def faults_after_kill(self) -> list[str]:
        """The old files are whole; the trials of the new practice are there, readable and in the index."""
        work = self.folder / "p.npz.unfinished"
        index = read_index(work)
        faults = []
        for path in sorted(work.glob("*.parquet")):
            read_rig_run(path)
            if index is None or path.name not in index.items:
                faults.append(f"{path.name} is not in the index")
        now = marks(work)
        is_complete = not work.exists() and bool(self.known)
        if any(now.get(name) != mark for name, mark in self.known.items()) and not is_complete:
            faults.append("a trial is lost or was made again")
        self.known = now
        return faults + (self._faults_of_outputs() if self.round or is_complete else [])

    def faults_after_completion(self) -> list[str]:
        """The three files are there, and nothing else."""
        faults = self._faults_of_outputs()
        found = {path.name for path in self.folder.iterdir()}
        if found != {"p.npz", "p.json", "p.png"}:
            faults.append(f"found {sorted(found)}")
        if json.loads((self.folder / "p.json").read_text())["practice"]["seed"] != self.round:
            faults.append("the trials are those of another practice")
        self.round += 1
        self.known = {}
        return faults

    def _faults_of_outputs(self) -> list[str]:
        ManipulationSkill.load(self.folder / "p.npz")
        json.loads((self.folder / "p.json").read_text())
        Image.open(self.folder / "p.png").load()
        return []


class LiveLane(Lane):
    """Keeps three live recordings, beside the earlier ones."""

    name = "live"
    changes = 12

    def command(self, jobs: int) -> list[object]:
        scenario = self.base / "live.yaml"
        scenario.write_text(yaml.safe_dump(QUICK_LIVE))
        return ["tests.scripted_live", self.folder, scenario, "--number", 3]

    def faults_after_kill(self) -> list[str]:
        """All recordings are there and readable."""
        for path in self.folder.glob("*.parquet"):
            read_demonstration(path)
        now = marks(self.folder)
        lost = [name for name, mark in self.known.items() if now.get(name) != mark]
        self.known = now
        return [f"lost: {lost}"] if lost else []

    def faults_after_completion(self) -> list[str]:
        """All recordings are there, and three more; the index says that they are live."""
        before = len(self.known)
        faults = self.faults_after_kill() + self.hidden()
        if len(self.known) != before + 3:
            faults.append(f"{len(self.known)} recordings, expected {before} and 3 more")
        index = read_index(self.folder)
        if index is None or index.kind is not LIVE:
            faults.append("the index does not say that the recordings are live")
        return faults


def make_lanes(base: Path) -> list[Lane]:
    """The five commands, in folders below ``base``."""
    return [kind(base) for kind in (RecordLane, TrainLane, RigLane, PractiseLane, LiveLane)]


def short_trials(base: Path) -> Path:
    """The path of a scenario whose trials last a tenth of a second."""
    path = base / "trials.yaml"
    if not path.exists():
        scenario = make_quick_scenario()
        scenario.geometry.hole_depth, scenario.geometry.peg_length = 0.025, 0.060  # those of the recordings
        scenario.start.height, scenario.start.tilt_range = 1e-4, 0.012  # in contact at once
        scenario.trial.time_limit = 0.1
        path.write_text(dump_scenario(scenario))
    return path


def marks(folder: Path) -> dict[str, Mark]:
    """The marks of the recordings and runs in a folder, by name."""
    return {
        path.name: (path.stat().st_mtime_ns, hashlib.sha256(path.read_bytes()).digest())
        for path in folder.glob("*.parquet")
    }
