"""Reads how a Parquet file is compressed, before anything is unpacked.

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
    length = int.from_bytes(data[-8:-4], "little")
    if len(data) < 12 or data[-4:] != b"PAR1" or not 0 < length <= len(data) - 12:
        raise ValueError("no footer of a Parquet file")
    try:
        footer = _Reader(data[-8 - length : -8]).struct(0)
        groups = [(group[3], chunk[3]) for group in footer[4] for chunk in group[1]]
        return [ColumnChunk(rows, _compression(chunk[4]), chunk[7]) for rows, chunk in groups]
    except (KeyError, IndexError, TypeError) as error:
        raise ValueError(f"damaged footer ({type(error).__name__})") from error


def _compression(number: int) -> str:
    return COMPRESSIONS[number] if 0 <= number < len(COMPRESSIONS) else "unknown"


class _Reader:
    """Reads values of the compact protocol one after the other; an end that comes too early is an IndexError."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._place = 0

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
