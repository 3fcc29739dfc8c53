"""Seeded mutations of stored files: of their bytes, and of what they hold, with a new digest."""

from __future__ import annotations

import io
import json
import struct
import zipfile
from collections.abc import Callable
from random import Random
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from skill.data.files import MARK, UNSEALED, seal
from tests.crafted_files import sealed_archive, sealed_arrays, sealed_parquet

ODD_VALUES: list[Any] = [
    *(None, True, False, 0, -1, 1, 2, 99, 10**9, 10**400, 0.5, -0.5, 1e-300, 1e300, -1e300),
    *(float("nan"), float("inf"), -float("inf"), "", "false", "1", "\0", "é" * 50, "<!--<script>", "x" * 10_000),
    *([], [1], [[]], ["a", 1], {}, {"a": 1}, {"": None}, [[[[[[[[]]]]]]]]),
]
"""What a forger may put in the place of an entry."""

ODD_NUMBERS = [0.0, -0.0, -1.0, 1.0, 3.5, 1e-320, 1e12, -1e12, 1e300, -1e300, np.nan, np.inf, -np.inf]

# fmt: off
ODD_TEXTS = [
    "1e10", ".nan", ".inf", "-1", "0", "0.0", "1e300", "1e-300", "9" * 400, "0x10", "1_000", "010", "yes", "null", "~",
    "''", '"', "[", "}", "[]", "{}", "[1, 2]", "[" * 3000, "{a: 1}", "- 1", "*a", "&a 1", "&a [*a]", "2026-01-01", "|",
    "!!python/object/apply:os.getcwd []", "!!binary aGk=", "!!float x", "%", "@", "\t1", "a: b: c", "? 1", "---", "...",
    "#", "<<: 1", "\ufeff", "\u2028", "\udcff", "\0",
]
# fmt: on
"""What may stand in the place of a value of a scenario."""


# ----------------------------------------------------------------- any bytes


def flip_bit(data: bytes, rng: Random) -> bytes:
    """One bit is inverted."""
    k = rng.randrange(len(data))
    return data[:k] + bytes([data[k] ^ (1 << rng.randrange(8))]) + data[k + 1 :]


def truncate(data: bytes, rng: Random) -> bytes:
    """The end is lost."""
    return data[: rng.choice([rng.randrange(len(data)), len(data) - rng.randint(1, 80)])]


def insert(data: bytes, rng: Random) -> bytes:
    """Some bytes are inserted."""
    place = rng.randint(0, len(data))
    return data[:place] + rng.randbytes(rng.randint(1, 40)) + data[place:]


def replace_block(data: bytes, rng: Random) -> bytes:
    """A block is lost, zero (as after a failed write), random, or a copy of another one."""
    start = rng.randrange(len(data))
    end = min(len(data), start + rng.choice([1, 4, 16, 64, 512, 4096]))
    size, other = end - start, rng.randint(0, len(data) - (end - start))
    return data[:start] + rng.choice([b"", bytes(size), rng.randbytes(size), data[other : other + size]]) + data[end:]


BYTES = (flip_bit, truncate, insert, replace_block)


# --------------------------------------------------------- with a new digest


def forged(data: bytes, rng: Random) -> bytes:
    """Bytes are changed as above, and the digest is made anew."""
    blanked = _without_digest(data)
    for _ in range(20):
        try:
            return seal(rng.choice(BYTES)(blanked, rng))
        except ValueError:  # the place of the digest was hit
            continue
    return data


def parquet_header(data: bytes, rng: Random) -> bytes:
    """An entry of the header is replaced, lost or new."""
    table, kind, header = _parquet(data)
    _change_entry(header, rng)
    return _parquet_of(table, kind, header)


def parquet_value(data: bytes, rng: Random) -> bytes:
    """Some numbers of a column are odd."""
    table, kind, header = _parquet(data)
    frame = table.to_pandas()
    column = rng.choice(list(frame.columns))
    for _ in range(rng.choice([1, 1, 3])):
        frame.loc[rng.randrange(len(frame)), column] = rng.choice(ODD_NUMBERS)
    if rng.random() < 0.3:
        frame[column] *= rng.choice([1e3, 1e-3, -1.0, 57.3, 0.0])
    return _parquet_of(pa.Table.from_pandas(frame, preserve_index=False), kind, header)


