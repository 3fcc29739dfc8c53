"""Collects the samples of the topics of the type WrenchStamped while a file of messages is read."""

from __future__ import annotations

import math
import warnings
from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skill.data.files import check_regular, no_access, one_line
from skill.recordings.column_table import ColumnChoice, check_length, select_columns, table_recordings
from skill.recordings.columns import FORCES, MOMENTS, listed
from skill.recordings.messages.bag_metadata import BagMetadata
from skill.recordings.messages.wrench_message import DECODERS, SCHEMAS
from skill.recordings.recording import Recording

MAX_BYTES = 20_000_000_000
"""Largest size of a file; it is read piece by piece."""

STAMP, LOG_TIME = "stamp", "log_time"
"""The two times of a message, as columns: that of its header, and that of logging, s."""

COLUMNS = (LOG_TIME, STAMP, *FORCES, *MOMENTS)
"""What is kept of a message."""

CHECKED_EVERY = 10_000
"""Samples after which the length is checked."""

MAX_JUMP = 60.0
"""By how much the header stamps of two messages may differ more than their times of logging, s; else two clocks made
them. Slow networks and the pace of a simulation differ by less."""

MAX_DISORDER = 0.1
"""By how much later than its successor a message may be logged, s; if it is more, the clock was set back."""

BY_LOG_TIME = f"; --columns time={LOG_TIME} takes the time of logging"

TakeMessage = Callable[[int, bytes], None]
"""Takes the time of logging, ns, and the content of a message; raises a ValueError if it cannot be decoded."""


def check_file(path: Path) -> None:
    """Refuses what is no file, cannot be read, or is too large.

    Raises:
        FileNotFoundError: if there is none.
        PermissionError: if the user may not read it.
        ValueError: if it is no regular file or has more than `MAX_BYTES`.
    """
    size = check_regular(path)
    if size > MAX_BYTES:
        raise ValueError(f"{size / 1e6:.0f} MB, expected a file of at most {MAX_BYTES / 1e6:.0f} MB")
    path.open("rb").close()


@dataclass
class _Samples:
    """The messages of a topic: their numbers, and of which of the sources each is."""

    numbers: array[float] = field(default_factory=lambda: array("d"))
    sources: array[int] = field(default_factory=lambda: array("I"))


class WrenchTopics:
    """The wrench topics of one recording, which may have several files.

    Args:
        wanted: topic to read; None for the only one.
        columns: choices of the user, as of `skill.recordings.columns.choose_columns`, among `COLUMNS`.
    """

    def __init__(self, wanted: str | None, columns: Sequence[str] = ()) -> None:
        self._wanted, self._choices = wanted, list(columns)
        self._topics: dict[str, _Samples] = {}
        self._sources: dict[tuple[str, str], int] = {}  # number of each publisher and frame
        self._others: set[str] = set()
        self._span = math.inf, -math.inf  # of all messages, s

    def open(self, topic: str, schema: str | None, encoding: str, publisher: str) -> TakeMessage | None:
        """Returns what takes the messages of a publisher of a topic; None if its messages are not needed.

        Raises:
            ValueError: if its encoding is unknown.
        """
        if schema not in SCHEMAS or self._wanted not in (None, topic):
            self._others.add(topic)
            return None
        decode = DECODERS.get(encoding)
        if decode is None:
            raise ValueError(f"topic '{topic}' has the encoding '{encoding}', expected {' or '.join(DECODERS)}")
        samples = self._topics.setdefault(topic, _Samples())
        numbers: dict[str, int] = {}  # of the source, by the frame

        def take(logged: int, message: bytes) -> None:
            if len(self._topics) > 1:
                return  # the user has to choose first
            frame, stamp, wrench = decode(message)
            samples.numbers.extend((logged * 1e-9, stamp, *wrench))
            if frame not in numbers:
                numbers[frame] = self._sources.setdefault((publisher, frame.strip("/")), len(self._sources))
            samples.sources.append(numbers[frame])
            if len(samples.sources) % CHECKED_EVERY == 0:
                check_length(len(samples.sources), "the topic")

        return take

    def extend(self, first: int, last: int) -> None:
        """Takes the times of logging, ns, of the first and the last message of a file, whatever their topic."""
        self._span = min(self._span[0], first * 1e-9), max(self._span[1], last * 1e-9)

    def recordings(self, path: Path, metadata: BagMetadata | None = None) -> list[Recording]:
        """Returns the recording of the topic, with the channels fx fy fz mx my mz.

        The time is that of the headers; if no header has one, it is the time of logging. Messages without values (NaN),
        those before the first stamp, and those that are there twice are left out, with a warning. Messages that were
        logged in another order than that of their stamps are sorted.

        Raises:
            ValueError: if there is no topic of this type, or several; if there are several frames, or publishers at the
                same time; if the stamps are of several clocks, go back or repeat; if there are not as many messages as
                the metadata declare; or the samples are no valid recording.
        """
        if len(self._topics) != 1:
            found = f"topics {listed(sorted(self._topics))} of this type; say which one" if self._topics else "none"
            wanted = f"topic '{self._wanted}'" if self._wanted else "a topic"
            raise ValueError(
                f"{path}: expected {wanted} of the type {' or '.join(SCHEMAS)}; found {found}"
                + (f", but other topics {listed(sorted(self._others))}" if self._others and not self._topics else "")
            )
        [(topic, samples)] = self._topics.items()
        if metadata is not None:
            metadata.check_messages(topic, len(samples.sources), max(self._span[1] - self._span[0], 0.0))
        if not samples.sources:
            raise ValueError(f"{path}: topic '{topic}' has no messages")
        where = f"{path}: topic '{topic}'"
        table = pd.DataFrame(np.frombuffer(samples.numbers).reshape(-1, len(COLUMNS)), columns=list(COLUMNS))
        table["source"] = np.asarray(samples.sources)
        table = table.sort_values(LOG_TIME, kind="stable", ignore_index=True)
        table = _without(table, table[[*FORCES, *MOMENTS]].isna().all(axis=1).to_numpy(), "no values (NaN)", where)
        choices = self._choices
        if not any(text.partition("=")[0].strip().lower() == "time" for text in choices):
            choices = [*choices, f"time={STAMP if table[STAMP].any() else LOG_TIME}:s"]
        selection = select_columns(COLUMNS, str(path), ColumnChoice(choices))
        if selection.columns[0].name == STAMP:
            table = _by_stamp(table, where)
        self._check_sources(table, where)
        return table_recordings(
            table, selection, str(path), path.name, row_name=lambda row: f"message {table.index[row]}"
        )

    def _check_sources(self, table: pd.DataFrame, where: str) -> None:
        """Refuses messages of several frames, or of publishers that send at the same time."""
        used = {key for key, number in self._sources.items() if (table["source"] == number).any()}
        frames = sorted({frame for _, frame in used})
        if len(frames) > 1:
            raise ValueError(f"{where} has messages of the frames {listed(frames)}, expected those of one sensor")
        logged = table[LOG_TIME].groupby(table["source"]).agg(["min", "max"]).sort_values("min")
        if (logged["min"].to_numpy()[1:] < np.maximum.accumulate(logged["max"].to_numpy())[:-1]).any():
            names = sorted({publisher for publisher, _ in used})
            raise ValueError(f"{where} has messages of {listed(names)} at the same time, expected one publisher")


