import pytest

from skill.data.outcome import Outcome, parse_outcome


@pytest.mark.parametrize("outcome", [o for o in Outcome if o is not Outcome.OTHER])
@pytest.mark.parametrize("detail", ["", "RuntimeError: no solution: none"])
def test_a_stored_text_is_read_back(outcome, detail):
    if outcome is Outcome.FAULT and detail:
        return  # a fault is stored by its own name
    assert parse_outcome(outcome.text(detail)) == (outcome, detail)


@pytest.mark.parametrize("word", ["dropped", "slipped: twice", ""])
def test_the_outcome_of_another_program_is_kept_as_detail(word):
    outcome, detail = parse_outcome(word)
    assert outcome is Outcome.OTHER
    assert detail == word


def test_a_fault_and_an_unknown_outcome_show_their_detail_alone():
    assert Outcome.FAULT.text("motor stalled") == "motor stalled"
    assert Outcome.OTHER.text("dropped") == "dropped"
    assert Outcome.FAULT.text() == "fault"
    assert Outcome.JAMMED.text() == "jammed"
    assert Outcome.JAMMED.text("at 3 mm") == "jammed: at 3 mm"
