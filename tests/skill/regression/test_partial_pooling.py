import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from skill.regression.partial_pooling import relevance

GROUPS = np.array([4, 4, 7, 7, 8, 8, 9, 9])
IN_CONTEXT = np.repeat([1.0, 1.0, 0.0, 0.0], 2)

weights = arrays(float, 8, elements=st.floats(0.1, 1.0))
outputs = arrays(float, (8, 2), elements=st.floats(-3.0, 3.0))
memberships = arrays(float, 4, elements=st.floats(0.05, 0.95)).map(lambda r: np.repeat(r, 2))


def test_two_against_two_demonstrations_by_hand():
    """Means 1.1 and -1.1, each of two values 0.2 apart: V = V' = 2/1 . 2 (0.1 / 2)^2 = 0.01."""
    found = relevance(np.ones(4), np.array([[1.0], [1.2], [-1.0], [-1.2]]), [0, 1, 2, 3], np.array([1.0, 1.0, 0, 0]))
    assert found == pytest.approx(1.0 - 0.02 / 2.2**2)


def test_contexts_that_act_alike_do_not_matter():
    rng = np.random.default_rng(0)
    y = rng.normal(1.0, 0.2, (4000, 2))
    found = relevance(np.ones(4000), y, np.repeat(np.arange(40), 100), np.repeat([1.0, 0.0], 2000))
    assert found < 0.8  # a difference of chance has the size of its own standard error
    shifted = y + np.repeat([[0.5, 0.0], [0.0, 0.0]], 2000, axis=0)
    assert relevance(np.ones(4000), shifted, np.repeat(np.arange(40), 100), np.repeat([1.0, 0.0], 2000)) > 0.99


def test_many_samples_of_one_demonstration_are_no_evidence():
    y = np.where(np.arange(200) < 100, 1.0, -1.0)[:, None]
    assert relevance(np.ones(200), y, np.arange(200) // 100, np.repeat([1.0, 0.0], 100)) == 0.0


@given(weights, outputs, memberships)
def test_it_is_a_share(w, y, r):
    assert 0.0 <= relevance(w, y, GROUPS, r) <= 1.0


@given(weights, outputs, memberships)
def test_units_and_names_do_not_matter_nor_does_the_side(w, y, r):
    found = relevance(w, y, GROUPS, r)
    assert relevance(3.0 * w, y, GROUPS, r) == pytest.approx(found, abs=1e-6)
    assert relevance(w, 2.0 * y, GROUPS, r) == pytest.approx(found, abs=1e-6)
    assert relevance(w, y, 20 - GROUPS, r) == pytest.approx(found, abs=1e-6)
    assert relevance(w, y, GROUPS, 1.0 - r) == pytest.approx(found, abs=1e-6)


@given(weights, outputs)
def test_a_sample_counts_like_two_of_half_its_weight(w, y):
    twice = np.concatenate([0.5 * w, 0.5 * w]), np.vstack([y, y]), np.tile(GROUPS, 2), np.tile(IN_CONTEXT, 2)
    assert relevance(*twice) == pytest.approx(relevance(w, y, GROUPS, IN_CONTEXT), abs=1e-6)
