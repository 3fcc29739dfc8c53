"""The Parquet files of a sweep, which the process that holds the folder of results writes.

A file holds up to `SIZE` trials of one cell. Its name has the digest of all that decides these trials, and the range of
their numbers, so that every possible row has one place: it cannot be there twice. The file is rewritten whole as trials
end.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from experiments.outputs.output_checks import named_errors
from experiments.sweep.cells import Cell
from experiments.sweep.trial_files import SCHEMA, partition
from skill.data.files import write_atomically
from skill.data.tables import named_parquet_errors

SIZE = 100
"""Trials in a file. It is rewritten as its trials end; with more, that would cost more."""

Row = dict[str, Any]


class CellFile:
    """A file of trials of a cell.

    Args:
        path: of the file.
        cell: whose trials it holds.
        numbers: of the trials that are wanted.

    Attributes:
        path: of the file.
        cell: whose trials it holds.
        missing: numbers of the wanted trials that have no row yet.

    Raises:
        ValueError: if the file holds trials of another cell, or is damaged.
    """

    def __init__(self, path: Path, cell: Cell, numbers: Iterable[int]) -> None:
        self.path, self.cell = path, cell
        self._new: list[Row] = []
        present = self._read(["trial", "key"]).to_pylist() if path.exists() else []
        if any(row["key"] != row_key(cell.digest, row["trial"]) for row in present):
            raise ValueError(f"{path}: holds other trials than its name says; move it away")
        self.missing = set(numbers).difference(row["trial"] for row in present)

    def add(self, row: Row) -> None:
        """Adds the row of a missing trial; `write` writes it."""
        self.missing.remove(row["trial"])
        self._new.append({**row, "key": row_key(self.cell.digest, row["trial"])})

    def write(self) -> int:
        """Writes the added rows and returns their number.

        Raises:
            OSError: if they cannot be written; what was written before stays, and the rows can be written again.
        """
        if not self._new:
            return 0
        old = [self._read()] if self.path.exists() else []
        table = pa.concat_tables([*old, pa.Table.from_pylist(self._new, schema=SCHEMA)]).combine_chunks()
        sink = pa.BufferOutputStream()
        pq.write_table(table.sort_by("trial"), sink, compression="zstd")
        with named_errors(self.path, "the rows that were written before stay"):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(self.path, sink.getvalue().to_pybytes())
        count = len(self._new)
        self._new = []
        return count

    def _read(self, columns: list[str] | None = None) -> pa.Table:
        with named_parquet_errors(self.path, "file of trials"):
            return pq.read_table(self.path, columns=columns, partitioning=None, memory_map=False)


def files_of(cell: Cell, results: Path) -> list[CellFile]:
    """Returns the files of a cell within a folder of results, in order of their numbers.

    Raises:
        ValueError: see `CellFile`.
    """
    folder = partition(results, cell.policy, cell.trial_set, cell.engine)
    ranges: dict[int, list[int]] = {}
    for number in cell.numbers:
        ranges.setdefault(number // SIZE, []).append(number)
    return [
        CellFile(folder / f"{cell.digest}_{first * SIZE:010d}.parquet", cell, chosen)
        for first, chosen in sorted(ranges.items())
    ]


def row_key(cell: str, number: int) -> str:
    """Returns the key of a trial, given the digest of its cell and its number."""
    return hashlib.sha256(f"{cell} {number}".encode()).hexdigest()[:32]
