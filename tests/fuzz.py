"""Fuzz test of all files that the programs read: is any change of a file accepted without a word?

    python -m tests.fuzz [--number 10000] [--seed 0] [--first 0] [--jobs 2] [--json FILE]

Each mutation changes one file (a recording, a run, a skill, a scenario, or a recording of another sensor) and loads it
in a process of its own. Its outcome is

* refused: one `ValueError` in one line that names the file,
* identical: the file loads and holds what it held before,
* another file: a file without a digest (a scenario, another sensor), or one whose digest was made anew, loads and is
  sound; nothing in it can say that it was changed,

or a defect:

* silent change: a file with a digest loads and holds something else,
* unsound: a skill loads, but does not act by finite numbers,
* message: a refusal without the name of the file, or on several lines,
* exception: an exception other than ValueError,
* memory, time: loading takes over 1 GB or 10 s,
* crash: the process ends.

Mutation k of a seed is always the same: ``--seed 0 --first k --number 1`` repeats it. The exit code is 1 if there is a
defect.
"""

from __future__ import annotations

import json
import multiprocessing
import resource
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from random import Random

import numpy as np
import pandas as pd
import typer
from pebble import ProcessExpired, ProcessPool

from interfaces.terminal import progress, say, write_json
from models.scenario import dump_scenario, load_scenario
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.data.demonstration import read_demonstration, write_demonstration
from skill.data.rig_run import read_rig_run, write_rig_run
from skill.manipulation_skill import ManipulationSkill
from skill.recordings.reading import read_recordings
from skill.regression.locally_weighted_regression import LWRegressor
from skill.skill_file import ARRAY_PARTS, FEATURE_PARTS, SKILL_PARAMETERS
from tests import fuzz_mutations as mutations
from tests.skill.recordings.wrench_messages import cdr, write_db3, write_mcap
from tests.trajectories import make_demonstration, make_rig_run

MAX_MEMORY = 1e9  # bytes, more than before
MAX_TIME = 10.0  # s
PATIENCE = 30.0  # s after which a process is ended
GOOD = ("refused", "identical", "another file")

ARCHIVE = (
    *(mutations.archive_header, mutations.archive_value, mutations.archive_array),
    *(mutations.archive_member, mutations.archive_shape, mutations.forged),
)
PARQUET = (mutations.parquet_header, mutations.parquet_value, mutations.parquet_column)
FORGERIES: dict[str, tuple[Callable[[bytes, Random], bytes], ...]] = {
    "recording.parquet": PARQUET,
    "run.parquet": PARQUET,
    "skill.npz": ARCHIVE,
    "scenario.yaml": (mutations.scenario_value, mutations.scenario_lines),
    **dict.fromkeys(("sensor.csv", "sensor.parquet", "sensor.npz", "sensor.mcap", "sensor.db3"), ()),
}
"""The name of a file of each kind, and its mutations that make a digest anew or need none."""

KINDS = tuple(FORGERIES)
SEALED = ("recording.parquet", "run.parquet", "skill.npz")

BOMBS = 400
"""One in so many mutations of a skill is a bomb, which takes a second to make."""


@dataclass(frozen=True)
class Trial:
    """One mutation and its outcome."""

    number: int
    kind: str
    mutation: str
    outcome: str
    detail: str = ""


def mutation_of(kind: str, rng: Random) -> Callable[[bytes, Random], bytes]:
    """Draws a mutation; half of them change bytes only."""
    if kind == "skill.npz" and rng.randrange(BOMBS) == 0:
        return mutations.archive_bomb
    return rng.choice(FORGERIES[kind] if FORGERIES[kind] and rng.random() < 0.5 else mutations.BYTES)


# ---------------------------------------------------------------- originals


