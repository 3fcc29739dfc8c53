"""The compression of a Parquet file is read from its footer, as PyArrow reads it; a damaged footer is a ValueError."""

from random import Random

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from skill.data.parquet_footer import COMPRESSIONS, column_chunks


def written(rows=70, **options):
    table = pa.table({name: np.arange(float(rows)) for name in ("time", "a", "truth")})
    table = table.set_column(2, "truth", pa.array([True] * rows)).replace_schema_metadata({"note": "x" * 300})
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, **options)
    return sink.getvalue().to_pybytes()


@pytest.mark.parametrize("compression", ["NONE", "SNAPPY", "GZIP", "BROTLI", "ZSTD", "LZ4"])
def test_chunks_are_those_of_pyarrow(compression):
    data = written(compression=compression, row_group_size=32)
    metadata = pq.ParquetFile(pa.BufferReader(data)).metadata
    groups = [metadata.row_group(k) for k in range(metadata.num_row_groups)]
    expected = [(g.num_rows, g.column(k).total_compressed_size) for g in groups for k in range(3)]
    chunks = column_chunks(data)
    assert [(c.rows, c.size) for c in chunks] == expected
    assert len(chunks) == 9
    named = {"NONE": "UNCOMPRESSED", "LZ4": "LZ4_RAW"}.get(compression, compression)
    assert {c.compression for c in chunks} == {named}


def test_a_file_of_many_columns_is_read():
    table = pa.table({f"c{k}": [1.0] for k in range(40)})
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink)
    assert len(column_chunks(sink.getvalue().to_pybytes())) == 40


def test_an_unknown_compression_is_named_so():
    data = written(compression="SNAPPY")
    place = data.index(b"\x18\x04time\x15\x02") + 7  # in the footer: the path of the column, then its compression
    [first, *others] = column_chunks(data[:place] + bytes([2 * len(COMPRESSIONS)]) + data[place + 1 :])
    assert (first.rows, first.compression) == (70, "unknown")
    assert column_chunks(data[:place] + b"\x01" + data[place + 1 :])[0].compression == "unknown"
    assert {c.compression for c in others} == {"SNAPPY"}


@pytest.mark.parametrize("data", [b"", b"PAR1", b"PAR1" + bytes(8), b"x" * 40 + bytes([200, 0, 0, 0]) + b"PAR1"])
def test_a_file_without_a_footer_is_refused(data):
    with pytest.raises(ValueError, match="no footer"):
        column_chunks(data)


def test_a_damaged_footer_is_refused_or_read_but_never_another_error():
    data, refused = written(), 0
    start = len(data) - 8 - int.from_bytes(data[-8:-4], "little")
    rng = Random(0)
    for _ in range(2000):
        place = rng.randrange(start, len(data))
        try:
            column_chunks(data[:place] + rng.randbytes(1) + data[place + 1 :])
        except ValueError:
            refused += 1
    assert refused > 100


def test_deep_nesting_is_refused():
    footer = b"\x1c" * 5000
    with pytest.raises(ValueError, match="damaged footer"):
        column_chunks(b"PAR1" + footer + len(footer).to_bytes(4, "little") + b"PAR1")
