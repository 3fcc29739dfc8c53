import pytest

from skill.states.state_style import PALETTE, state_colours, state_labels


def test_colours_are_distinct_and_start_with_the_palette():
    colours = state_colours(27)
    assert colours[:9] == list(PALETTE)
    assert len(set(colours)) == 27
    # The tints of "#0072B2": 255 - 0.55 (255 - c) and 255 - 0.3 (255 - c).
    assert (colours[9], colours[18]) == ("#73B1D5", "#B2D5E8")
    assert state_colours(0) == []


def test_too_many_states_are_an_error():
    with pytest.raises(ValueError, match="28 states, expected at most 27 with distinct colours"):
        state_colours(28)


def test_labels_are_numbers_or_names():
    assert state_labels(2) == ["state 0", "state 1"]
    assert state_labels(2, ["free", "tip"]) == ["free", "tip"]
    with pytest.raises(ValueError, match=r"1 state names \['free'\], expected one for each of 2 states"):
        state_labels(2, ["free"])
