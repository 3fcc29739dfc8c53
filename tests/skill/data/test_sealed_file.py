import os

import pytest

from skill.data.sealed_file import MARK, UNSEALED, is_sealed, read_bounded, seal

FILE = b"some content " + UNSEALED + b" and more"


def test_a_sealed_file_differs_from_the_original_in_its_digest_only():
    sealed = seal(FILE)
    start = FILE.index(UNSEALED) + len(MARK)
    assert sealed[:start] == FILE[:start]
    assert sealed[start + 64 :] == FILE[start + 64 :]
    assert is_sealed(sealed)
    assert sealed == seal(FILE)


def test_every_change_of_a_bit_is_noticed():
    sealed = seal(FILE)
    mark = range(FILE.index(MARK), FILE.index(MARK) + len(MARK) + 64)
    for place in range(len(sealed)):
        for bit in range(8):
            changed = bytearray(sealed)
            changed[place] ^= 1 << bit
            # A damaged mark is none, so that the file carries no digest.
            assert refused(bytes(changed)) or (place in mark and not is_sealed(bytes(changed)))


def refused(data):
    try:
        is_sealed(data)
    except ValueError:
        return True
    return False


def test_a_file_without_a_digest_is_not_sealed():
    assert not is_sealed(b"")
    assert not is_sealed(MARK + b"0" * 63)


def test_zeros_are_no_digest():
    with pytest.raises(ValueError, match="differs from its SHA-256 digest"):
        is_sealed(FILE)


def test_a_second_digest_is_refused():
    sealed = seal(FILE)
    with pytest.raises(ValueError, match="2 digests, expected one"):
        is_sealed(sealed + sealed)


@pytest.mark.parametrize("data", [b"nothing", FILE + FILE, seal(FILE), FILE + MARK + b"a" * 64])
def test_only_a_file_with_one_empty_place_is_sealed(data):
    with pytest.raises(ValueError, match="expected one with zeros"):
        seal(data)


def test_the_size_of_a_file_is_limited(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"12345")
    assert read_bounded(path, 5) == b"12345"
    with pytest.raises(ValueError, match="expected at most 0 MB"):
        read_bounded(path, 4)


def test_only_files_are_read(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path, kind in ((tmp_path, "folder"), (tmp_path / "pipe", "pipe")):
        with pytest.raises(ValueError, match=f"{kind}, expected a file"):
            read_bounded(path, 10)
    with pytest.raises(FileNotFoundError):
        read_bounded(tmp_path / "nowhere", 10)
