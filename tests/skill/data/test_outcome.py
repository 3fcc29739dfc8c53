import pytest

from skill.data.outcome import Outcome, parse_outcome


@pytest.mark.parametrize("outcome", [o for o in Outcome if o is not Outcome.OTHER])
@pytest.mark.parametrize("detail", ["", "RuntimeError: no solution: none"])
def test_a_stored_text_is_read_back(outcome, detail):
    if outcome is Outcome.FAULT and detail:
        return  # a fault is stored by its own name
    assert parse_outcome(outcome.text(detail)) == (outcome, detail)


@pytest.mark.parametrize("word", ["dropped", "slipped: twice", ""])
def test_the_word_of_another_program_is_kept(word):
    outcome, detail = parse_outcome(word)
    assert outcome is Outcome.OTHER
    assert detail == word