def write_originals(folder: Path) -> None:
    """Writes one file of each kind."""
    shown = [make_demonstration(tilt=0.04 + 0.005 * k, direction=k) for k in range(4)]
    write_demonstration(shown[0], folder / "recording.parquet")
    write_rig_run(make_rig_run(), folder / "run.parquet")
    states = CompetitiveAgglomeration(m_init=4, n_init=1, reg_covar=0.05, random_state=0)
    ManipulationSkill(states=states, regressor=LWRegressor(bandwidth=0.7)).fit(shown).save(folder / "skill.npz")
    scenario = Path(__file__).parents[1] / "models" / "scenarios" / "one_of_everything.yaml"
    (folder / "scenario.yaml").write_bytes(scenario.read_bytes())
    rng = np.random.default_rng(0)
    wrench = rng.normal(size=(50, 6)).round(3)
    table = pd.DataFrame(wrench, columns=["fx", "fy", "fz", "mx", "my", "mz"])
    table.insert(0, "time", 0.01 * np.arange(50))
    table.to_csv(folder / "sensor.csv", index=False)
    table.to_parquet(folder / "sensor.parquet", index=False)
    np.savez(folder / "sensor.npz", time=table["time"], wrench=wrench, trial=np.repeat([1, 2], 25))
    stamps = [10_000_000 * k for k in range(50)]
    messages = [("/wrench", t, cdr(sec=0, nanosec=t, wrench=row)) for t, row in zip(stamps, wrench, strict=True)]
    write_mcap(folder / "sensor.mcap", messages)
    write_db3(folder / "sensor.db3", messages)


# ------------------------------------------------------------------- loading


def load(kind: str, path: Path) -> tuple[bytes, bool]:
    """Loads a file; returns all that it holds, and whether it is sound: made of finite numbers, or acting by them."""
    if kind == "recording.parquet":
        shown = read_demonstration(path)
        header = json.dumps([shown.good, shown.reason, shown.metadata])
        return header.encode() + shown.samples.to_numpy().tobytes(), True
    if kind == "run.parquet":
        run = read_rig_run(path)
        return json.dumps([run.result, run.metadata]).encode() + run.samples.to_numpy().tobytes(), True
    if kind == "scenario.yaml":
        return dump_scenario(load_scenario(path)).encode(), True
    if kind == "skill.npz":
        return load_skill(path)
    found = read_recordings(path)
    content = b"".join(json.dumps(r.channels).encode() + r.time.tobytes() + r.values.tobytes() for r in found)
    return content, all(bool(np.isfinite(r.values).all() and (np.diff(r.time) > 0).all()) for r in found)


def load_skill(path: Path) -> tuple[bytes, bool]:
    """Loads a skill; it is sound if it acts by finite numbers."""
    skill = ManipulationSkill.load(path)
    header = [{name: getattr(skill, name) for name in SKILL_PARAMETERS}, skill.period_, skill.metadata_, skill.names_]
    header += [[type(part).__name__, part.get_params()] for part in (getattr(skill, f"{n}_") for n in FEATURE_PARTS)]
    content = json.dumps([*header, skill.min_log_support_]).encode() + skill.sources_.tobytes()
    for part in ARRAY_PARTS:
        for name, array in sorted(getattr(skill, f"{part}_").to_arrays().items()):
            content += name.encode() + array.dtype.str.encode() + array.tobytes()
    action = skill.act([5.0, 3.0, 2.0, 0.01, 0.02, 0.0, -0.008])
    return content, bool(np.isfinite([*action.turn, action.feed, action.support]).all())


# ------------------------------------------------------------------- judging


def judge(kind: str, original: bytes, held: bytes, changed: bytes, path: Path, *, sealed: bool) -> tuple[str, str]:
    """Loads a changed file.

    Args:
        kind: one of ``KINDS``.
        original: the bytes of the file before the change.
        held: what it held, from `load`.
        changed: its bytes after the change.
        path: where to write it.
        sealed: whether the file carries a digest that was not made anew.

    Returns:
        The outcome and its detail.
    """
    path.write_bytes(changed)
    start = time.monotonic()
    before = start_of_memory()
    try:
        found, sound = load(kind, path)
        outcome, detail = ("identical", "") if found == held else ("another file", "")
        if outcome != "identical" and sealed and changed != original:
            outcome = "silent change"
        elif not sound:
            outcome = "unsound"
    except ValueError as error:
        named = str(path) in str(error) and "\n" not in str(error)
        outcome, detail = "refused" if named else "message", str(error)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        outcome, detail = "exception", f"{type(error).__name__}: {error}"
    memory, seconds = peak_memory() - before, time.monotonic() - start
    if memory > MAX_MEMORY:
        return "memory", f"{memory / 1e9:.1f} GB; {outcome} {detail}"
    if seconds > MAX_TIME:
        return "time", f"{seconds:.0f} s; {outcome} {detail}"
    return outcome, detail


def start_of_memory() -> float:
    """Sets the peak memory of this process back, and returns it, bytes."""
    with suppress(OSError):  # the peak then stays, and counts once
        Path("/proc/self/clear_refs").write_text("5")
    return peak_memory()


