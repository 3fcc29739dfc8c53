"""The intervals and paired tests against other implementations and known answers."""

import numpy as np
import pytest
from statsmodels.stats.contingency_tables import mcnemar as reference
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.proportion import proportion_confint

from experiments.scoreboard import paired_statistics
from experiments.scoreboard.paired_statistics import holm, mcnemar, over_sets, sign_flip_test, wilson


@pytest.mark.parametrize(("successes", "n"), [(0, 20), (1, 20), (13, 20), (20, 20), (99, 100)])
def test_the_interval_is_wilsons(successes, n):
    assert wilson(successes, n) == pytest.approx(proportion_confint(successes, n, method="wilson"), abs=1e-6)


def test_signs_are_flipped_exactly_for_few_differences_and_by_draws_for_many():
    assert sign_flip_test([1, 2, -3, 0]) == pytest.approx(1.0)
    assert sign_flip_test([1] * 5 + [0] * 9) == pytest.approx(2 / 2**5)
    assert sign_flip_test([1] * 6 + [-1]) == pytest.approx(2 * 8 / 2**7)  # the binomial test
    assert sign_flip_test([1] * 30) == pytest.approx(1e-4, rel=0.01)
    assert sign_flip_test([1, -1] * 15) > 0.8


def test_equal_sets_have_no_spread():
    assert over_sets([0.9] * 5) == (pytest.approx(0.9), pytest.approx(0.9), pytest.approx(0.9))


def test_the_paired_test_is_the_exact_one_of_mcnemar():
    assert mcnemar(5, 0) == pytest.approx(2 * 0.5**5)
    assert mcnemar(0, 0) == mcnemar(3, 3) == 1.0
    assert mcnemar(9, 2) == pytest.approx(reference([[20, 9], [2, 9]], exact=True).pvalue)


def test_the_correction_is_holms():
    """Three tests: 3 x 0.01, 2 x 0.02 and 0.03, which is not smaller than the one before."""
    assert holm([0.03, 0.01, 0.02]) == pytest.approx([0.04, 0.03, 0.04])
    p = np.random.default_rng(1).uniform(0, 0.4, 12)
    assert holm(p) == pytest.approx(multipletests(p, method="holm")[1])
    assert holm([]) == []


def test_signs_that_are_drawn_in_parts_are_the_same(monkeypatch):
    differences = np.random.default_rng(2).normal(0.2, 1.0, 40)
    whole = sign_flip_test(differences)
    monkeypatch.setattr(paired_statistics, "MAX_DRAWS", 40 * 333)
    assert sign_flip_test(differences) == whole
