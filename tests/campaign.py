"""The kill campaign: is anything lost when a command is killed at any moment?

    python -m tests.campaign [--number 1000] [--seed 0] [--jobs 2] [--json FILE]

Five commands (record, train, rig, practise, and a live session whose buttons a script presses) work in folders of
their own. Each is started, killed with SIGKILL and started again, in turn; when it completes, it gets another request
that replaces the first. The moments are drawn from the seed: 15 % in the first three seconds (start-up), 35 % within
1.5 s of the first change of the folder (work), 50 % within 3 ms of a change of the folder (writing).

After each kill: every finished file is readable and in its index, what was there before is there or wholly replaced,
the results agree with the runs, and no worker is left after ten seconds. After each completion: nothing finished was
made again, nothing is missing, and no lock or temporary file stays.
"""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import psutil
import typer

from interfaces.terminal import progress, say, write_json
from skill.data.demonstration import write_demonstration
from skill.manipulation_skill import ManipulationSkill
from tests.campaign_folders import Lane, make_lanes
from tests.trajectories import make_demonstration

ROOT = Path(__file__).resolve().parent.parent
START, WORK, WRITE = "start-up", "work", "writing"
SHARES = {START: 0.15, WORK: 0.35, WRITE: 0.5}
MAX_START, MAX_WORK, MAX_WRITE = 3.0, 1.5, 3e-3  # s
MAX_KILLS_IN_A_ROW = 12  # then the command may complete
ORPHAN_TIME = 10.0  # s that a worker may outlive its parent
TIMEOUT = 240.0  # s that a command may take


class Campaign:
    """The kills of one worker of the campaign, in folders of its own."""

    def __init__(self, folder: Path, seed: int) -> None:
        self._seed = seed
        self.lanes = make_lanes(folder)
        self.counts: Counter[str] = Counter()
        self.faults: list[str] = []
        self._orphans: list[tuple[float, str, psutil.Process]] = []
        self._in_a_row: Counter[str] = Counter()

    def kill(self, number: int) -> None:
        """Performs one kill: starts the command of the lane until it was killed before it completed."""
        lane = self.lanes[number % len(self.lanes)]
        rng = random.Random(f"{self._seed}:{number}")
        while True:
            killed = self._attempt(lane, rng, kill=self._in_a_row[lane.name] < MAX_KILLS_IN_A_ROW)
            self._look_for_orphans()
            if killed:
                self._in_a_row[lane.name] += 1
                return

    def finish(self) -> None:
        """Lets every command complete once more, and waits for the last workers to end."""
        for lane in self.lanes:
            self._attempt(lane, random.Random(0), kill=False)
        while self._orphans:
            self._look_for_orphans()
            time.sleep(0.2)

    def _attempt(self, lane: Lane, rng: random.Random, *, kill: bool) -> bool:
        """Runs the command once; returns whether it was killed."""
        moment = rng.choices(list(SHARES), weights=list(SHARES.values()))[0]
        jobs = 2 if rng.random() < 0.3 else 1
        command = [sys.executable, "-m", *map(str, lane.command(jobs))]
        with tempfile.TemporaryFile("w+") as output:
            process = subprocess.Popen(command, cwd=ROOT, stdout=output, stderr=output, start_new_session=True)
            try:
                workers = wait(process, lane, moment, rng) if kill else None
                if workers is None:
                    process.wait(TIMEOUT)
            finally:
                process.kill()
                code = process.wait()
            output.seek(0)
            text = output.read()
        if code == -signal.SIGKILL:
            end = time.monotonic() + ORPHAN_TIME
            self._orphans += [(end, lane.name, worker) for worker in workers or ()]
            self.counts[f"{lane.name}: killed"] += 1
            self.counts[f"killed during {moment}"] += 1
            self.counts["workers at the time of a kill"] += len(workers or ())
            self._note(lane, found(lane.faults_after_kill), f"killed during {moment}")
            return True
        self._in_a_row[lane.name] = 0
        self.counts[f"{lane.name}: completed"] += 1
        self.counts[f"{lane.name}: items kept over kills"] += len(lane.known)
        if code != 0:
            self._note(lane, [f"exit code {code}: {text[-500:]}"], "restarted")
        self._note(lane, found(lane.faults_after_completion), "completed")
        return False

    def _note(self, lane: Lane, faults: list[str], when: str) -> None:
        self.faults += [f"{lane.name}, {when}: {fault}" for fault in faults]

    def _look_for_orphans(self) -> None:
        alive = [orphan for orphan in self._orphans if is_alive(orphan[2])]
        now = time.monotonic()
        self.faults += [f"{name}: process {worker.pid} is still there" for end, name, worker in alive if end < now]
        self._orphans = [orphan for orphan in alive if orphan[0] >= now]