def parquet_column(data: bytes, rng: Random) -> bytes:
    """A column has another type, another name, is lost, new or there twice; or rows are lost."""
    table, kind, header = _parquet(data)
    k, n = rng.randrange(table.num_columns), table.num_rows
    name = table.column_names[k]
    columns = {
        "truth": pa.array([True] * n),
        "text": pa.array(["1.0"] * n),
        "list": pa.array([[1.0]] * n),
        "large": pa.array([2**64 - 1] * n, pa.uint64()),
        "nulls": pa.nulls(n, pa.float64()),
        "time": pa.array(range(n), pa.timestamp("ns")),
        "dictionary": pa.array([1.0] * n).dictionary_encode(),
    }
    how = rng.choice([*columns, "lost", "renamed", "twice", "no rows", "one row", "reversed"])
    if how in columns:
        table = table.set_column(k, name, columns[how])
    elif how == "lost":
        table = table.remove_column(k)
    elif how == "renamed":
        table = table.rename_columns([rng.choice(["", "é", "x" * 999]) if c == name else c for c in table.column_names])
    elif how == "twice":
        table = table.append_column(name, table.column(k))
    else:
        rows = {"no rows": [], "one row": [0], "reversed": range(n - 1, -1, -1)}[how]
        table = table.take(pa.array(rows, pa.int64()))
    return _parquet_of(table, kind, header)


def archive_header(data: bytes, rng: Random) -> bytes:
    """An entry of the header of a skill is replaced, lost or new."""
    arrays = _arrays(data)
    header = json.loads(arrays["header"].tobytes())
    _change_entry(header, rng)
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    return sealed_arrays(arrays)


def archive_value(data: bytes, rng: Random) -> bytes:
    """Some numbers of an array are odd."""
    arrays = _arrays(data)
    name = rng.choice([n for n, a in arrays.items() if a.dtype.kind in "iuf"])
    array = arrays[name].copy()
    for _ in range(rng.choice([1, 1, 5])):
        with np.errstate(invalid="ignore", over="ignore"):
            array[tuple(rng.randrange(n) for n in array.shape)] = np.array(rng.choice(ODD_NUMBERS)).astype(array.dtype)
    arrays[name] = array
    return sealed_arrays(arrays)


def archive_array(data: bytes, rng: Random) -> bytes:
    """An array has another shape or type, is lost, new or exchanged for another one."""
    arrays = _arrays(data)
    name, other = rng.choice(list(arrays)), rng.choice(list(arrays))
    array = arrays[name]
    changes: list[Callable[[], Any]] = [
        lambda: array[..., None],
        lambda: array.ravel()[:-1],
        lambda: array.T,
        lambda: array.astype("U8"),
        lambda: array.astype(bool),
        lambda: array.astype(complex) if array.dtype.kind in "iuf" else array,
        lambda: np.array([{"a": 1}], dtype=object),
        lambda: np.zeros(3, dtype=[("a", "f8")]),
        lambda: np.array(rng.choice(ODD_NUMBERS)),
        lambda: np.array("[" * 50_000),
        lambda: arrays[other],
    ]
    how = rng.randrange(len(changes) + 2)
    if how < len(changes):
        with np.errstate(all="ignore"):
            arrays[name] = changes[how]()
    elif how == len(changes):
        del arrays[name]
    else:
        arrays[rng.choice(["zeal", "regressor/zeal", "soul/", "/", "é"])] = array
    return sealed_arrays(arrays)


def archive_member(data: bytes, rng: Random) -> bytes:
    """The bytes of a member of a valid archive are changed, most of the time those that say how large the array is."""
    members = _members(data)
    name = rng.choice(list(members))
    part = members[name][:128] if rng.random() < 0.7 else members[name]
    members[name] = rng.choice(BYTES)(part, rng) + members[name][len(part) :]
    return sealed_archive(members, rng.choice([zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED, zipfile.ZIP_BZIP2]))


