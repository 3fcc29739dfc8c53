"""The intervals and paired tests against other implementations and known answers."""

import numpy as np
import pytest
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.proportion import proportion_confint

from experiments.scoreboard.paired_statistics import holm, paired_change, sign_flip_test, wilson, wilson_over_sets


@pytest.mark.parametrize(("successes", "n"), [(0, 20), (1, 20), (13, 20), (20, 20), (99, 100)])
def test_the_interval_is_wilsons(successes, n):
    assert wilson(successes, n) == pytest.approx(proportion_confint(successes, n, method="wilson"), abs=1e-6)


def test_signs_are_flipped_exactly_for_few_differences_and_by_draws_for_many():
    assert sign_flip_test([1, 2, -3, 0]) == pytest.approx(1.0)
    assert sign_flip_test([1] * 5 + [0] * 9) == pytest.approx(2 / 2**5)
    assert sign_flip_test([1] * 6 + [-1]) == pytest.approx(2 * 8 / 2**7)  # the binomial test
    assert sign_flip_test([1] * 30) == pytest.approx(1e-4, rel=0.01)
    assert sign_flip_test([1, -1] * 15) > 0.8


def test_few_sets_and_sets_that_differ_count_as_fewer_trials():
    """Two degrees of freedom have a quantile of 4.303 instead of 1.960."""
    reduced = 60 * (1.959964 / 4.302653) ** 2
    assert wilson_over_sets([20] * 3, [20] * 3) == pytest.approx(wilson(reduced, reduced), abs=1e-6)
    # shares of 1, 0.9 and 0.5: the mean of three has the variance 0.07 / 3, as that of 6.86 trials with a share of 0.8
    effective = 0.8 * 0.2 / (0.07 / 3) * (1.959964 / 4.302653) ** 2
    assert wilson_over_sets([20, 18, 10], [20] * 3) == pytest.approx(wilson(0.8 * effective, effective), abs=1e-6)
    assert wilson_over_sets([9, 9, 9, 0] * 500, [10] * 2000) == pytest.approx((0.675, 0.675), abs=0.02)


@pytest.mark.parametrize("sets", [4, 10])
@pytest.mark.parametrize("likeness", [5.0, 20.0])
def test_the_interval_covers_the_share_of_all_sets(sets, likeness):
    """Shares of sets are of a beta distribution with the mean 0.9 and a standard deviation of 0.12 or 0.07; each set
    performs 25 trials, whose mean has one of up to 0.06.
    """
    rng = np.random.default_rng(4)
    won = rng.binomial(25, rng.beta(0.9 * likeness, 0.1 * likeness, (2000, sets)))
    covered = [low <= 0.9 <= high for low, high in (wilson_over_sets(row, [25] * sets) for row in won)]
    assert np.mean(covered) > 0.9


def test_the_correction_is_holms():
    """Three tests: 3 x 0.01, 2 x 0.02 and 0.03, which is not smaller than the one before."""
    assert holm([0.03, 0.01, 0.02]) == pytest.approx([0.04, 0.03, 0.04])
    p = np.random.default_rng(1).uniform(0, 0.4, 12)
    assert holm(p) == pytest.approx(multipletests(p, method="holm")[1])
    assert holm([]) == []


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
    ("before", "after"),
    [
        ([1.0, 2.0], [1.0]),
        ([1.0], [1.0]),
        ([1.0, np.nan], [1.0, 1.0]),
        ([1.0, 2.0], [1.0, -np.inf]),
        ([0.0, 1.0], [1.0, 1.0]),
        ([[1.0], [2.0]], [[1.0], [2.0]]),
    ],
)
def test_measurements_that_cannot_be_compared_are_an_error(before, after):
    with pytest.raises(ValueError, match="expected at least two finite numbers each"):
        paired_change(before, after)