def found(check: Callable[[], list[str]]) -> list[str]:
    """The faults that a check finds; a file that it cannot read is one."""
    try:
        return check()
    except (OSError, ValueError) as error:
        return [f"{type(error).__name__}: {error}"]


def wait(process: subprocess.Popen[bytes], lane: Lane, moment: str, rng: random.Random) -> list[psutil.Process] | None:
    """Waits for the drawn moment and kills the process; returns its children, or None if it ended before."""
    started = time.monotonic()
    before = state(lane.folder)
    if moment == START:
        delay, changes = rng.uniform(0.0, MAX_START), 0
    elif moment == WORK:
        delay, changes = rng.uniform(0.0, MAX_WORK), 1
    else:
        delay, changes = rng.uniform(0.0, MAX_WRITE), rng.randint(1, lane.changes)
    while changes and process.poll() is None and time.monotonic() - started < TIMEOUT:
        time.sleep(2e-4)
        now = state(lane.folder)
        if now != before:
            before, changes = now, changes - 1
    end = time.monotonic() + delay
    while process.poll() is None and time.monotonic() < end:
        time.sleep(min(2e-4, max(0.0, end - time.monotonic())))
    if process.poll() is not None:
        return None
    try:
        workers = psutil.Process(process.pid).children()
    except psutil.NoSuchProcess:
        return None
    process.kill()
    return workers


def state(folder: Path) -> list[tuple[str, int, int]]:
    """The names, sizes and times of the files in a folder and its folders."""
    found = []
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                if entry.is_dir():
                    found += state(Path(entry.path))
                status = entry.stat()
                found.append((entry.path, status.st_size, status.st_mtime_ns))
    except FileNotFoundError:
        pass  # removed while it was read
    return sorted(found)


def is_alive(process: psutil.Process) -> bool:
    """Whether a process, and not a later one of the same number, has not ended."""
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def prepare(folder: Path) -> None:
    """Makes what the lanes read: recordings, a skill trained on them, and short scenarios."""
    shown = [make_demonstration(tilt=0.03 + 0.004 * k, direction=0.9 + k) for k in range(4)]
    for k, demonstration in enumerate(shown):
        write_demonstration(demonstration, folder / "shown" / f"{k:03d}.parquet")
    ManipulationSkill().fit(shown).save(folder / "skill.npz")


def run(number: int, seed: int, jobs: int) -> tuple[Counter[str], list[str]]:
    """Performs a campaign; returns its counts and the faults found."""
    with tempfile.TemporaryDirectory() as name:
        first = Path(name) / "0"
        prepare(first)
        for k in range(1, jobs):
            shutil.copytree(first, Path(name) / str(k))
        campaigns = [Campaign(Path(name) / str(k), seed) for k in range(jobs)]
        lanes = len(campaigns[0].lanes)

        with progress("kills", number) as advance:

            def work(k: int) -> None:
                for n in range(number):
                    if n // lanes % jobs == k:
                        campaigns[k].kill(n)
                        advance(f"{sum(len(c.faults) for c in campaigns)} faults")
                campaigns[k].finish()

            with ThreadPoolExecutor(jobs) as pool:
                list(pool.map(work, range(jobs)))
    counts: Counter[str] = Counter()
    for campaign in campaigns:
        counts += campaign.counts
    return counts, [fault for campaign in campaigns for fault in campaign.faults]


def main(number: int = 1000, seed: int = 0, jobs: int = 2, json: Path | None = None) -> None:
    """Kills commands and prints the counts and the faults; exit code 1 if there is a fault."""
    started = time.monotonic()
    counts, faults = run(number, seed, jobs)
    for fault in faults:
        say(f"FAULT {fault}")
    for what, count in sorted(counts.items()):
        say(f"{what:40s} {count:6d}")
    say(f"{number} kills, {len(faults)} faults, {(time.monotonic() - started) / 60:.0f} min")
    if json is not None:
        write_json(json, {"seed": seed, "counts": dict(counts), "faults": faults})
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    typer.run(main)
