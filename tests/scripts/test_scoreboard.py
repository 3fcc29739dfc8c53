"""The command scoreboard, from a folder of results to the page and the table."""

import pytest

from tests.experiments.scoreboard.simulated_trials import LAW, LEARNT, write_results
from tests.scripts.commands import HAPTIC_SKILL, error_line, files, invoke, run_python


def scoreboard(*arguments):
    done = invoke("scoreboard", *arguments)
    assert done.exit_code == 0, done.output
    return done


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return write_results(tmp_path_factory.mktemp("results"), count=20)


def test_the_page_is_written_and_the_results_unchanged(results, tmp_path):
    before = files(results)
    done = scoreboard(results, "--out", tmp_path / "a.html")
    assert files(tmp_path) == ["a.html"]
    assert files(results) == before
    assert "scoreboard of 300 trials, compared with CA states, contexts + LWR" in done.stdout
    assert "friction 0.2" in done.stdout
    assert f"{LEARNT} (reference)" in done.stdout
    assert LAW in done.stdout
    scoreboard(results, "--out", tmp_path / "a.html")  # replaces its own


def test_the_table_fits_a_narrow_terminal(results, tmp_path):
    done = run_python(*HAPTIC_SKILL, "scoreboard", results, "--out", tmp_path / "a.html", COLUMNS="80")
    assert done.returncode == 0, done.stderr
    tables = [
        line
        for line in done.stdout.splitlines()
        if not line.startswith(("note:", "scoreboard of", "against,", "open "))
    ]
    assert max(map(len, tables)) <= 80
    assert "…" not in done.stdout


def test_other_files_are_not_replaced(results, tmp_path):
    (tmp_path / "notes.html").write_text("my notes")
    line = error_line(invoke("scoreboard", results, "--out", tmp_path / "notes.html"))
    assert "is not replaced by an HTML page" in line
    assert (tmp_path / "notes.html").read_text() == "my notes"
