import numpy as np
import pytest

from skill.practice.paired_comparison import paired_change


def test_what_is_halved_everywhere_is_halved_without_doubt():
    before = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    c = paired_change(before, before / 2)
    assert (c.before, c.after, c.change) == (3.5, 1.75, -0.5)
    assert (c.lower, c.upper) == (-0.5, -0.5)
    assert c.p_value == pytest.approx(2 / 2**6)  # one of the 64 patterns of signs is as extreme, on either side


def test_what_is_the_same_has_not_changed():
    c = paired_change([2.0, 3.0, 4.0], [2.0, 3.0, 4.0])
    assert (c.change, c.lower, c.upper, c.p_value) == (0.0, 0.0, 0.0, 1.0)


def test_the_interval_covers_the_true_change_about_as_often_as_it_says():
    rng = np.random.default_rng(0)
    covered = 0
    for k in range(50):
        before = rng.lognormal(0.0, 0.3, 30)
        after = 0.8 * before * rng.lognormal(0.0, 0.2, 30)
        c = paired_change(before, after, random_state=k)
        covered += c.lower <= -0.2 <= c.upper
    assert 44 <= covered <= 50


def test_pairs_are_drawn_together():
    """Trials differ a thousandfold, but each by the same third: the interval knows no such spread."""
    before = np.logspace(0, 3, 20)
    c = paired_change(before, 0.75 * before)
    assert c.lower == pytest.approx(-0.25)
    assert c.upper == pytest.approx(-0.25)


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ([1.0, 2.0], [1.0], "shape"),
        ([1.0], [1.0], "at least 2"),
        ([1.0, np.nan], [1.0, 1.0], "finite"),
        ([0.0, 1.0], [1.0, 1.0], "positive"),
    ],
)
def test_what_cannot_be_compared_is_refused(before, after, said):
    with pytest.raises(ValueError, match=said):
        paired_change(before, after)
