"""The kill campaign: is anything lost when a command is killed at any moment?

    python -m tests.campaign [--number 200] [--seed 0] [--jobs 2] [--json FILE]

Four commands (record, rig, practise, and a live session whose buttons a script presses) work in folders of their own.
Each is started, killed with SIGKILL and started again, in turn; when it completes, it gets another request that
replaces the first. The moments are drawn from the seed: 15 % in the first three seconds (start-up), 35 % within 1.5 s
of a change of the folder (work), 50 % within 3 ms of a change of the folder (writing).

After each kill: every finished file is readable and in its index, what was there before is there or wholly replaced,
the results agree with the runs, and no worker is left after ten seconds. After each completion: nothing finished was
made again, nothing is missing, and no lock or temporary file stays.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import ClassVar

import psutil
import typer
import yaml
from PIL import Image

from experiments.outputs.output_set import LIVE, NEW, finish_replacement, read_index
from interfaces.terminal import progress, say, write_json
from models.scenario import dump_scenario
from skill.data.demonstration import read_demonstration
from skill.data.rig_run import read_rig_run
from skill.manipulation_skill import ManipulationSkill
from tests.checkout import ROOT
from tests.interfaces.live.live_session import QUICK
from tests.quick_scenario import make_quick_scenario
from tests.trajectories import make_demonstration

START, WORK, WRITE = MOMENTS = ("start-up", "work", "writing")
SHARES = (0.15, 0.35, 0.5)
MAX_DELAY = {START: 3.0, WORK: 1.5, WRITE: 3e-3}  # s
MAX_KILLS_IN_A_ROW = 12  # then the command may complete
ORPHAN_TIME = 10.0  # s that a worker may outlive its parent
TIMEOUT = 240.0  # s that a command may take

QUICK_DEMONSTRATIONS = {
    "geometry": {"hole_depth": 0.003, "peg_length": 0.02, "facets": 32, "hole_radius": 0.0102},
    "start": {"height": 2e-4, "tilt": [0.0, 0.0]},
    "recorder": {"rough_force": 500.0},
    "operator": {"insertion_speed": 0.06},
}
QUICK_LIVE = {**QUICK, "recorder": {"time_limit": 5.0, "rough_force": 500.0}}

Marks = dict[str, tuple[int, bytes]]
"""When the recordings and runs in a folder were written, and digests of their contents, by name."""


def marks(folder: Path) -> Marks:
    """The marks of the recordings and runs in a folder."""
    return {
        path.name: (path.stat().st_mtime_ns, hashlib.sha256(path.read_bytes()).digest())
        for path in folder.glob("*.parquet")
    }


# ----------------------------------------------------------------- commands


class Lane:
    """A command that is killed and started again.

    Attributes:
        name: of the command.
        changes: of its folder that the command makes, about.
        folder: that it writes into.
        round: number of its request.
        known: marks of what is finished of this request.
    """

    name: ClassVar[str]
    changes: ClassVar[int]

    def __init__(self, base: Path) -> None:
        self.base, self.folder = base, base / self.name
        self.round, self.known = 0, Marks()

    def command(self, jobs: int) -> list[object]:
        """The module and its arguments."""
        raise NotImplementedError

    def faults(self, *, completed: bool) -> list[str]:
        """What is wrong in the folder after a kill or a completion.

        Raises:
            ValueError: if a file is not valid.
            OSError: if a file cannot be read.
        """
        raise NotImplementedError

    def keep(self, made: Marks) -> list[str]:
        """Remembers what is finished; a fault if something of it was lost or made again."""
        lost = [name for name, mark in self.known.items() if made.get(name) != mark]
        self.known = made
        return [f"lost or made again: {lost}"] if lost else []


class RecordLane(Lane):
    """Records six demonstrations, with another seed each time, which replace the last ones.

    Attributes:
        old: marks of the last complete set.
    """

    name, changes = "record", 30

    def __init__(self, base: Path) -> None:
        super().__init__(base)
        self.old = Marks()

    def command(self, jobs: int) -> list[object]:
        options = ["--scenario", self.base / "record.yaml", "--good", 6, "--bad", 0]
        return [*self.request(), *options, "--jobs", jobs]

    def request(self) -> list[object]:
        """The beginning of the command."""
        replaced = ["--overwrite"] if self.old else []
        return ["haptic_skill", self.name, "--out", self.folder, "--seed", self.round, *replaced]

    def faults(self, *, completed: bool) -> list[str]:
        """What is wrong; finishes an interrupted replacement, as every command does."""
        finish_replacement(self.folder)
        faults = [fault for place in (self.folder, self.folder / NEW) for fault in self.faults_of_items(place)]
        index, whole = read_index(self.folder), marks(self.folder)
        is_new = index is not None and index.request["seed"] == self.round
        if not is_new and whole != self.old:
            faults.append("the old set is not whole")
        if index is not None and is_new and self.old and index.finished(self.folder) != index.items:
            faults.append("a part of the new set has replaced the old one")
        faults += self.keep(whole if is_new else marks(self.folder / NEW))
        is_complete = index is not None and is_new and index.is_complete(self.folder)
        if completed:
            listed = {"index.json", *(index.names if index is not None else ())}
            foreign = sorted({path.name for path in self.folder.iterdir()} - listed)
            faults += [] if is_complete and not foreign else [f"complete: {is_complete}, not in the index: {foreign}"]
        if is_complete:
            self.round, self.old, self.known = self.round + 1, whole, Marks()
        return faults

    def faults_of_items(self, place: Path) -> list[str]:
        """What is wrong with the items in one folder."""
        index = read_index(place)
        items = sorted(place.glob("*.parquet"))
        for path in items if index is not None else ():
            index.kind.read(path)
        return [f"{path} is not in the index" for path in items if index is None or path.name not in index.items]


class RigLane(RecordLane):
    """Runs five short trials, with other numbers each time."""

    name, changes = "rig", 35

    def command(self, jobs: int) -> list[object]:
        options = ["--scenario", self.base / "trials.yaml", "--skill", self.base / "skill.npz", "--trials", 5]
        return [*self.request(), *options, "--jobs", jobs]

    def faults_of_items(self, place: Path) -> list[str]:
        """The results agree with the runs; a kill between the two leaves one run that is not in the results yet."""
        faults = super().faults_of_items(place)
        runs = [read_rig_run(path).result for path in sorted(place.glob("*.parquet"))]
        path = place / "results.json"
        results = json.loads(path.read_text()) if path.exists() else []
        if [run for run in runs if run in results] != results or len(runs) - len(results) > 1:
            faults.append(f"{path}: {len(results)} results for {len(runs)} runs, or others")
        return faults


class PractiseLane(Lane):
    """Practises one round, with another seed each time."""

    name, changes = "practise", 40

    def command(self, jobs: int) -> list[object]:
        return [
            *("haptic_skill", "practise", "--out", self.folder / "p.npz", "--scenario", self.base / "trials.yaml"),
            *("--skill", self.base / "skill.npz", "--jobs", jobs, "--seed", self.round),
            *("--rounds", 1, "--starts", 1, "--checks", 1, "--held-out", 2),
        ]

    def faults(self, *, completed: bool) -> list[str]:
        """The old files are whole; the trials of the new practice are there, readable and in the index."""
        work = self.folder / "p.npz.unfinished"
        is_finished = bool(self.known) and not work.exists()
        if is_finished:  # killed after its last change: started again, it practises anew
            self.known = Marks()
        faults = self.keep(marks(work))
        index = read_index(work)
        faults += [f"{n} is not in the index" for n in marks(work) if index is None or n not in index.items]
        for path in work.glob("*.parquet"):
            read_rig_run(path)
        if self.round or is_finished or completed:
            ManipulationSkill.load(self.folder / "p.npz")
            Image.open(self.folder / "p.png").load()
            practice = json.loads((self.folder / "p.json").read_text())["practice"]
        if completed:
            found = {path.name for path in self.folder.iterdir()}
            if found != {"p.npz", "p.json", "p.png"} or practice["seed"] != self.round:
                faults.append(f"found {sorted(found)} of {practice}")
            self.round, self.known = self.round + 1, Marks()
        return faults


class LiveLane(Lane):
    """Keeps three live recordings, beside the earlier ones."""

    name, changes = "live", 12

    def command(self, jobs: int) -> list[object]:
        return ["tests.scripted_live", self.folder, self.base / "live.yaml", "--number", 3]

    def faults(self, *, completed: bool) -> list[str]:
        """All recordings are there and readable; after a completion three more, in a folder that is marked as live."""
        for path in self.folder.glob("*.parquet"):
            read_demonstration(path)
        before = len(self.known)
        faults = self.keep(marks(self.folder))
        if completed:
            index = read_index(self.folder)
            hidden = [path.name for path in self.folder.glob(".*")]
            if len(self.known) != before + 3 or index is None or index.kind is not LIVE or hidden:
                faults.append(f"{len(self.known)} recordings, expected {before} and 3; index {index}; hidden {hidden}")
        return faults


LANES = (RecordLane, RigLane, PractiseLane, LiveLane)


def prepare(base: Path) -> None:
    """Makes what the commands read: a skill, and scenarios that take a tenth of a second."""
    shown = [make_demonstration(tilt=0.03 + 0.004 * k, direction=0.9 + k) for k in range(4)]
    ManipulationSkill().fit(shown).save(base / "skill.npz")
    scenario = make_quick_scenario()
    scenario.geometry.hole_depth, scenario.geometry.peg_length = 0.025, 0.060  # those of the recordings
    scenario.start.height, scenario.start.tilt_range = 1e-4, 0.012  # in contact at once
    scenario.trial.time_limit = 0.1
    (base / "trials.yaml").write_text(dump_scenario(scenario))
    (base / "record.yaml").write_text(yaml.safe_dump(QUICK_DEMONSTRATIONS))
    (base / "live.yaml").write_text(yaml.safe_dump(QUICK_LIVE))


# -------------------------------------------------------------------- kills


class Campaign:
    """The kills of one command."""

    def __init__(self, lane: Lane, seed: int) -> None:
        self._lane, self._rng = lane, Random(f"{seed}:{lane.name}")
        self.counts: Counter[str] = Counter()
        self.faults: list[str] = []
        self.workers: list[psutil.Process] = []

    def run(self, number: int, advance: Callable[[str], None]) -> None:
        """Starts the command until it was killed ``number`` times before it completed; then it may complete."""
        kills, in_a_row = 0, 0
        while kills < number:
            if self._attempt(kill=in_a_row < MAX_KILLS_IN_A_ROW):
                kills, in_a_row = kills + 1, in_a_row + 1
                advance(f"{len(self.faults)} faults of {self._lane.name}")
            else:
                in_a_row = 0
        self._attempt(kill=False)

    def _attempt(self, *, kill: bool) -> bool:
        """Runs the command once; returns whether it was killed."""
        lane = self._lane
        moment = self._rng.choices(MOMENTS, weights=SHARES)[0]
        command = [sys.executable, "-m", *map(str, lane.command(self._rng.choice([1, 1, 2])))]
        with tempfile.TemporaryFile("w+") as output:
            process = subprocess.Popen(command, cwd=ROOT, stdout=output, stderr=output, start_new_session=True)
            try:
                if kill:
                    self.workers += kill_at(moment, process, lane, self._rng)
                code = process.wait(TIMEOUT)
            finally:
                process.kill()
            output.seek(0)
            text = output.read()
        completed = code != -signal.SIGKILL
        self.counts[f"{lane.name}, {'completed' if completed else f'killed during {moment}'}"] += 1
        faults = [f"exit code {code}: {text[-500:]}"] if completed and code != 0 else []
        try:
            faults += lane.faults(completed=completed)
        except (OSError, ValueError) as error:
            faults.append(f"{type(error).__name__}: {error}")
        self.faults += [f"{lane.name}, {'completed' if completed else moment}: {fault}" for fault in faults]
        return not completed


def kill_at(moment: str, process: subprocess.Popen[bytes], lane: Lane, rng: Random) -> list[psutil.Process]:
    """Waits for a moment and kills the process; returns its children."""
    changes = {START: 0, WORK: 1, WRITE: rng.randint(1, lane.changes)}[moment]
    delay, end = rng.uniform(0.0, MAX_DELAY[moment]), time.monotonic() + TIMEOUT
    before = state(lane.folder)
    while changes and process.poll() is None and time.monotonic() < end:
        time.sleep(2e-4)
        now = state(lane.folder)
        before, changes = now, changes - (now != before)
    with suppress(subprocess.TimeoutExpired, psutil.NoSuchProcess):
        process.wait(delay)
    with suppress(psutil.NoSuchProcess):
        workers = psutil.Process(process.pid).children()
        process.kill()
        return workers
    return []


def state(folder: Path) -> list[tuple[str, int]]:
    """When names of files changed in a folder and its folders."""
    with suppress(FileNotFoundError):  # removed while it was read
        return [(path.name, path.stat().st_mtime_ns) for path in (folder, *folder.glob("*/"))]
    return []


def is_alive(process: psutil.Process) -> bool:
    """Whether a process, and not a later one of the same number, has not ended."""
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def run(number: int, seed: int, jobs: int) -> tuple[Counter[str], list[str]]:
    """Performs a campaign of about ``number`` kills; returns its counts and the faults found."""
    with tempfile.TemporaryDirectory() as name, progress("kills", number) as advance:
        prepare(Path(name))
        campaigns = [Campaign(lane(Path(name)), seed) for lane in LANES]
        with ThreadPoolExecutor(jobs) as pool:
            list(pool.map(lambda campaign: campaign.run(number // len(LANES), advance), campaigns))
        time.sleep(ORPHAN_TIME)
        left = filter(is_alive, itertools.chain(*(campaign.workers for campaign in campaigns)))
        faults = [f"{worker} is still there" for worker in left]
    counts = sum((campaign.counts for campaign in campaigns), Counter())
    return counts, faults + [fault for campaign in campaigns for fault in campaign.faults]


def main(number: int = 200, seed: int = 0, jobs: int = 2, json: Path | None = None) -> None:
    """Kills commands and prints the counts and the faults; exit code 1 if there is a fault."""
    started = time.monotonic()
    counts, faults = run(number, seed, jobs)
    for what, count in sorted(counts.items()):
        say(f"{what:40s} {count:6d}")
    for fault in faults:
        say(f"FAULT {fault}")
    say(f"{number} kills, {len(faults)} faults, {(time.monotonic() - started) / 60:.0f} min")
    if json is not None:
        write_json(json, {"seed": seed, "counts": dict(counts), "faults": faults})
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    typer.run(main)
