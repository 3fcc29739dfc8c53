"""The Parquet data set of a sweep: blocks of trials, each written by one process at a time.

A block is a file of up to `BLOCK` trials of one policy, set of trials, engine and cell. Its name holds the digest of
all that decides these trials, and the range of their numbers, so that every possible row has one place: it cannot be
there twice. A process holds a block while it computes its missing trials, and rewrites the file whole as they end.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from experiments.outputs.folder_lock import BusyError, locked_file
from experiments.outputs.output_checks import named_errors
from experiments.sweeps.trial_files import SCHEMA, partition
from experiments.sweeps.trial_rows import Row, row_key
from skill.data.files import write_atomically
from skill.data.tables import named_parquet_errors

BLOCK = 100
"""Trials in a block. A block is rewritten as its trials end; with more, that would cost more."""


@dataclass(frozen=True)
class Block:
    """A file of the data set and its trials.

    Attributes:
        path: of the file.
        source: digest of what decides its trials.
        numbers: of the trials that are wanted.
    """

    path: Path
    source: str
    numbers: tuple[int, ...]

    def present(self) -> set[int]:
        """Returns the numbers of all trials in the file; none if there is no file.

        Raises:
            ValueError: if the file is no block of this source.
        """
        if not os.path.lexists(self.path):
            return set()
        table = read_block(self.path, ["trial", "key"])
        numbers = table["trial"].to_pylist()
        if table["key"].to_pylist() != [row_key(self.source, number) for number in numbers]:
            raise ValueError(f"{self.path}: holds other trials than its name says; move it away")
        return set(numbers)

    def missing(self) -> list[int]:
        """Returns the numbers of the wanted trials that are not in the file.

        Raises:
            ValueError: see `present`.
        """
        present = self.present()
        return [number for number in self.numbers if number not in present]


def blocks_of(
    results: Path, source: str, numbers: Iterable[int], *, policy: str, trial_set: str, engine: str
) -> list[Block]:
    """Returns the blocks that hold some trials of a source, in order of their numbers.

    Args:
        results: folder of the sweep.
        source: digest of what decides the trials.
        numbers: of the trials.
        policy: name of its folder, like those that follow.
        trial_set: name.
        engine: name.
    """
    folder = partition(results, policy, trial_set, engine)
    ranges: dict[int, list[int]] = {}
    for number in numbers:
        ranges.setdefault(number // BLOCK, []).append(number)
    return [
        Block(folder / f"{source}_{first * BLOCK:010d}.parquet", source, tuple(sorted(chosen)))
        for first, chosen in sorted(ranges.items())
    ]


def read_block(path: Path, columns: Sequence[str] | None = None) -> pa.Table:
    """Reads some columns of a block; all if None.

    Raises:
        ValueError: if the file is damaged or no block. The message names it.
    """
    with named_parquet_errors(path, "file of trials"):
        return pq.read_table(path, columns=columns, partitioning=None, memory_map=False)


class HeldBlock:
    """A block that this process computes; `held` makes it.

    Attributes:
        block: the block.
        title: of its trials, for the person who waits.
        missing: numbers of the wanted trials that are not in the file yet.
    """

    def __init__(self, block: Block, stack: ExitStack, title: str) -> None:
        self.block, self.title = block, title
        self._stack = stack
        present = block.present()
        self._rows = [read_block(block.path)] if present else []
        self.missing = {number for number in block.numbers if number not in present}
        self._new: list[Row] = []

    def add(self, row: Row) -> None:
        """Adds the row of a missing trial; `write` writes it.

        Raises:
            ValueError: if the trial is not missing.
        """
        if row["trial"] not in self.missing or any(row["trial"] == new["trial"] for new in self._new):
            raise ValueError(f"{self.block.path}: trial {row['trial']} is there already")
        self._new.append({**row, "key": row_key(self.block.source, row["trial"])})

    def write(self) -> int:
        """Writes the added rows and returns their number; lets the block go when no trial is missing.

        Raises:
            OSError: if they cannot be written; what was written before stays, and the rows can be written again.
        """
        if not self._new:
            return 0
        table = pa.concat_tables([*self._rows, pa.Table.from_pylist(self._new, schema=SCHEMA)]).combine_chunks()
        table = table.sort_by("trial")
        sink = pa.BufferOutputStream()
        pq.write_table(table, sink, compression="zstd")
        with named_errors(self.block.path, "the rows that were written before stay"):
            write_atomically(self.block.path, sink.getvalue().to_pybytes())
        count = len(self._new)
        self.missing -= {row["trial"] for row in self._new}
        self._rows, self._new = [table], []
        if not self.missing:
            self.release()
        return count

    def release(self) -> None:
        """Lets the block go."""
        self._stack.close()


def hold(block: Block, title: str = "") -> HeldBlock | None:
    """Holds a block for this process; returns None if another process holds it.

    Raises:
        ValueError: see `Block.present`.
        OSError: if the folder cannot be written.
    """
    block.path.parent.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        try:
            stack.enter_context(locked_file(block.path))
        except BusyError:
            return None
        held = HeldBlock(block, stack, title)
        held._stack = stack.pop_all()
        return held
