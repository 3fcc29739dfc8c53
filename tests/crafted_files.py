"""Files with chosen contents that carry a digest of their own, as a careful forger would write them."""

import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from skill.data.files import UNSEALED, seal


def sealed_parquet(table: pa.Table, metadata: dict[str, str | bytes]) -> bytes:
    """A Parquet file with this table, these metadata and a digest."""
    sink = pa.BufferOutputStream()
    table = table.replace_schema_metadata(None)
    with pq.ParquetWriter(sink, table.schema, store_schema=False) as writer:
        writer.write_table(table)
        writer.add_key_value_metadata({**metadata, "sha256": UNSEALED.decode()})
    return seal(sink.getvalue().to_pybytes())


def rewrite(path: Path, kind: str, change=None, **header) -> Path:
    """Rewrites a file with its table passed through ``change`` and these entries of its header."""
    table = pq.read_table(path)
    old = json.loads(table.schema.metadata[kind.encode()])
    if change is not None:
        table = pa.Table.from_pandas(change(table.to_pandas()), preserve_index=False)
    path.write_bytes(sealed_parquet(table, {kind: json.dumps({**old, **header})}))
    return path


def sealed_archive(members: dict[str, bytes], compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    """A zip archive with these members and a digest."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", compression) as archive:
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(name), data, compression)
        archive.comment = UNSEALED
    return seal(stream.getvalue())


def sealed_arrays(arrays: dict[str, np.ndarray]) -> bytes:
    """An npz archive with these arrays and a digest."""
    members = {}
    for name, array in arrays.items():
        stream = io.BytesIO()
        np.save(stream, array, allow_pickle=True)
        members[f"{name}.npy"] = stream.getvalue()
    return sealed_archive(members)
