"""Folders that are made as a whole."""

import pytest

from experiments.outputs.new_folder import STAGED, new_folder


def make(out, text="new", **options):
    with new_folder(out, **options) as staged:
        (staged / "in").mkdir()
        (staged / "in" / "a.txt").write_text(text)


def own(folder):
    return {"in/a.txt"} if (folder / "in" / "a.txt").exists() else None


def test_the_folder_is_there_at_the_end(tmp_path):
    out = tmp_path / "x" / "out"
    with new_folder(out) as staged:
        (staged / "a.txt").write_text("a")
        assert not out.exists()
    assert [p.name for p in (tmp_path / "x").iterdir()] == ["out"]
    assert [p.name for p in out.iterdir()] == ["a.txt"]


def test_only_an_empty_folder_and_an_own_one_are_replaced(tmp_path):
    (tmp_path / "out").mkdir()
    make(tmp_path / "out")
    with pytest.raises(ValueError, match=r"out: holds in/a\.txt, which is not replaced"):
        make(tmp_path / "out", "newer")
    make(tmp_path / "out", "newer", files_of=own)
    assert (tmp_path / "out/in/a.txt").read_text() == "newer"
    (tmp_path / "out/mine.txt").write_text("mine")
    with pytest.raises(ValueError, match=r"holds mine\.txt, which is not replaced"):
        make(tmp_path / "out", "newest", files_of=own)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out"]


def test_files_and_links_are_refused(tmp_path):
    (tmp_path / "out").write_text("a file")
    with pytest.raises(ValueError, match="is there and no folder"):
        make(tmp_path / "out")
    (tmp_path / "out").unlink()
    (tmp_path / "there").mkdir()
    (tmp_path / "out").symlink_to("there")
    with pytest.raises(ValueError, match="is there and no folder"):
        make(tmp_path / "out")


@pytest.mark.parametrize("name", ["out", "[out]*"])
def test_what_a_killed_or_failed_process_left_is_removed_and_the_old_folder_stays(tmp_path, name):
    make(tmp_path / name)
    (tmp_path / f".{name}{STAGED}" / "half").mkdir(parents=True)
    with pytest.raises(OSError, match="no"), new_folder(tmp_path / name, files_of=own):
        raise OSError("no")
    assert [p.name for p in tmp_path.iterdir()] == [name]
    assert (tmp_path / name / "in/a.txt").read_text() == "new"
