"""The compression of a Parquet file is read from its footer, as PyArrow reads it; a damaged footer is a ValueError."""

from random import Random

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from skill.data import parquet_footer
from skill.data.parquet_footer import COMPRESSIONS, column_chunks, unpacked_columns


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


@pytest.mark.parametrize("compression", ["NONE", "SNAPPY", "ZSTD"])
@pytest.mark.parametrize("version", ["1.0", "2.0"])
@pytest.mark.parametrize("dictionary", [True, False])
def test_columns_unpack_to_what_pyarrow_says(compression, version, dictionary):
    rows = 3000
    numbers = np.random.default_rng(0).normal(size=(2, rows))
    lists, pairs = numbers.T.tolist(), [{"f": x, "g": y} for x, y in numbers.T]
    table = pa.table({"a": numbers[0], "b": [f"{x}" for x in numbers[0]], "c.d": lists, "e": pairs})
    sink = pa.BufferOutputStream()
    options = {"compression": compression, "data_page_version": version, "use_dictionary": dictionary}
    pq.write_table(table, sink, row_group_size=800, data_page_size=999, **options)
    data = sink.getvalue().to_pybytes()
    found = unpacked_columns(data)
    values = {name: column.values for name, column in found.items()}
    assert values == {"a": rows, "b": rows, "c.d": 2 * rows, "e": 2 * rows}
    metadata = pq.ParquetFile(pa.BufferReader(data)).metadata
    expected = dict.fromkeys(found, 0)
    for group in (metadata.row_group(k) for k in range(metadata.num_row_groups)):
        for column in (group.column(k) for k in range(group.num_columns)):
            name = next(n for n in expected if column.path_in_schema.startswith(n))
            expected[name] += column.total_uncompressed_size  # with the headers of the pages
    for name, size in expected.items():
        assert 0.9 * size < found[name].size < size


def test_a_page_is_as_large_as_it_claims_to_be():
    data = written(compression="NONE")
    assert data[4:9] == b"\x15\x04\x15\xe0\x08"  # the first page: a dictionary of 560 bytes
    claimed = unpacked_columns(data[:7] + b"\xfe\x7f" + data[9:])["time"].size
    assert claimed - unpacked_columns(data)["time"].size == 8191 - 560
    with pytest.raises(ValueError, match="damaged pages"):
        unpacked_columns(data[:7] + b"\xff\x7f" + data[9:])  # -8192 bytes


def test_too_many_pages_are_refused(monkeypatch):
    monkeypatch.setattr(parquet_footer, "MAX_PAGES", 5)
    with pytest.raises(ValueError, match="more than 5 pages"):
        unpacked_columns(written(row_group_size=32))


@pytest.mark.slow
def test_damaged_pages_are_refused_or_read_but_never_another_error():
    data, refused = written(row_group_size=32), 0
    rng = Random(0)
    for _ in range(3000):
        place = rng.randrange(len(data))
        try:
            unpacked_columns(data[:place] + bytes([rng.randrange(256)]) + data[place + 1 :])
        except ValueError:
            refused += 1
    assert refused > 300
