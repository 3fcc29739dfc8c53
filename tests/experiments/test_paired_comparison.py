import numpy as np
import pytest

from experiments.paired_comparison import paired_change


def test_halving_every_value_gives_a_change_of_minus_one_half_without_spread():
    before = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    c = paired_change(before, before / 2)
    assert (c.before, c.after, c.change) == (3.5, 1.75, -0.5)
    assert (c.lower, c.upper) == (-0.5, -0.5)
    assert c.p_value == pytest.approx(2 / 2**6)  # of the 64 sign patterns, one is as extreme on each side


def test_equal_measurements_give_no_change():
    c = paired_change([2.0, 3.0, 4.0], [2.0, 3.0, 4.0])
    assert (c.change, c.lower, c.upper, c.p_value) == (0.0, 0.0, 0.0, 1.0)


def test_the_interval_of_two_trials_is_that_of_their_four_resamples():
    """One trial is unchanged and one doubled: a quarter of the resamples have change 0, a half 0.5, a quarter 1."""
    c = paired_change([1.0, 1.0], [1.0, 2.0])
    assert (c.lower, c.upper) == (0.0, 1.0)
    assert (c.before, c.after, c.change) == (1.0, 1.5, 0.5)


def test_the_change_is_that_of_the_medians_and_not_the_median_of_the_changes():
    c = paired_change([1.0, 2.0, 10.0], [4.0, 3.0, 5.0])
    assert (c.before, c.after, c.change) == (2.0, 4.0, 1.0)
    assert c.p_value == 1.0  # differences 3, 1 and -5: the ranks of both signs sum to 3


def test_the_interval_of_published_numbers_can_be_repeated():
    """The ends depend on the number of resamples and on the seed; these are stored values."""
    k = np.arange(1.0, 41.0)
    before = 2.0 + np.sin(k)
    after = before - 0.4 + 0.5 * np.cos(3.0 * k)
    c = paired_change(before, after)
    assert (c.lower, c.upper) == pytest.approx((-0.361069723432907, -0.05549497972562201), rel=1e-9)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ([1.0, 2.0], [1.0], "shape"),
        ([1.0], [1.0], "at least 2"),
        ([1.0, np.nan], [1.0, 1.0], "finite"),
        ([1.0, 2.0], [1.0, -np.inf], "finite"),
        ([0.0, 1.0], [1.0, 1.0], "positive"),
        ([[1.0], [2.0]], [[1.0], [2.0]], "shape"),
    ],
)
def test_measurements_that_cannot_be_compared_are_an_error(before, after, message):
    with pytest.raises(ValueError, match=message):
        paired_change(before, after)
