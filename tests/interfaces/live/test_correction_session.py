"""The page of a live correction session, in this process: what it asks for, skips, watches and says."""

import time
from dataclasses import replace
from types import SimpleNamespace

import pytest

from interfaces.live.controls import LiveControls
from interfaces.live.correction_session import SKIP, CorrectionSession, PersonLeftError, course
from interfaces.live.messages import Outbox
from interfaces.live.session import QUIT, START
from interfaces.live.viewer_scene import ViewerScene
from models.scenario import load_scenario
from skill.data.outcome import Outcome
from tests.query_states import QUERY_STATE

OTHER = replace(QUERY_STATE, tilt=(-0.01, 0.02), depth=0.006)


class OpenPage:
    """Replaces the page: nobody looks at it, and it keeps all messages."""

    address, is_shown = "http://localhost:1", True

    def __init__(self):
        self.values, self.messages = {}, []
        outbox = Outbox()
        self.scene, self.controls = ViewerScene(outbox), LiveControls(outbox)

    def show(self, **values):
        self.values |= values
        self.messages += [values["status"]] if "status" in values else []

    def click(self, label):
        self.controls._clicked.add(label)


@pytest.fixture
def page():
    return OpenPage()


@pytest.fixture
def dut(page, tmp_path):
    return CorrectionSession(
        scenario=load_scenario("live"), seed=0, out=tmp_path, page=page, announce=lambda _: None, absence_limit=0.3
    )


def at_each_wait(monkeypatch, *steps):
    """Lets a person do a step at each pause of the page between two looks at the buttons."""
    left = iter(steps)
    clock = SimpleNamespace(monotonic=time.monotonic, sleep=lambda _: next(left)())
    monkeypatch.setattr("interfaces.live.session.time", clock)


def judged(good):
    return SimpleNamespace(good=good, metadata={"number": 0})


def test_the_query_states_are_asked_for_in_turn_and_one_can_be_skipped(dut, page, monkeypatch):
    monkeypatch.setattr("interfaces.live.session.write_demonstration", lambda *_: None)
    starts = []
    draw = dut._display.draw_start
    monkeypatch.setattr(
        dut._display, "draw_start", lambda scenario: (starts.append(scenario.start.tilt), draw(scenario))
    )
    at_each_wait(
        monkeypatch,
        lambda: dut._keep(judged(False)),  # a bad one does not answer the question
        lambda: dut._keep(judged(True)),
        lambda: page.click(SKIP),
    )
    dut.show_query_states([QUERY_STATE, OTHER])
    asked = [message for message in page.messages if message.startswith("show me")]
    first = "show me: 1 of 2, stuck at 4.0 mm, 1.4°, against the wall; Space starts"
    assert asked == [first, first, "show me: 2 of 2, stuck at 6.0 mm, 1.3°, against the wall; Space starts"]
    assert list(QUERY_STATE.tilt) == starts[0]
    assert list(OTHER.tilt) in starts
    assert [path.name for path in dut.kept] == ["000_bad_live.parquet", "000_good_live.parquet"]


def test_the_keys_count_only_between_demonstrations_and_not_from_before(dut, page, monkeypatch):
    begun = []

    def record():
        begun.append(True)
        page.click(SKIP)
        return False

    monkeypatch.setattr(dut, "_record_one", record)
    for label in (SKIP, START):
        page.click(label)
    at_each_wait(monkeypatch, lambda: page.click(START), lambda: None, lambda: page.click(QUIT))
    with pytest.raises(PersonLeftError):
        dut.show_query_states([QUERY_STATE])
    assert (dut._place, begun) == (0, [True])


def test_work_is_shown_and_ends_when_the_person_quits_or_stays_away(dut, page):
    dut.begin_work("learning")
    assert (page.messages[-1], page.values["phase"]) == ("learning", "busy")
    page.click(QUIT)
    with pytest.raises(PersonLeftError):
        dut.show_note("still learning")
    page.is_shown = False
    dut.show_note("a closed page may be opened again")
    time.sleep(0.4)
    with pytest.raises(PersonLeftError):
        dut.show_note("nobody is there")


def result(outcome, time=2.34, reason="drive fault: no current"):
    return SimpleNamespace(outcome=outcome, inserted=outcome is Outcome.INSERTED, time=time, reason=reason)


@pytest.mark.parametrize(
    ("outcome", "stuck", "text"),
    [
        (Outcome.INSERTED, None, "inserted in 2.3 s"),
        (Outcome.INSERTED, QUERY_STATE, "stuck at 4.0 mm, inserted in 2.3 s"),
        (Outcome.JAMMED, QUERY_STATE, "stuck at 4.0 mm"),
        (Outcome.TIME_OVER, QUERY_STATE, "stuck at 4.0 mm"),
        (Outcome.FAULT, QUERY_STATE, "stuck at 4.0 mm, drive fault: no current"),
    ],
)
def test_a_trial_is_told_in_a_few_words(outcome, stuck, text):
    assert course(result(outcome), stuck) == text


def test_a_demonstration_that_cannot_be_written_leaves_its_query_state_open(dut, page, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("interfaces.live.session.write_demonstration", fail)
    dut._asked = [QUERY_STATE]
    assert dut._keep(judged(True)) is False
    assert dut._is_complete() is False
    assert dut.kept == []
