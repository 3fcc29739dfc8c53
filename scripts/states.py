"""Discovers contact states in recordings of any force/torque sensor, without Drake and without labels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from scripts.command_line import Seed, counted, parse_path, path_option, text_option

if TYPE_CHECKING:
    from skill.recordings.recording import Recording
    from skill.states.contact_states import ContactStates
    from skill.states.state_summary import LabelledRecording

SAME_RATE = 1.2
"""Recordings whose rates differ by more than this factor deserve a note."""

LONG_GAP = 1.0  # s
"""A gap of this length deserves a note: the file may hold several recordings."""

COLUMNS = ("trial", "time", "state", "probability")
SUFFIX = ".states.csv"
"""Columns of a table of states, and how its name ends."""


def main(
    files: Annotated[
        list[Path],
        typer.Argument(
            parser=parse_path,
            metavar="FILES",
            help="Recordings: texts, .parquet .npz .mcap .db3 .bag files, folders of a bag or a LeRobot data set.",
            show_default=False,
        ),
    ],
    out: Annotated[Path, path_option("FILE", "HTML page to write; replaces an existing page.")] = Path("states.html"),
    labels: Annotated[
        Path | None,
        path_option(
            "FOLDER",
            "Folder for the tables of states, NAME.states.csv for each of FILES.",
            shown="beside each of FILES",
        ),
    ] = None,
    columns: Annotated[
        list[str],
        text_option(
            "CHANNEL=COLUMN:UNIT",
            "Which column is which channel: fx=ati_1:N. In texts, COLUMN may be its number, from 1; for texts without"
            " names, say all channels in their order, as in time:ms,fx,fy,fz. Without UNIT, it is that of the file, or"
            " an SI unit. May be given several times. Usual names need none.",
        ),
    ] = [],  # noqa: B006
    trial_column: Annotated[
        str | None,
        text_option(
            "COLUMN",
            "Column with the trial of each row; '' for none.",
            shown="trial, episode, episode_index or run, if it is there",
        ),
    ] = None,
    phase_column: Annotated[
        str | None,
        text_option(
            "COLUMN",
            "Column with the known phase of each row, to compare with; '' for none.",
            shown="phase or label, if it is there",
        ),
    ] = None,
    topic: Annotated[str | None, text_option("TOPIC", "Topic of a bag.", shown="the only WrenchStamped")] = None,
    feature: Annotated[
        str | None, text_option("NAME", "Feature of a LeRobot data set.", shown="the one with forces")
    ] = None,
    sampling_rate: Annotated[
        float | None,
        typer.Option(
            metavar="HZ", help="Rate of the rows of texts without a time.", show_default="the files have a time"
        ),
    ] = None,
    decimal: Annotated[
        str | None, text_option("SIGN", "Decimal sign of texts: . or ,", shown="the one that all numbers fit")
    ] = None,
    rate: Annotated[
        float, typer.Option(help="Rate at which the states are found, Hz; faster recordings are averaged.")
    ] = 50.0,
    seed: Seed = 0,
) -> None:
    """Discovers the contact states in recordings of a force/torque sensor.

    Reads the recordings, at least two of the same task: several files, or one with a column of trials. They need a time
    and forces, moments if there are any, and no labels. Finds how many contact states there are, and in which of them
    each sample is. If the recordings have phases, it says how well the states agree with them; the learner does not
    see the phases. Prints one row per state.

    Writes one page with the states and every recording over them, which needs neither a network nor this program, and a
    table beside each file, with the columns trial, time, state and probability. The data are never changed. The seed is
    that of the random draws of the learner.

    For example:

        haptic-skill states insert_1.csv insert_2.csv insert_3.csv

        haptic-skill states wrench_1.txt wrench_2.txt --columns fx,fy,fz,mx,my,mz --sampling-rate 100

        haptic-skill states runs.csv --columns fz=load:N --columns time=clock:ms --trial-column part --out runs.html
    """
    from contextlib import ExitStack

    from threadpoolctl import threadpool_limits

    from experiments.outputs.folder_lock import locked_file
    from experiments.outputs.output_checks import REPORT_SIZE, check_file, named_errors, require_distinct
    from interfaces.reports.result_tables import discovered_table, phase_table
    from interfaces.reports.states_page import StatesReport, states_page
    from interfaces.terminal import busy, say, show
    from skill.data.files import write_atomically
    from skill.recordings.orientation import with_common_orientation
    from skill.recordings.reading import read_recordings
    from skill.states.phase_agreement import compare_with_phases
    from skill.states.state_summary import summarise_states

    if not (math.isfinite(rate) and rate > 0):
        raise ValueError(f"--rate {rate:g}: expected a positive number of Hz")
    sources = find_sources(files)
    tables = [state_table_path(source, labels) for source in sources]
    check_file(out, ".html", size=REPORT_SIZE)
    for path in tables:
        check_file(path, ".csv", option="--labels")
    owned = {f"the table of states of {source}": path for source, path in zip(sources, tables, strict=True)}
    require_distinct({"--out": out, **owned})
    options: dict[str, Any] = {
        **{"columns": tuple(columns), "trial_column": trial_column, "phase_column": phase_column},
        **{"topic": topic, "feature": feature, "sampling_rate": sampling_rate, "decimal": decimal},
    }
    by_source, read = [], []
    for source in sources:
        with busy(f"reading {source.name}"):
            found = read_recordings(source, **options)
            read += [(len(recording.time), recording.rate, recording.duration) for recording in found]
            by_source.append([recording.averaged(rate) for recording in found])
    recordings = [recording for found in by_source for recording in found]
    say(_what_was_read(read))
    check_recordings(recordings)
    recordings = with_common_orientation(recordings)
    with ExitStack() as locks:
        for path in (out, *tables):
            locks.enter_context(locked_file(path))
        with busy(f"discovering states in {len(recordings)} recordings"), threadpool_limits(1):
            learner, labelled = learn(recordings, seed)
            states = summarise_states(labelled, learner.n_clusters_)
            agreement = compare_with_phases(labelled, learner.n_clusters_)
        page = states_page(
            StatesReport(
                title=f"contact states of {_listed([source.resolve().name for source in sources])}",
                about=f"{len(recordings)} recordings in {counted(len(sources), 'file')}",
                method=_method(learner),
                labelled=labelled,
                states=states,
                agreement=agreement,
                made_by=_made_by(sources, options, rate, seed),
            )
        )
        first = 0
        for done, (found, path) in enumerate(zip(by_source, tables, strict=True)):
            with named_errors(path, f"the recordings are unchanged; {done} of {counted(len(tables), 'table')} written"):
                write_state_table(path, labelled[first : first + len(found)])
            first += len(found)
        with named_errors(out, "the recordings are unchanged and the tables of states complete"):
            write_atomically(out, page.encode())
    show(discovered_table(states))
    if agreement is not None:
        show(phase_table(agreement))
    say(f"{counted(len(states), 'contact state')} in {counted(len(recordings), 'recording')}")
    say(f"states of the samples in {_listed([str(path) for path in tables])}")
    say(f"open {out}: the states, and every recording over them")


def find_sources(files: Sequence[Path]) -> list[Path]:
    """The files to read: without tables of states, which a pattern such as ``*.csv`` also finds."""
    from interfaces.terminal import say

    for path in files:
        if not path.exists():
            raise ValueError(f"{path}: no such file or folder")
    sources = [path for path in files if not is_state_table(path)]
    if not sources:
        raise ValueError(f"{files[0]}: a table of states; expected recordings")
    if len(sources) < len(files):
        say(f"{counted(len(files) - len(sources), 'table')} of states among the files, not read")
    resolved = [path.resolve() for path in sources]
    for path in sources:
        if resolved.count(path.resolve()) > 1:
            raise ValueError(f"{path}: given twice; expected each file once")
    return sources


def check_recordings(recordings: Sequence[Recording]) -> None:
    """Checks that there are two recordings or more, with the same channels."""
    import numpy as np

    from interfaces.terminal import say
    from skill.states.state_style import GAP

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
    if len(recordings) == 2:
        say("two recordings hide states in what differs between them; three or more are better")
    rates = sorted(recording.rate for recording in recordings)
    if rates[-1] > SAME_RATE * rates[0]:
        low, high = (f"{end:.3g}" for end in (rates[0], rates[-1]))
        say(f"the recordings have rates from {low} to {high} Hz; --rate {low} makes them alike")
    for recording in recordings:
        gap = float(np.diff(recording.time).max())
        if gap >= max(LONG_GAP, GAP / recording.rate):
            say(f"{recording.name} has a gap of {gap:.1f} s, which counts as one interval; is it one recording?")


def learn(recordings: Sequence[Recording], seed: int) -> tuple[ContactStates, list[LabelledRecording]]:
    """Fits the states and labels the samples."""
    import numpy as np

    from skill.states.contact_states import ContactStates
    from skill.states.state_summary import LabelledRecording

    counts = [len(recording.time) for recording in recordings]
    groups = np.repeat(np.arange(len(counts)), counts)
    values = np.concatenate([recording.values for recording in recordings])
    learner = ContactStates(random_state=seed).fit(values, groups=groups)
    probability = np.take_along_axis(learner.probabilities_, learner.labels_[:, None], axis=1)[:, 0]
    parts = (np.split(of_all, np.cumsum(counts)[:-1]) for of_all in (learner.labels_, probability))
    return learner, [LabelledRecording(*each) for each in zip(recordings, *parts, strict=True)]


def _method(learner: ContactStates) -> str:
    """How the states were found, in three sentences."""
    return (
        f"Competitive Agglomeration found {counted(learner.components_.n_clusters_, 'component')} in the samples of all"
        f" recordings, without labels, and {counted(learner.n_clusters_, 'set')} of them: these are the states. A set"
        " that few recordings have belongs to the state whose place it takes. A hidden Markov model learnt how one"
        " follows another, and found the most probable path of each recording."
    )


def _made_by(sources: Sequence[Path], options: dict[str, Any], rate: float, seed: int) -> dict[str, str]:
    """What determined the result."""
    import platform

    import numpy as np

    from experiments.provenance import version_of

    chosen = {f"--{name.replace('_', '-')}": value for name, value in options.items() if value}
    packages = f"haptic-skill {version_of('haptic-skill')}, Python {platform.python_version()}, NumPy {np.__version__}"
    return {
        "files": ", ".join(map(str, sources)),
        "rate": f"at most {rate:g} Hz",
        "seed": str(seed),
        **{name: ", ".join(value) if isinstance(value, tuple) else str(value) for name, value in chosen.items()},
        "versions": packages,
    }


def _what_was_read(read: Sequence[tuple[int, float, float]]) -> str:
    """The samples, rates (Hz) and durations (s) of the recordings, so that a wrong unit or rate is seen."""
    counts, rates, durations = zip(*read, strict=True)
    ends = [" to ".join(dict.fromkeys(f"{end:.4g}" for end in (min(x), max(x)))) for x in (rates, durations)]
    return f"read {sum(counts)} samples at {ends[0]} Hz; a recording lasts {ends[1]} s"


def _listed(names: Sequence[str]) -> str:
    """The first and the number of the others."""
    return names[0] if len(names) == 1 else f"{names[0]} and {counted(len(names) - 1, 'other')}"


def state_table_path(source: Path, folder: Path | None) -> Path:
    """Returns the path of the table of a file or folder of recordings.

    Args:
        source: the file or folder.
        folder: where the table is to be; None for beside the source.
    """
    resolved = source.resolve()  # "." has no name
    name = resolved.name if source.is_dir() else source.stem
    return (folder or (resolved.parent if source.is_dir() else source.parent)) / f"{name}{SUFFIX}"


def is_state_table(path: Path) -> bool:
    """Whether a file is such a table, by its name and its first line."""
    if not path.name.endswith(SUFFIX) or not path.is_file():
        return False
    header = ",".join(COLUMNS).encode()
    with path.open("rb") as stream:
        return stream.read(len(header) + 2).splitlines()[:1] == [header]


def write_state_table(path: Path, labelled: Sequence[LabelledRecording]) -> None:
    """Writes the table of the recordings of a file.

    Its rows are in the order of the recordings. The trial is as in the file, and empty where the file is one recording;
    the time is that of the file, s.

    Raises:
        OSError: if the table cannot be written; an existing file is then unchanged.
    """
    import numpy as np
    import pandas as pd

    from skill.data.files import write_atomically

    parts = [
        pd.DataFrame(
            {
                "trial": item.recording.trial,
                "time": np.round(item.recording.time, 6),
                "state": item.states,
                "probability": np.round(item.probabilities, 4),
            }
        )
        for item in labelled
    ]
    write_atomically(path, pd.concat(parts)[list(COLUMNS)].to_csv(index=False, lineterminator="\n").encode())
