"""Discovers contact states in recordings, and writes a page about them and a table of states for each file."""

from __future__ import annotations

import math
import platform
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from experiments.outputs.folder_lock import locked_file
from experiments.outputs.output_checks import REPORT_SIZE, check_file, named_errors, require_distinct
from experiments.outputs.own_folder import remove_unfinished
from experiments.outputs.state_tables import is_state_table, state_table_path, write_state_table
from experiments.provenance import version_of
from interfaces.reports.result_tables import discovered_table, phase_table
from interfaces.reports.states_page import StatesReport, states_page
from interfaces.terminal import busy, console, say
from skill.data.tables import write_atomically
from skill.recordings.reading import read_recordings
from skill.recordings.recording import Recording
from skill.states.contact_states import ContactStates
from skill.states.phase_agreement import compare_with_phases
from skill.states.state_summary import GAP, LabelledRecording, summarise_states

SAME_RATE = 1.2
"""Recordings whose rates differ by more than this factor deserve a note."""

LONG_GAP = 1.0  # s
"""A gap of this length deserves a note: the file may hold several recordings."""


@dataclass(frozen=True)
class ReadOptions:
    """How the files are read; see `skill.recordings.reading.read_recordings`."""

    columns: tuple[str, ...] = ()
    trial_column: str | None = None
    phase_column: str | None = None
    topic: str | None = None
    feature: str | None = None


def discover_states(
    *,
    files: Sequence[Path],
    out: Path,
    labels: Path | None = None,
    options: ReadOptions = ReadOptions(),
    rate: float = 50.0,
    seed: int = 0,
) -> list[LabelledRecording]:
    """Discovers the contact states of recordings; writes the page ``out`` and the tables, and returns the states.

    Args:
        files: files and folders with recordings, at least two recordings together. Tables of states are not read.
        out: page to write.
        labels: folder of the tables; None for beside each file.
        options: how the files are read.
        rate: Hz; faster recordings are averaged.
        seed: of the random draws of the learner.

    Raises:
        ValueError: if a file is missing or not valid, the recordings have different channels, or there is only one.
        OSError: if an output cannot be written.
    """
    if not (math.isfinite(rate) and rate > 0):
        raise ValueError(f"--rate {rate:g}: expected a positive number of Hz")
    sources = _sources(files)
    tables = [state_table_path(source, labels) for source in sources]
    _check_outputs(sources, tables, out)
    by_source = [_read(source, options, rate) for source in sources]
    recordings = [recording for found in by_source for recording in found]
    _check_recordings(recordings)
    with ExitStack() as locks:
        for path in (out, *tables):
            locks.enter_context(locked_file(path))
            remove_unfinished(path.parent, [path.name])
        with busy(f"discovering states in {len(recordings)} recordings"), threadpool_limits(1):
            learner, labelled = _learn(recordings, seed)
            states = summarise_states(labelled, learner.n_clusters_)
            agreement = compare_with_phases(labelled, learner.n_clusters_)
        page = states_page(
            StatesReport(
                title=f"contact states of {_listed([source.resolve().name for source in sources])}",
                about=f"{len(recordings)} recordings in {_count(len(sources), 'file')}",
                method=_method(learner),
                labelled=labelled,
                states=states,
                agreement=agreement,
                made_by=_made_by(sources, options, rate, seed),
            )
        )
        first = 0
        for done, (found, path) in enumerate(zip(by_source, tables, strict=True)):
            with named_errors(path, f"the recordings are unchanged; {done} of {_count(len(tables), 'table')} written"):
                write_state_table(path, labelled[first : first + len(found)])
            first += len(found)
        with named_errors(out, "the recordings are unchanged and the tables of states complete"):
            write_atomically(out, page.encode())
    console.print(discovered_table(states))
    if agreement is not None:
        console.print(phase_table(agreement))
    say(f"{_count(len(states), 'contact state')} in {len(recordings)} recordings, in {out}")
    say(f"states of the samples in {_listed([str(path) for path in tables])}")
    return labelled


