"""Which skill acts if none is named."""

from pathlib import Path

import pytest

from scripts import command_line
from scripts.command_line import TRAINED, find_skill


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command_line, "SHIPPED", tmp_path / "shipped.npz")
    return tmp_path


def test_a_trained_skill_goes_before_the_shipped_one_which_is_announced(folder, capsys):
    assert find_skill(Path("mine.npz")) == Path("mine.npz")
    with pytest.raises(FileNotFoundError, match="there is no such file; make one with `haptic-skill demo`"):
        find_skill(None)
    (folder / "shipped.npz").touch()
    assert find_skill(None) == folder / "shipped.npz"
    assert "the skill that comes with the program acts" in " ".join(capsys.readouterr().out.split())
    TRAINED.parent.mkdir()
    TRAINED.touch()
    assert find_skill(None) == TRAINED
    assert capsys.readouterr().out == ""
