"""The page of the first hour: a script does what it says, in a real browser."""

import json

import pytest

from skill.data.demonstration import read_demonstrations
from tests.docs.first_hour import commands, follow


def test_the_page_records_trains_corrects_and_inserts():
    assert [command[0] for command in commands()] == ["record", "train", "correct", "rig", "replay"]


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.browser
@pytest.mark.timeout(1800)
def test_who_follows_the_page_has_an_own_skill_that_inserts(tmp_path):
    folder = tmp_path / "hour"
    follow(folder, tmp_path)
    shown = read_demonstrations(folder / "out" / "live")
    assert [d.good for d in shown] == [True, True, True, True, False] * 2
    assert all((tmp_path / f"first_hour_{name}.webp").stat().st_size > 20_000 for name in ("show", "ask", "rig"))
    trials = json.loads((folder / "out" / "my_rig" / "results.json").read_text())
    assert sum(trial["inserted"] for trial in trials) > len(trials) / 2
    assert list((folder / "out").glob("**/*.html"))