def archive_shape(data: bytes, rng: Random) -> bytes:
    """A member declares another shape or type than it has."""
    members = _members(data)
    name = rng.choice(list(members))
    shapes = ["(999999999999,)", "(9999, 9999, 9999)", "(-1,)", "(0, 5)", "()", "(1e9,)", "(True,)", "[3]", "(2**70,)"]
    types = ["<f8", "|O", "|V0", "<U999999999", "|V2147483647", "<M8[ns]", "<c16", "(99999,99999)f8", "", "q", "<f7"]
    text = f"{{'descr': {rng.choice(types)!r}, 'fortran_order': False, 'shape': {rng.choice(shapes)}, }}\n"
    members[name] = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode() + members[name][128:]
    return sealed_archive(members)


def archive_bomb(data: bytes, rng: Random) -> bytes:
    """A member unpacks to far more than the file has."""
    members = _members(data)
    members[rng.choice(list(members))] = bytes(rng.choice([30_000_000, 150_000_000]))
    return sealed_archive(members)


# ------------------------------------------------------------------ scenario


def scenario_value(data: bytes, rng: Random) -> bytes:
    """A value is replaced by something odd."""
    lines = data.decode().split("\n")
    k = rng.choice([n for n, line in enumerate(lines) if ":" in line and not line.startswith("#")])
    lines[k] = lines[k].split(":")[0] + ": " + rng.choice(ODD_TEXTS)
    return "\n".join(lines).encode(errors="surrogateescape")


def scenario_lines(data: bytes, rng: Random) -> bytes:
    """Lines are lost, repeated, moved, indented or foreign."""
    lines = data.decode().split("\n")
    k = rng.randrange(len(lines))
    how = rng.choice(["lost", "twice", "moved", "indented", "foreign", "deep", "laughs"])
    if how == "lost":
        del lines[k]
    elif how in ("twice", "moved"):
        lines.insert(rng.randrange(len(lines)), lines[k] if how == "twice" else lines.pop(k))
    elif how == "indented":
        lines[k] = rng.choice(["  ", "\t", ""]) + lines[k].lstrip()
    elif how == "foreign":
        lines.insert(k, f"{rng.choice(['zeal', '1', 'null', '? [a]', 'start'])}: {rng.choice(ODD_TEXTS)}")
    elif how == "deep":
        lines = [lines[0], "seed: " + rng.choice("[{") * rng.choice([50, 5000])]
    else:
        lines += [f"l{n}: &l{n} [{', '.join([f'*l{n - 1}' if n else '1'] * 9)}]" for n in range(9)]
    return "\n".join(lines).encode(errors="surrogateescape")


# ------------------------------------------------------------------- helpers


def _without_digest(data: bytes) -> bytes:
    start = data.index(MARK)
    return data[:start] + UNSEALED + data[start + len(UNSEALED) :]


def _parquet(data: bytes) -> tuple[pa.Table, str, Any]:
    table = pq.read_table(pa.BufferReader(data))
    [kind] = [name for name in table.schema.metadata if name in (b"demonstration", b"rig_run")]
    return table, kind.decode(), json.loads(table.schema.metadata[kind])


def _parquet_of(table: pa.Table, kind: str, header: Any) -> bytes:
    return sealed_parquet(table, {kind: json.dumps(header)})


def _members(data: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def _arrays(data: bytes) -> dict[str, Any]:
    with np.load(io.BytesIO(data)) as stored:
        return dict(stored)


def _change_entry(header: dict[str, Any], rng: Random) -> None:
    """Replaces, removes or adds an entry of a tree of objects and lists."""
    place: Any = header
    while True:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        if not keys:
            return
        key = rng.choice(keys)
        if not (isinstance(place[key], dict | list) and place[key] and rng.random() < 0.7):
            break
        place = place[key]
    how = rng.random()
    if how < 0.7:
        place[key] = rng.choice(ODD_VALUES)
    elif how < 0.85:
        del place[key]
    elif isinstance(place, dict):
        place[rng.choice(["zeal", "", "format_version", "skill_version"])] = rng.choice(ODD_VALUES)