def peak_memory() -> float:
    """The largest memory of this process, bytes."""
    try:
        text = Path("/proc/self/status").read_text()
        return 1024.0 * int(text.split("VmHWM:")[1].split()[0])
    except (OSError, IndexError):
        return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


@cache
def originals(folder: Path) -> dict[str, tuple[bytes, bytes]]:
    """The bytes and the contents of each original."""
    return {kind: ((folder / kind).read_bytes(), load(kind, folder / kind)[0]) for kind in KINDS}


def attempt(number: int, seed: int, folder: Path) -> Trial:
    """Makes and judges one mutation."""
    rng = Random(f"{seed} {number}")
    kind = KINDS[number % len(KINDS)]
    mutation = mutation_of(kind, rng)
    original, held = originals(folder)[kind]
    sealed = mutation in mutations.BYTES and kind in SEALED
    work = folder / multiprocessing.current_process().name
    work.mkdir(exist_ok=True)
    outcome, detail = judge(kind, original, held, mutation(original, rng), work / kind, sealed=sealed)
    return Trial(number, kind, mutation.__name__, outcome, detail[:500])


# ----------------------------------------------------------------- processes


def prepare(folder: Path) -> None:
    """Loads the originals in a new process, and limits its memory."""
    warnings.simplefilter("ignore")
    originals(folder)
    spare = 4 * int(MAX_MEMORY)  # protects the machine; `judge` finds what takes a quarter of it
    used = 1024 * int(Path("/proc/self/status").read_text().split("VmSize:")[1].split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (used + spare, used + spare))


def run(numbers: list[int], seed: int, jobs: int, method: str = "spawn") -> Iterator[Trial]:
    """Attempts mutations in ``jobs`` processes, started by ``method``; one that crashes or hangs is replaced."""
    context = multiprocessing.get_context(method)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_originals(folder)
        with ProcessPool(jobs, initializer=prepare, initargs=(folder,), context=context) as pool:
            futures = {n: pool.schedule(attempt, args=(n, seed, folder), timeout=PATIENCE) for n in numbers}
            for number, future in futures.items():
                try:
                    yield future.result()
                except TimeoutError:
                    yield lost(number, seed, "time", f"no end after {PATIENCE:.0f} s")
                except ProcessExpired as error:
                    yield lost(number, seed, "crash", f"exit code {error.exitcode}")


def lost(number: int, seed: int, outcome: str, detail: str) -> Trial:
    """The mutation that took its process with it."""
    kind = KINDS[number % len(KINDS)]
    return Trial(number, kind, mutation_of(kind, Random(f"{seed} {number}")).__name__, outcome, detail)


# -------------------------------------------------------------------- report


def report(trials: list[Trial]) -> str:
    """A table of kinds and outcomes, and the defects."""
    outcomes = [*GOOD, *sorted({t.outcome for t in trials} - set(GOOD))]
    counts = Counter((t.kind, t.outcome) for t in trials)
    lines = [f"{'':22}" + "".join(f"{outcome:>15}" for outcome in outcomes)]
    lines += [f"{kind:22}" + "".join(f"{counts[kind, outcome]:15}" for outcome in outcomes) for kind in KINDS]
    defects = [t for t in trials if t.outcome not in GOOD]
    lines += [f"{t.outcome}: number {t.number}, {t.kind}, {t.mutation}: {t.detail[:200]!r}" for t in defects]
    return "\n".join([*lines, f"{len(trials)} mutations, {len(defects)} defects"])


def main(number: int = 10_000, seed: int = 0, first: int = 0, jobs: int = 2, json: Path | None = None) -> None:
    """Attempts the mutations and prints the defects; exit code 1 if there is one."""
    trials = []
    numbers = list(range(first, first + number))
    with progress("mutations", len(numbers)) as advance:
        for trial in run(numbers, seed, jobs):
            trials.append(trial)
            advance(f"{sum(t.outcome not in GOOD for t in trials)} defects" if len(trials) % 100 == 0 else "")
    for line in report(trials).splitlines():
        say(line)
    if json is not None:
        write_json(json, {"seed": seed, "mutations": [asdict(trial) for trial in trials]})
    sys.exit(any(trial.outcome not in GOOD for trial in trials))


if __name__ == "__main__":
    typer.run(main)
