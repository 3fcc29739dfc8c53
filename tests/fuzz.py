"""Fuzz test of all files that the programs read: is any change of a file accepted without a word?

    python -m tests.fuzz [--number 10000] [--seed 0] [--first 0] [--jobs 2] [--json FILE]

Each change damages one file (a recording, a run, a skill, a scenario, or a recording of another sensor) and loads it in
a process of its own. Half of the changes lose, insert or replace bits and bytes; the other half change what the file
holds (an entry, a number, an array, a line) and make the digest anew, as a careful forger would. The outcome is

* refused: one `ValueError` in one line that names the file,
* identical: the file loads and holds what it held before,
* another file: a file without a digest (a scenario, another sensor), or one whose digest was made anew, loads and is
  sound; nothing in it can say that it was changed,
* abort of PyArrow: its version 26.0.1 ends the process on a damaged statistic in a Parquet file without a digest,

or a defect:

* silent change: a file with a digest loads and holds something else,
* unsound: a skill loads, but does not act by finite numbers,
* message: a refusal without the name of the file, or on several lines,
* exception: an exception other than ValueError, also for want of 1 GB of memory,
* time: loading takes over 10 s,
* crash: the process ends.

Change k of a seed is always the same: ``--seed 0 --first k --number 1`` repeats it. The exit code is 1 if there is a
defect.
"""

from __future__ import annotations

import io
import json
import multiprocessing
import resource
import signal
import sys
import tempfile
import warnings
import zipfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
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
from skill.skill_file import ARRAY_PARTS, FEATURE_PARTS, PARAMETERS
from tests.checkout import ROOT
from tests.crafted_files import sealed_archive, sealed_arrays, sealed_parquet
from tests.skill.recordings.wrench_messages import cdr, write_db3, write_mcap
from tests.trajectories import make_demonstration, make_rig_run

MAX_MEMORY = 1_000_000_000  # bytes, more than before
MAX_TIME = 10.0  # s
ABORTED = "abort of PyArrow"
GOOD = ("refused", "identical", "another file", ABORTED)
SEALED = {"recording.parquet": "demonstration", "run.parquet": "rig_run", "skill.npz": ""}
"""The files that carry a digest, and the entry of their metadata that is their header."""
SENSORS = tuple(f"sensor.{kind}" for kind in ("csv", "parquet", "npz", "mcap", "db3"))
KINDS = (*SEALED, "scenario.yaml", *SENSORS)

ODD_VALUES: list[Any] = [
    *(None, True, 0, -1, 1, 99, 10**400, 0.5, 1e-300, 1e300, np.nan, np.inf, "", "false", "\0", "x" * 10_000),
    *([], [1], [[]], ["a", 1], {}, {"": None}, [[[[[[[[]]]]]]]]),
]
"""What a forger may put in the place of an entry."""

ODD_NUMBERS = [0.0, -1.0, 3.5, 1e-320, 1e12, 1e300, -1e300, np.nan, np.inf]

# fmt: off
ODD_TEXTS = [
    ".nan", ".inf", "-1", "0", "1e300", "9" * 400, "0x10", "yes", "null", "''", '"', "[", "{}", "[1, 2]", "[" * 3000,
    "{a: 1}", "*a", "&a [*a]", "2026-01-01", "|", "!!python/object/apply:os.getcwd []", "!!float x", "\t1", "a: b: c",
    "? 1", "---", "#", "<<: 1", "\udcff", "\0",
]
# fmt: on
"""What may stand in the place of a value of a scenario."""


@dataclass(frozen=True)
class Trial:
    """One change and its outcome."""

    number: int
    kind: str
    outcome: str
    detail: str = ""


# ------------------------------------------------------------------ changes


def damage(data: bytes, rng: Random) -> bytes:
    """A bit is inverted; bytes are lost, inserted, zero (as after a failed write) or random; or the end is lost."""
    start = rng.randrange(len(data))
    if rng.random() < 0.3:
        return data[:start] + bytes([data[start] ^ (1 << rng.randrange(8))]) + data[start + 1 :]
    size = min(rng.choice([0, 1, 4, 64, 4096, len(data)]), len(data) - start)
    return data[:start] + rng.choice([b"", bytes(size), rng.randbytes(size or 8)]) + data[start + size :]


