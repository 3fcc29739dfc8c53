"""`correct --live`: a real page in a real browser, and the command in a process of its own."""

import time

import numpy as np
import psutil
import pytest

from experiments.corrections import CorrectionPlan, begins_in, demonstrate_correction, run_practice
from experiments.outputs.folder_lock import LOCK_NAME
from models.scenario import load_scenario
from skill.data.demonstration import read_demonstrations
from skill.manipulation_skill import ManipulationSkill
from tests.campaign import is_alive
from tests.interfaces.live.live_session import press, served, text_of, wait_for_text
from tests.interfaces.live.people import insert_by_feel
from tests.query_states import write_stuck_skill

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def place(tmp_path_factory, demonstration_folder):
    folder = tmp_path_factory.mktemp("correction_session")
    write_stuck_skill(folder, demonstration_folder, time_limit=3.0)
    return folder


def sit(place, tmp_path, demonstration_folder, *, practice=1):
    """Runs the command; it writes into ``tmp_path``."""
    return served(
        tmp_path,
        *(
            "haptic_skill",
            "correct",
            "--live",
            "--skill",
            place / "straight.npz",
            "--demonstrations",
            demonstration_folder,
        ),
        *("--out", tmp_path / "better.npz", "--corrections", tmp_path / "live", "--scenario", place / "quick.yaml"),
        *("--practice", practice, "--most", 1, "--jobs", 2),
    )


def hole(picture):
    return picture[300:420, 400:700].astype(int)


@pytest.mark.nightly
@pytest.mark.browser
def test_a_skill_practises_is_shown_learns_and_performs_on_one_page(place, tmp_path, demonstration_folder):
    """The tab is closed once in the middle, and the command is given again at the end."""
    out = tmp_path / "live"
    with sit(place, tmp_path, demonstration_folder) as session:
        with session.page() as page:
            shown = r"show me: 1 of 1, stuck at [0-9.]+ mm, [0-9.]+°, .*; Space starts"
            wait_for_text(page, "status", shown, timeout=120.0)
            press(page, " ")
            session.wait_for("recording:")
        session.wait_for("the page was closed: demonstration discarded")
        with session.page() as page:
            wait_for_text(page, "status", "the page was closed")
            page.wait("document.body.innerText.includes('skip the pose')")
            insert_by_feel(page)
            wait_for_text(page, "status", "^inserted.*: G keep as good")
            before = page.screenshot()
            press(page, "g")
            session.wait_for("kept 000_good_live.parquet")
            assert [path.name for path in out.glob("*.parquet")] == ["000_good_live.parquet"]
            wait_for_text(page, "status", "the skill learns from what you have shown")
            wait_for_text(page, "status", "rig 1 of 1: [0-9.]+ s, load [0-9]+ N; before: stuck at")
            assert float(text_of(page, "contact-limit").removesuffix(" N")) > 0.0
            assert text_of(page, "skill-state")
            wait_for_text(
                page, "status", r"rig 1 of 1: inserted in [0-9.]+ s; before: stuck at [0-9.]+ mm. Space: again"
            )
            assert np.abs(hole(page.screenshot()) - hole(before)).max() > 20  # the block is turned
            press(page, " ")
            session.wait_for("with the new skill[\\s\\S]*with the new skill")
            press(page, "q")
            assert session.process.wait(30) == 0
    learnt = ManipulationSkill.load(tmp_path / "better.npz")
    assert learnt.metadata_["demonstrations"] == len(read_demonstrations(demonstration_folder)) + 1
    with sit(place, tmp_path, demonstration_folder) as session, session.page() as page:
        session.wait_for("live holds 1 corrections, 1 good; the skill learns from them too")
        session.wait_for("1 of 1 query states are shown already")
        wait_for_text(page, "status", "rig 1 of 1: inserted")
        press(page, "q")
        assert session.process.wait(30) == 0


@pytest.mark.nightly
@pytest.mark.browser
def test_to_quit_during_practice_leaves_no_process_and_no_file(place, tmp_path, demonstration_folder):
    with sit(place, tmp_path, demonstration_folder, practice=200) as session, session.page() as page:
        wait_for_text(page, "status", "the skill practises: [1-9][0-9]* of 200 trials done, stuck in [0-9]+")
        workers = psutil.Process(session.process.pid).children()
        assert len(workers) >= 2
        press(page, "q")
        assert session.process.wait(20) == 0
        wait_for_text(page, "status", "session over")
        end = time.monotonic() + 5.0
        while any(is_alive(worker) for worker in workers):
            assert time.monotonic() < end
            time.sleep(0.1)
    assert not (tmp_path / "better.npz").exists()
    assert not (tmp_path / "live" / LOCK_NAME).exists()


@pytest.mark.nightly
def test_a_recording_begins_in_the_query_state_that_it_was_made_for(place, demonstration_folder):
    scenario = load_scenario(place / "quick.yaml")
    skill = ManipulationSkill.load(place / "straight.npz")
    plan = CorrectionPlan(rounds=1, trials=2, most=2, seed=0)
    one, other = (query_state for _, query_state in run_practice(scenario, skill, plan.numbers(1), jobs=1))
    shown = demonstrate_correction(scenario, one, number=0, seed=5)
    assert begins_in(shown, one, scenario)
    assert not begins_in(shown, other, scenario)
    assert not begins_in(read_demonstrations(demonstration_folder)[0], one, scenario)
