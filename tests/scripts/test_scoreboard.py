"""The command scoreboard, from a folder of results to the page and the table."""

import pytest

from tests.experiments.scoreboard.simulated_trials import LAW, LEARNT, write_results
from tests.scripts.commands import files, invoke


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