def _sources(files: Sequence[Path]) -> list[Path]:
    """The files to read: without tables of states, which a pattern such as ``*.csv`` also finds."""
    for path in files:
        if not path.exists():
            raise ValueError(f"{path}: no such file or folder")
    sources = [path for path in files if not is_state_table(path)]
    if not sources:
        raise ValueError(f"{files[0]}: a table of states; expected recordings")
    if len(sources) < len(files):
        say(f"{_count(len(files) - len(sources), 'table')} of states among the files, not read")
    resolved = [path.resolve() for path in sources]
    for path in sources:
        if resolved.count(path.resolve()) > 1:
            raise ValueError(f"{path}: given twice; expected each file once")
    return sources


def _check_outputs(sources: Sequence[Path], tables: Sequence[Path], out: Path) -> None:
    """Checks that the page and the tables can be written, and replace nothing else."""
    check_file(out, ".html", size=REPORT_SIZE)
    owners: dict[Path, Path] = {}
    for source, path in zip(sources, tables, strict=True):
        check_file(path, ".csv", option="--labels")
        other = owners.setdefault(path.resolve(), source)
        if other != source:
            raise ValueError(f"{other} and {source} would share the table of states {path}; rename one of them")
        require_distinct({"--out": out, "the table of states": path})


def _read(source: Path, options: ReadOptions, rate: float) -> list[Recording]:
    """The recordings of a file, at most at the rate."""
    with busy(f"reading {source.name}"):
        return [recording.averaged(rate) for recording in read_recordings(source, **asdict(options))]


def _check_recordings(recordings: Sequence[Recording]) -> None:
    """Checks that there are two recordings or more, with the same channels."""
    first = recordings[0]
    if len(recordings) < 2:
        raise ValueError(
            f"{first.name}: a single recording, expected two or more of the same task: several files, or a table with"
            " a column of trials (--trial-column)"
        )
    for other in recordings:
        if other.channels != first.channels:
            raise ValueError(
                f"{other.name} has the channels {' '.join(other.channels)}, but {first.name} has"
                f" {' '.join(first.channels)}; expected the same in all files; name them with --columns"
            )
    rates = sorted(recording.rate for recording in recordings)
    if rates[-1] > SAME_RATE * rates[0]:
        low, high = (f"{end:.3g}" for end in (rates[0], rates[-1]))
        say(f"the recordings have rates from {low} to {high} Hz; --rate {low} makes them alike")
    for recording in recordings:
        gap = float(np.diff(recording.time).max())
        if gap >= max(LONG_GAP, GAP / recording.rate):
            say(f"{recording.name} has a gap of {gap:.1f} s, which counts as one interval; is it one recording?")


def _learn(recordings: Sequence[Recording], seed: int) -> tuple[ContactStates, list[LabelledRecording]]:
    """Fits the states and labels the samples."""
    counts = [len(recording.time) for recording in recordings]
    groups = np.repeat(np.arange(len(counts)), counts)
    values = np.concatenate([recording.values for recording in recordings])
    learner = ContactStates(random_state=seed).fit(values, groups=groups)
    parts = np.split(learner.probabilities_, np.cumsum(counts)[:-1])
    return learner, [
        LabelledRecording(recording, part.argmax(axis=1), part.max(axis=1))
        for recording, part in zip(recordings, parts, strict=True)
    ]


def _method(learner: ContactStates) -> str:
    """How the states were found, in three sentences."""
    return (
        f"Competitive Agglomeration found {_count(learner.components_.n_clusters_, 'component')} in the samples of all"
        f" recordings, without labels, and {_count(learner.n_clusters_, 'set')} of them that valleys of the density"
        " separate: these are the states. A set that few recordings have belongs to the state whose place it takes. A"
        " hidden Markov model learnt how one follows another, and gave each sample its most probable state."
    )


def _made_by(sources: Sequence[Path], options: ReadOptions, rate: float, seed: int) -> dict[str, str]:
    """What determined the result."""
    chosen = {f"--{name.replace('_', '-')}": value for name, value in asdict(options).items() if value}
    packages = f"haptic-skill {version_of('haptic-skill')}, Python {platform.python_version()}, NumPy {np.__version__}"
    return {
        "files": ", ".join(map(str, sources)),
        "rate": f"at most {rate:g} Hz",
        "seed": str(seed),
        **{name: ", ".join(value) if isinstance(value, tuple) else str(value) for name, value in chosen.items()},
        "versions": packages,
    }


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _listed(names: Sequence[str]) -> str:
    """The first and the number of the others."""
    return names[0] if len(names) == 1 else f"{names[0]} and {_count(len(names) - 1, 'other')}"