def read_parts(
    path: Path,
    read_part: Callable[[Path, WrenchTopics], None],
    damaged: tuple[type[Exception], ...],
    *,
    suffix: str,
    kind: str,
    remedy: str = "",
    topic: str | None = None,
    columns: Sequence[str] = (),
) -> list[Recording]:
    """Reads the recording of a wrench topic from a file, or from a folder of the parts of one recording.

    Args:
        path: the file or folder.
        read_part: reads the messages of all wrench topics of a file.
        damaged: what it may raise for a damaged file.
        suffix: of the parts of a folder.
        kind: what a file is, for messages.
        remedy: what the message of a damaged file ends with.
        topic: see `WrenchTopics`.
        columns: likewise.

    Raises:
        ValueError: if a file cannot be read, and as `WrenchTopics.recordings`.
    """
    metadata = BagMetadata.find(path)
    parts = sorted(path.glob(f"*{suffix}")) if path.is_dir() else [path]
    if metadata is not None:
        metadata.check_parts(parts)
    topics = WrenchTopics(topic, columns)
    for part in parts:
        try:
            read_part(part, topics)
        except (FileNotFoundError, PermissionError) as error:
            raise ValueError(f"{part}: {no_access(error)}") from None
        except damaged as error:
            raise ValueError(f"{part}: not a complete {kind} ({one_line(error)}){remedy}") from error
    return topics.recordings(path, metadata)


def _without(table: pd.DataFrame, out: NDArray[np.bool_], why: str, where: str) -> pd.DataFrame:
    """Leaves messages out, and says so."""
    if not out.any():
        return table
    warnings.warn(f"{where}: {out.sum()} of {len(out)} messages left out, which have {why}", UserWarning, stacklevel=2)
    return table[~out]


def _by_stamp(table: pd.DataFrame, where: str) -> pd.DataFrame:
    """Sorts messages, which are in the order of logging, by their stamps, and leaves out those without and repeats."""
    stamps = table[STAMP].to_numpy()
    unset = int(np.argmax(stamps != 0)) if stamps.any() else 0
    if unset > 1 or (unset == 1 and abs(stamps[1]) > 1.0):  # a simulation may begin at 0 s
        table = _without(table, np.arange(len(table)) < unset, f"no time stamp{BY_LOG_TIME}", where)
    stamps, logged = table[STAMP].to_numpy(), table[LOG_TIME].to_numpy()
    steps = np.diff(stamps)
    jumps = np.flatnonzero(~(np.abs(steps - np.diff(logged)) <= MAX_JUMP))
    if jumps.size:
        _refuse(table, jumps, f"jump by {steps[jumps[0]]:.9g} s, to that of another clock,", where)
    table = table.iloc[np.lexsort((table["source"], stamps))]
    logged = table[LOG_TIME].to_numpy()
    if np.any(steps < 0) and (np.maximum.accumulate(logged) - logged).max() > MAX_DISORDER:
        _refuse(table.sort_index(), np.flatnonzero(steps < 0), "go back", where)
    same = table.duplicated([STAMP, *FORCES, *MOMENTS]).to_numpy()
    table = _without(table, same, "the stamp and the values of another", where)
    repeated = np.flatnonzero(np.diff(table[STAMP]) == 0)
    if repeated.size:
        _refuse(table, repeated, "repeat", where)
    return table


def _refuse(table: pd.DataFrame, before: NDArray[Any], what: str, where: str) -> None:
    """Raises the error that the stamps do something wrong after some messages."""
    first, second = table.iloc[before[0]], table.iloc[before[0] + 1]
    raise ValueError(
        f"{where}: the header stamps {what} from {first[STAMP]:.16g} s to {second[STAMP]:.16g} s in message"
        f" {second.name} ({len(before)} such), expected times that increase{BY_LOG_TIME}"
    )
