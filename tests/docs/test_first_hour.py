"""The page of the first hour: its commands run, and a script presses the keys of its pages in a real browser."""

import json
import re
import shlex

import pytest
from selenium.webdriver.common.keys import Keys

from skill.data.demonstration import read_demonstrations
from tests.checkout import ROOT
from tests.interfaces.live.live_session import FLAWS, press, served, text_of, wait_for_text
from tests.interfaces.live.people import insert_by_feel, push
from tests.scripts.commands import HAPTIC_SKILL, run_python

SCREEN = (1280, 720)
METRICS = {"width": SCREEN[0], "height": SCREEN[1], "deviceScaleFactor": 1, "mobile": False}
BAD = 5  # every so many demonstrations the person pushes a tilted peg, up to `ROUGH` N
ROUGH = 25.0
ASKED = 600.0  # s until a skill has practised, or learnt
COMMANDS = [
    shlex.split(line)
    for line in re.findall(r"^    haptic-skill (.*)$", (ROOT / "docs" / "first_hour.md").read_text(), flags=re.M)
]


def test_the_page_records_trains_corrects_and_inserts():
    assert [command[0] for command in COMMANDS] == ["record", "train", "correct", "rig", "replay"]


def look(page):
    """Fails where the page hides or cuts off something."""
    assert page.run(FLAWS) == [], text_of(page, "status")


def record(session, page):
    """Gives ten demonstrations; each fifth one is bad."""
    wait_for_text(page, "status", "ready: press Space")
    press(page, Keys.ESCAPE)  # no guide
    for k in range(1, 11):
        look(page)
        if k % BAD:
            insert_by_feel(page)
            wait_for_text(page, "status", "inserted.*: G keep as good")
        else:
            push(page, ROUGH)
        look(page)
        press(page, "g" if k % BAD else "b")
        session.wait_for(rf"kept {k - 1:03d}_")
    press(page, "q")


def correct(session, page):
    """Shows what the skill asks for, and sees it perform."""
    wait_for_text(page, "status", "the skill practises|show me", timeout=60.0)
    press(page, Keys.ESCAPE)
    while True:
        wait_for_text(page, "status", "show me: [0-9]|learns|rig [0-9]|session over|never stuck", timeout=ASKED)
        asked = text_of(page, "status")
        if "show me" not in asked:
            break
        look(page)
        insert_by_feel(page)
        wait_for_text(page, "status", "inserted.*: G keep as good")
        press(page, "g")
        page.wait(f"document.getElementById('status').textContent !== {asked!r}")
    wait_for_text(page, "status", "Space:", timeout=ASKED)  # the rig has performed
    look(page)
    press(page, "q")


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.browser
@pytest.mark.timeout(1800)
def test_who_follows_the_page_has_an_own_skill_that_inserts(tmp_path):
    folder = tmp_path / "hour"
    folder.mkdir()
    for command in COMMANDS:
        if "--live" in command:
            with served(tmp_path, "haptic_skill", *command, cwd=folder) as session, session.page(SCREEN) as page:
                page.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", METRICS)  # without a frame
                (record if command[0] == "record" else correct)(session, page)
                session.process.wait(30)
        else:
            done = run_python(*HAPTIC_SKILL, *command, cwd=folder, timeout=900)
            assert done.returncode == 0, done.stderr
    assert [d.good for d in read_demonstrations(folder / "out" / "live")] == [True, True, True, True, False] * 2
    trials = json.loads((folder / "out" / "my_rig" / "results.json").read_text())
    assert sum(trial["inserted"] for trial in trials) > len(trials) / 2
