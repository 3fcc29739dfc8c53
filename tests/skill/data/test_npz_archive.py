"""Archives that are damaged, foreign or larger than they say are refused before they cost memory."""

import io
import zipfile

import numpy as np
import pytest

from skill.data.npz_archive import read_archive
from tests.crafted_files import sealed_archive


def npy(array):
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=True)
    return stream.getvalue()


def zipped(content, name="a.npy", **options):
    return sealed_archive({name: content}, **options)


NUMBERS = np.arange(6.0).reshape(2, 3)


@pytest.mark.parametrize(
    "array",
    [NUMBERS, np.asfortranarray(NUMBERS), np.array(3), np.array("text"), np.array([True]), np.array(["a", "bc"])],
)
@pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_plain_arrays_are_read(array, compression):
    [(name, found)] = read_archive(zipped(npy(array), "part/a.npy", compression=compression)).items()
    assert name == "part/a"
    assert (found.dtype, found.shape) == (array.dtype, array.shape)
    np.testing.assert_array_equal(found, array)
    assert found.flags.writeable


HEADERS = {
    "version": (b"NUMPY\x01", b"NUMPY\x03", "npy version"),
    "huge": (b"(2, 3), }  ", b"(9**99,), }", "malformed node"),
    "large": (b"(2, 3), }        ", b"(2, 300000000), }", r"shape \(2, 300000000\) of float64 in 48 bytes"),
    "truth value": (b"(2, 3), }   ", b"(6, True), }", r"shape \(6, True\), expected whole numbers"),
    "negative": (b"(2, 3)", b"(-2,3)", "damaged npy header|shape"),
    "object": (b"'<f8'", b"'|O8'", "type object, expected numbers"),
    "void": (b"'<f8'", b"'|V8'", "type |V8, expected numbers"),
    "type": (b"'<f8'", b"'<q!'", "descr is not a valid dtype"),
    "missing": (b"'fortran_order'", b"'fortran_ordem'", "keys"),
    "code": (b"'<f8'", b"exit(", "member 'a.npy': "),
}


@pytest.mark.parametrize("damage", HEADERS)
def test_a_damaged_header_of_an_array_is_refused(damage):
    old, new, message = HEADERS[damage]
    content = npy(NUMBERS).replace(old, new.ljust(len(old)))
    with pytest.raises(ValueError, match=message):
        read_archive(zipped(content))


@pytest.mark.parametrize("content", [b"", b"peg in hole", npy(NUMBERS)[:50], npy(NUMBERS)[:-1], npy(NUMBERS) + b"1"])
def test_a_member_that_is_no_array_is_refused(content):
    with pytest.raises(ValueError, match=r"member 'a\.npy': "):
        read_archive(zipped(content))


def test_foreign_and_repeated_members_are_refused():
    with pytest.raises(ValueError, match=r"member 'notes\.txt' is foreign"):
        read_archive(zipped(b"", "notes.txt"))
    with pytest.raises(ValueError, match="101 members, expected at most 100"):
        read_archive(sealed_archive({f"{k}.npy": npy(NUMBERS) for k in range(101)}))
    twice = sealed_archive({"a.npy": npy(NUMBERS), "b.npy": npy(NUMBERS)}).replace(b"b.npy", b"a.npy")
    with pytest.raises(ValueError, match="2 members, expected at most 100, each once"):
        read_archive(twice)


def test_a_damaged_stream_is_refused():
    data = bytearray(zipped(npy(NUMBERS)))
    data[data.index(b"a.npy") + 5] ^= 0xFF
    with pytest.raises(ValueError, match=r"member 'a\.npy' is damaged"):
        read_archive(bytes(data))


def test_a_bomb_is_refused_before_it_is_unpacked():
    bomb = zipped(npy(np.zeros(2_000_000)))
    with pytest.raises(ValueError, match="16 MB of arrays, expected at most 15 MB"):
        read_archive(bomb, max_unpacked=15_000_000)


@pytest.mark.parametrize("data", [b"", b"PK", b"peg in hole", b"PK\x05\x06" + bytes(17)])
def test_what_is_no_archive_is_refused(data):
    with pytest.raises(ValueError, match="not a zip archive"):
        read_archive(data)
