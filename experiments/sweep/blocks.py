"""The Parquet data set of a sweep: blocks of trials, which the process that holds the folder of results writes.

A block is a file of up to `BLOCK` trials of one cell. Its name holds the digest of all that decides these trials, and
the range of their numbers, so that every possible row has one place: it cannot be there twice. The file is rewritten
whole as trials end.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from experiments.outputs.output_checks import named_errors
from experiments.sweep.trial_files import SCHEMA, partition
from skill.data.files import write_atomically
from skill.data.tables import named_parquet_errors

BLOCK = 100
"""Trials in a block. A block is rewritten as its trials end; with more, that would cost more."""

Row = dict[str, Any]


class Block:
    """A file of trials.

    Args:
        path: of the file.
        cell: digest of what decides its trials.
        numbers: of the trials that are wanted.

    Attributes:
        path: of the file.
        missing: numbers of the wanted trials that have no row yet.

    Raises:
        ValueError: if the file holds trials of another cell, or is damaged.
    """

    def __init__(self, path: Path, cell: str, numbers: Iterable[int]) -> None:
        self.path, self._cell = path, cell
        self._new: list[Row] = []
        present = self._read(["trial", "key"]).to_pylist() if path.exists() else []
        if any(row["key"] != row_key(cell, row["trial"]) for row in present):
            raise ValueError(f"{path}: holds other trials than its name says; move it away")
        there = {row["trial"] for row in present}
        self.missing = {number for number in numbers if number not in there}

    def add(self, row: Row) -> None:
        """Adds the row of a missing trial; `write` writes it."""
        self.missing.remove(row["trial"])
        self._new.append({**row, "key": row_key(self._cell, row["trial"])})

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


def blocks_of(
    results: Path, cell: str, numbers: Iterable[int], *, policy: str, trial_set: str, engine: str
) -> list[Block]:
    """Returns the blocks that hold some trials of a cell, in order of their numbers.

    Args:
        results: folder of the sweep.
        cell: digest of what decides the trials.
        numbers: of the trials.
        policy: name of its folder, like those that follow.
        trial_set: name.
        engine: name.

    Raises:
        ValueError: see `Block`.
    """
    folder = partition(results, policy, trial_set, engine)
    ranges: dict[int, list[int]] = {}
    for number in numbers:
        ranges.setdefault(number // BLOCK, []).append(number)
    return [
        Block(folder / f"{cell}_{first * BLOCK:010d}.parquet", cell, chosen) for first, chosen in sorted(ranges.items())
    ]


def row_key(cell: str, number: int) -> str:
    """Returns the key of a trial, given the digest of its cell and its number."""
    return hashlib.sha256(f"{cell} {number}".encode()).hexdigest()[:32]
