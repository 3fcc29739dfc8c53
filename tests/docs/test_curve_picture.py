"""The tool that makes the documentation's pictures of curves takes what it is asked for, in order."""

import pytest

from docs._tools.curve_picture import curve_pictures, stacked
from tests.experiments.scoreboard.simulated_trials import write_trials
from tests.interfaces.reports.test_scoreboard_curves import rows


def test_curves_are_drawn_in_the_order_asked_for(tmp_path):
    write_trials(tmp_path, rows([1, 2, 3], name="a") + rows([4, 5, 6], name="b"))
    write_trials(tmp_path, rows([1, 2, 3], name="a"), engine="exact")
    both = curve_pictures(tmp_path, ["b", "a"], "drake")
    assert [picture.tobytes() for picture in both[::-1]] == [
        picture.tobytes() for picture in curve_pictures(tmp_path, ["a", "b"], "drake")
    ]
    assert stacked(both).size == (both[0].width, both[0].height + both[1].height)
    assert len(curve_pictures(tmp_path, ["a"], "")) == 2
    with pytest.raises(ValueError, match="no curve over one of c; found: a, b"):
        curve_pictures(tmp_path, ["c"], "")