def forge(kind: str, data: bytes, rng: Random) -> bytes:
    """A file of valid form that holds something else; one with a digest gets a new one."""
    if kind == "scenario.yaml":
        return _changed_lines(data, rng)
    if kind == "skill.npz":
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
        if rng.random() < 0.3:  # most of the time in what says how large the array is
            name, size = rng.choice(list(members)), rng.choice([128, 128, 10**9])
            members[name] = damage(members[name][:size], rng) + members[name][size:]
            return sealed_archive(members)
        with np.load(io.BytesIO(data)) as stored:
            arrays = dict(stored)
        header = json.loads(arrays.pop("header").tobytes())
        _change(header, arrays, rng)
        return sealed_arrays({**arrays, "header": np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)})
    table = pq.read_table(pa.BufferReader(data))
    header = json.loads(table.schema.metadata[SEALED[kind].encode()])
    columns = {name: table[name].to_numpy() for name in table.column_names}
    _change(header, columns, rng)
    return sealed_parquet(pa.table(columns), {SEALED[kind]: json.dumps(header)})


def _change(header: dict[str, Any], arrays: dict[str, Any], rng: Random) -> None:
    """Changes an entry of a header, some numbers of an array, or takes one array for another or none."""
    how, name = rng.choice(["entry", "numbers", "exchange", "loss"]), rng.choice(list(arrays))
    if how == "entry":
        _change_entry(header, rng)
    elif how == "numbers":
        arrays[name] = arrays[name].copy()
        for _ in range(rng.choice([1, 5])):
            with np.errstate(invalid="ignore", over="ignore"):
                odd = np.array(rng.choice(ODD_NUMBERS)).astype(arrays[name].dtype)
            arrays[name][tuple(rng.randrange(n) for n in arrays[name].shape)] = odd
    elif how == "exchange":
        arrays[name] = arrays[rng.choice(list(arrays))]
    else:
        del arrays[name]


def _change_entry(header: dict[str, Any], rng: Random) -> None:
    """Replaces or removes an entry of a tree of objects and lists."""
    place: Any = header
    while True:
        key = rng.choice(list(place) if isinstance(place, dict) else range(len(place)))
        if not (isinstance(place[key], dict | list) and place[key] and rng.random() < 0.7):
            break
        place = place[key]
    if rng.random() < 0.8:
        place[key] = rng.choice(ODD_VALUES)
    else:
        del place[key]


def _changed_lines(data: bytes, rng: Random) -> bytes:
    """A value of a scenario is odd, or a line is lost, repeated, moved or foreign."""
    lines = data.decode().split("\n")
    k = rng.choice([n for n, line in enumerate(lines) if ":" in line and not line.startswith("#")])
    name, moved = lines[k].split(":")[0], lines[k]
    if rng.random() < 0.7:
        lines[k] = f"{name}: {rng.choice(ODD_TEXTS)}"
    else:
        del lines[k]
        for _ in range(rng.randrange(3)):
            lines.insert(
                rng.randrange(len(lines)), rng.choice([moved, moved.lstrip(), f"zeal: {rng.choice(ODD_TEXTS)}"])
            )
    return "\n".join(lines).encode(errors="surrogateescape")


# ---------------------------------------------------------------- originals


def write_originals(folder: Path) -> None:
    """Writes one file of each kind."""
    shown = [make_demonstration(tilt=0.04 + 0.005 * k, direction=k) for k in range(4)]
    write_demonstration(shown[0], folder / "recording.parquet")
    write_rig_run(make_rig_run(), folder / "run.parquet")
    states = CompetitiveAgglomeration(m_init=4, n_init=1, reg_covar=0.05, random_state=0)
    ManipulationSkill(states=states, regressor=LWRegressor(bandwidth=0.7)).fit(shown).save(folder / "skill.npz")
    scenario = ROOT / "models" / "scenarios" / "one_of_everything.yaml"
    (folder / "scenario.yaml").write_bytes(scenario.read_bytes())
    wrench = np.random.default_rng(0).normal(size=(50, 6)).round(3)
    table = pd.DataFrame(wrench, columns=["fx", "fy", "fz", "mx", "my", "mz"])
    table.insert(0, "time", 0.01 * np.arange(50))
    table.to_csv(folder / "sensor.csv", index=False)
    table.to_parquet(folder / "sensor.parquet", index=False)
    np.savez(folder / "sensor.npz", time=table["time"], wrench=wrench, trial=np.repeat([1, 2], 25))
    stamps = range(0, 500_000_000, 10_000_000)
    messages = [("/wrench", t, cdr(sec=0, nanosec=t, wrench=row)) for t, row in zip(stamps, wrench, strict=True)]
    write_mcap(folder / "sensor.mcap", messages)
    write_db3(folder / "sensor.db3", messages)


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
    header = [{name: getattr(skill, name) for name in PARAMETERS}, skill.period_, skill.metadata_, skill.names_]
    header += [[type(part).__name__, part.get_params()] for part in (getattr(skill, f"{n}_") for n in FEATURE_PARTS)]
    content = json.dumps([*header, skill.min_log_support_]).encode() + skill.sources_.tobytes()
    for part in ARRAY_PARTS:
        for name, array in sorted(getattr(skill, f"{part}_").to_arrays().items()):
            content += name.encode() + array.dtype.str.encode() + array.tobytes()
    action = skill.act([5.0, 3.0, 2.0, 0.01, 0.02, 0.0, -0.008])
    return content, bool(np.isfinite([*action.turn, action.feed, action.support]).all())


