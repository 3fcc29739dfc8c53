"""Tables of states: a CSV file for each file of recordings, with the state of each sample."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from skill.data.tables import write_atomically
from skill.states.state_summary import LabelledRecording

COLUMNS = ("trial", "time", "state", "probability")
SUFFIX = ".states.csv"
HEADER = ",".join(COLUMNS).encode()
"""How a table of states begins."""

TIME_DIGITS, PROBABILITY_DIGITS = 6, 4


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
    with path.open("rb") as stream:
        return stream.read(len(HEADER) + 2).splitlines()[:1] == [HEADER]


def write_state_table(path: Path, labelled: Sequence[LabelledRecording]) -> None:
    """Writes the table of the recordings of a file.

    Its rows are in the order of the recordings. The trial is as in the file, and empty where the file is one recording;
    the time is that of the file, s.

    Raises:
        OSError: if the table cannot be written; an existing file is then unchanged.
    """
    parts = [
        pd.DataFrame(
            {
                "trial": item.recording.trial,
                "time": np.round(item.recording.time, TIME_DIGITS),
                "state": item.states,
                "probability": np.round(item.probabilities, PROBABILITY_DIGITS),
            }
        )
        for item in labelled
    ]
    write_atomically(path, pd.concat(parts)[list(COLUMNS)].to_csv(index=False, lineterminator="\n").encode())
