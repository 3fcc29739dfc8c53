import os

import pytest

from skill.data.files import MARK, UNSEALED, check_seal, read_bounded, seal, write_atomically

FILE = b"some content " + UNSEALED + b" and more"


def test_a_sealed_file_differs_from_the_original_in_its_digest_only():
    sealed = seal(FILE)
    start = FILE.index(UNSEALED) + len(MARK)
    assert sealed[:start] == FILE[:start]
    assert sealed[start + 64 :] == FILE[start + 64 :]
    check_seal(sealed)
    assert sealed == seal(FILE)


def test_every_change_of_a_bit_is_noticed():
    sealed = seal(FILE)
    for place in range(len(sealed)):
        for bit in range(8):
            changed = bytearray(sealed)
            changed[place] ^= 1 << bit
            with pytest.raises(ValueError, match="digest"):
                check_seal(bytes(changed))


def test_a_file_without_a_digest_is_refused_where_it_must_have_one():
    for data in (b"", MARK + b"0" * 63):
        check_seal(data, required=False)
        with pytest.raises(ValueError, match="no SHA-256 digest of the content"):
            check_seal(data)


def test_a_second_digest_is_refused():
    sealed = seal(FILE)
    with pytest.raises(ValueError, match="2 digests, expected one"):
        check_seal(sealed + sealed)


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


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "new" / "a"
    write_atomically(path, b"old")

    def full(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("skill.data.files.os.fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(path.parent.iterdir()) == [path]


def test_only_files_are_read(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path, kind in ((tmp_path, "folder"), (tmp_path / "pipe", "pipe")):
        with pytest.raises(ValueError, match=f"{kind}, expected a file"):
            read_bounded(path, 10)
    with pytest.raises(FileNotFoundError):
        read_bounded(tmp_path / "nowhere", 10)
