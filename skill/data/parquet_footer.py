"""Reads how a Parquet file is compressed and to what it unpacks, before anything is unpacked.

PyArrow has properties for this, but it ends the process where a damaged footer holds an unknown compression. The footer
is a structure of Thrift's compact protocol: https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md
and https://github.com/apache/parquet-format/blob/master/src/main/thrift/parquet.thrift.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

COMPRESSIONS = ("UNCOMPRESSED", "SNAPPY", "GZIP", "LZO", "BROTLI", "LZ4", "ZSTD", "LZ4_RAW")
"""Names of the compressions, by their number."""

MAX_DEPTH = 20

MAX_HEADER = 65_536
"""Largest number of bytes of the header of a page; it holds the least and the largest value."""

MAX_PAGES = 200_000
"""Largest number of pages of the columns of a file; PyArrow writes at least some thousand values into each."""


@dataclass(frozen=True)
class ColumnChunk:
    """The part of a column in one row group.

    Attributes:
        rows: number of rows of the row group.
        compression: name of the compression; "unknown" if there is none of this number.
        size: number of bytes in the file.
    """

    rows: int
    compression: str
    size: int


def column_chunks(data: bytes) -> list[ColumnChunk]:
    """Returns the column chunks of a Parquet file.

    Raises:
        ValueError: if the footer is damaged.
    """
    try:
        groups = [(group[3], chunk[3]) for group in _footer(data)[4] for chunk in group[1]]
        return [ColumnChunk(rows, _compression(chunk[4]), chunk[7]) for rows, chunk in groups]
    except (KeyError, IndexError, TypeError) as error:
        raise ValueError(f"damaged footer ({type(error).__name__})") from error


@dataclass(frozen=True)
class UnpackedColumn:
    """What the pages of a column say about their content.

    Attributes:
        size: number of bytes after unpacking.
        values: number of values; more than rows in a column of lists.
    """

    size: int
    values: int


def unpacked_columns(data: bytes) -> dict[str, UnpackedColumn]:
    """Returns what the columns of a Parquet file unpack to, by the names of the outermost columns.

    Raises:
        ValueError: if the footer or the header of a page is damaged, or there are more than ``MAX_PAGES`` pages.
    """
    found: dict[str, UnpackedColumn] = {}
    pages = 0
    try:
        for chunk in (chunk[3] for group in _footer(data)[4] for chunk in group[1]):
            name = chunk[3][0].decode()
            place = min(chunk[9], chunk.get(11) or chunk[9])
            end = place + chunk[7]
            if not 0 <= place <= end <= len(data):
                raise IndexError("a column beyond the end")
            before = found.get(name, UnpackedColumn(0, 0))
            size, values = before.size, before.values
            while place < end:
                reader = _Reader(data[place : min(end, place + MAX_HEADER)])
                page = reader.struct(0)
                content = page.get(5) or page.get(8)  # the header of a data page of version 1 or 2
                if page[2] < 0 or page[3] < 0 or (content and content[1] < 0):
                    raise IndexError("a negative size")
                size, values = size + page[2], values + (content[1] if content else 0)
                place += reader.place + page[3]
                pages += 1
                if pages > MAX_PAGES:
                    raise ValueError(f"more than {MAX_PAGES} pages")
            found[name] = UnpackedColumn(size, values)
    except (KeyError, IndexError, TypeError, AttributeError, UnicodeDecodeError) as error:
        raise ValueError(f"damaged pages ({type(error).__name__})") from error
    return found


def _footer(data: bytes) -> dict[int, Any]:
    """The structure at the end of a file."""
    length = int.from_bytes(data[-8:-4], "little")
    if len(data) < 12 or data[-4:] != b"PAR1" or not 0 < length <= len(data) - 12:
        raise ValueError("no footer of a Parquet file")
    return _Reader(data[-8 - length : -8]).struct(0)


def _compression(number: int) -> str:
    return COMPRESSIONS[number] if 0 <= number < len(COMPRESSIONS) else "unknown"


class _Reader:
    """Reads values of the compact protocol one after the other; an end that comes too early is an IndexError."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._place = 0

    @property
    def place(self) -> int:
        """How many bytes are read."""
        return self._place

    def struct(self, depth: int) -> dict[int, Any]:
        """A structure, by the numbers of its fields."""
        fields: dict[int, Any] = {}
        number = 0
        while head := self._byte():
            number = number + (head >> 4) if head >> 4 else self._integer()
            fields[number] = self._value(head & 15, depth + 1)
        return fields

    def _value(self, kind: int, depth: int) -> Any:
        if depth > MAX_DEPTH:
            raise TypeError("nested too deeply")
        if kind in (1, 2):
            return kind == 1
        if kind == 3:
            return self._byte()
        if kind in (4, 5, 6):
            return self._integer()
        if kind == 7:
            return self._bytes(8)
        if kind == 8:
            return self._bytes(self._varint())
        if kind in (9, 10):
            head = self._byte()
            count = head >> 4 if head >> 4 < 15 else self._varint()
            element = head & 15
            # Truth values take a byte each here, so that every element takes at least one.
            return [self._byte() if element in (1, 2) else self._value(element, depth + 1) for _ in range(count)]
        if kind == 12:
            return self.struct(depth)
        raise TypeError(f"type {kind}")

    def _byte(self) -> int:
        self._place += 1
        return self._data[self._place - 1]

    def _bytes(self, count: int) -> bytes:
        if self._place + count > len(self._data):
            raise IndexError("beyond the end")
        self._place += count
        return self._data[self._place - count : self._place]

    def _varint(self) -> int:
        value = shift = 0
        while True:
            byte = self._byte()
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value
            if shift > 63:
                raise TypeError("an integer of more than 64 bits")

    def _integer(self) -> int:
        value = self._varint()
        return (value >> 1) ^ -(value & 1)