# ------------------------------------------------------------------ judging


def judge(kind: str, held: bytes, path: Path, *, sealed: bool) -> tuple[str, str]:
    """Loads a changed file.

    Args:
        kind: one of ``KINDS``.
        held: what it held before, from `load`.
        path: of the file.
        sealed: whether it carries a digest that was not made anew.

    Returns:
        The outcome and its detail.
    """
    try:
        found, sound = load(kind, path)
    except ValueError as error:
        named = str(path) in str(error) and "\n" not in str(error)
        return "refused" if named else "message", str(error)
    except BaseException as error:
        return "exception", f"{type(error).__name__}: {error}"
    if found == held:
        return "identical", ""
    if sealed:
        return "silent change", ""
    return "another file" if sound else "unsound", ""


@cache
def originals(folder: Path) -> dict[str, tuple[bytes, bytes]]:
    """The bytes and the contents of each original."""
    return {kind: ((folder / kind).read_bytes(), load(kind, folder / kind)[0]) for kind in KINDS}


def attempt(number: int, seed: int, folder: Path) -> Trial:
    """Makes and judges one change."""
    rng, kind = Random(f"{seed} {number}"), KINDS[number % len(KINDS)]
    original, held = originals(folder)[kind]
    forged = kind not in SENSORS and rng.random() < 0.5
    path = folder / multiprocessing.current_process().name / kind
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(forge(kind, original, rng) if forged else damage(original, rng))
    outcome, detail = judge(kind, held, path, sealed=kind in SEALED and not forged)
    return Trial(number, kind, outcome, detail[:500])


def prepare(folder: Path) -> None:
    """Loads the originals in a new process, and limits its memory."""
    warnings.simplefilter("ignore")
    originals(folder)
    used = 1024 * int(Path("/proc/self/status").read_text().split("VmSize:")[1].split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (used + MAX_MEMORY, used + MAX_MEMORY))


def run(numbers: list[int], seed: int, jobs: int, method: str = "spawn") -> Iterator[Trial]:
    """Attempts changes in ``jobs`` processes, started by ``method``; one that crashes or hangs is replaced."""
    context = multiprocessing.get_context(method)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_originals(folder)
        with ProcessPool(jobs, initializer=prepare, initargs=(folder,), context=context) as pool:
            futures = {n: pool.schedule(attempt, args=(n, seed, folder), timeout=MAX_TIME) for n in numbers}
            for number, future in futures.items():
                kind = KINDS[number % len(KINDS)]
                try:
                    yield future.result()
                except TimeoutError:
                    yield Trial(number, kind, "time", f"no end after {MAX_TIME:.0f} s")
                except ProcessExpired as error:
                    known = kind == "sensor.parquet" and error.exitcode == -signal.SIGABRT
                    yield Trial(number, kind, ABORTED if known else "crash", f"exit code {error.exitcode}")


def main(number: int = 10_000, seed: int = 0, first: int = 0, jobs: int = 2, json: Path | None = None) -> None:
    """Attempts the changes and prints the defects; exit code 1 if there is one."""
    trials = []
    with progress("changes", number) as advance:
        for trial in run(list(range(first, first + number)), seed, jobs):
            trials.append(trial)
            advance("")
    table = pd.DataFrame(map(asdict, trials))
    defects = table[~table["outcome"].isin(GOOD)]
    for found in (pd.crosstab(table["kind"], table["outcome"]), *([defects] if len(defects) else [])):
        for line in found.to_string(max_colwidth=200).splitlines():
            say(line)
    say(f"{number} changes, {len(defects)} defects")
    if json is not None:
        write_json(json, {"seed": seed, "changes": table.to_dict("records")})
    sys.exit(1 if len(defects) else 0)


if __name__ == "__main__":
    typer.run(main)
