"""The published scoreboard, ladder, curves and sets are what the command makes of the published trials."""

import shutil

import pytest

from tests.scripts.commands import ROOT, invoke


@pytest.mark.parametrize("name", ["scoreboard", "ladder", "curves", "sets"])
def test_the_tables_are_those_of_the_published_trials(name, tmp_path, monkeypatch):
    shutil.copytree(ROOT / "docs" / name, tmp_path / "docs" / name)
    monkeypatch.chdir(tmp_path)
    done = invoke("scoreboard", f"docs/{name}", "--out", "page.html", "--markdown", f"docs/{name}.md")
    assert done.exit_code == 0, done.output
    made = (tmp_path / "docs" / f"{name}.md").read_text()
    assert made == (ROOT / "docs" / f"{name}.md").read_text()
