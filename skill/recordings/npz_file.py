"""Reads recordings from NumPy archives (npz) with an array for each column, or one array for the wrench."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from skill.data.files import no_access, one_line, read_bounded
from skill.data.npz_archive import read_archive
from skill.recordings.column_table import NO_CHOICE, ColumnChoice, check_length, select_columns, table_recordings
from skill.recordings.columns import FORCES, MOMENTS
from skill.recordings.recording import Recording

MAX_BYTES = 500_000_000
"""Largest size of a file, and of its arrays together."""

WRENCH = "wrench"
"""Name of an array of shape (n, 6) or (n, 3) with forces in N and moments in N m."""


def read_npz_file(path: Path, choice: ColumnChoice = NO_CHOICE) -> list[Recording]:
    """Reads the recordings of a NumPy archive.

    An array of one dimension is a column with its name, and ``wrench`` is the columns fx fy fz, or fx fy fz mx my mz.
    Other arrays are not read. Nothing is unpickled.
    """
    try:
        arrays = read_archive(read_bounded(path, MAX_BYTES), MAX_BYTES)
    except (FileNotFoundError, PermissionError) as error:
        raise ValueError(f"{path}: {no_access(error)}") from None
    except (OSError, ValueError, MemoryError) as error:
        raise ValueError(f"{path}: not a NumPy archive of plain arrays ({one_line(error)})") from error
    parts = {name: array for name, array in arrays.items() if array.ndim == 1}
    wrench = arrays.get(WRENCH)
    if wrench is not None:
        if wrench.ndim != 2 or wrench.shape[1] not in (3, 6):
            raise ValueError(f"{path}: '{WRENCH}' has shape {wrench.shape}, expected (n, 6) or (n, 3)")
        parts |= dict(zip((*FORCES, *MOMENTS), wrench.T, strict=False))
    selection = select_columns(list(parts), str(path), choice)
    lengths = {name: len(parts[name]) for name in selection.names}
    if len(set(lengths.values())) > 1:
        raise ValueError(f"{path}: arrays of different lengths {lengths}, expected the same length")
    check_length(max(lengths.values()), str(path))
    return table_recordings(
        pd.DataFrame({name: parts[name] for name in selection.names}), selection, str(path), path.name
    )
