"""The published scoreboard is what the command makes of the published trials."""

import shutil

from tests.scripts.commands import ROOT, invoke


def test_the_tables_are_those_of_the_published_trials(tmp_path, monkeypatch):
    shutil.copytree(ROOT / "docs" / "scoreboard", tmp_path / "docs" / "scoreboard")
    monkeypatch.chdir(tmp_path)
    done = invoke("scoreboard", "docs/scoreboard", "--out", "page.html", "--markdown", "docs/scoreboard.md")
    assert done.exit_code == 0, done.output
    made = (tmp_path / "docs" / "scoreboard.md").read_text()
    assert made == (ROOT / "docs" / "scoreboard.md").read_text()
