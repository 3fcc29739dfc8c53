import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from skill.regression.partial_pooling import relevance as relevance_of_contexts


def relevance(weights, outputs, groups, context):
    """B of two contexts, given the probabilities (k,) of the first."""
    numbers = np.ascontiguousarray(groups, dtype=np.int64)
    return relevance_of_contexts(weights, outputs, numbers, np.column_stack([context, 1.0 - context]))


GROUPS = np.array([4, 4, 7, 7, 8, 8, 9, 9])
IN_CONTEXT = np.repeat([1.0, 1.0, 0.0, 0.0], 2)

weights = arrays(float, 8, elements=st.floats(1e-6, 1.0))
outputs = arrays(float, (8, 2), elements=st.floats(-3.0, 3.0))
memberships = arrays(float, 4, elements=st.floats(1e-4, 1.0 - 1e-4)).map(lambda r: np.repeat(r, 2))


def test_two_against_two_demonstrations_by_hand():
    """Means 1.1 and -1.1, each of two values 0.2 apart: V = V' = 2/1 . 2 (0.1 / 2)^2 = 0.01."""
    found = relevance(np.ones(4), np.array([[1.0], [1.2], [-1.0], [-1.2]]), [0, 1, 2, 3], np.array([1.0, 1.0, 0, 0]))
    assert found == pytest.approx(1.0 - 0.02 / 2.2**2)


def equal_contexts(rng, rest):
    """Four demonstrations in each of two contexts that act alike; all but one in each have the weight ``rest``."""
    return np.tile([1.0, rest, rest, rest], 2), rng.normal(0.0, 1.0, (8, 2)), np.arange(8), np.repeat([1.0, 0.0], 4)


@pytest.mark.parametrize("rest", [1.0, 0.1, 0.01, 1e-3])
def test_contexts_that_act_alike_do_not_matter(rest):
    """Whatever the weights: one demonstration that dominates is no evidence of a difference."""
    rng = np.random.default_rng(0)
    found = [relevance(*equal_contexts(rng, rest)) for _ in range(400)]
    assert np.mean(found) < 0.25


@pytest.mark.parametrize("share", [1e-12, 1e-6, 1e-3])
def test_a_single_demonstration_with_a_trace_of_others_is_no_evidence(share):
    rng = np.random.default_rng(1)
    found = []
    for _ in range(200):
        members = np.array([1.0, share, share, 0.0, 0.0, 0.0])
        found.append(relevance(np.ones(6), rng.normal(0.0, 1.0, (6, 2)), np.arange(6), members))
    assert np.mean(found) < 0.25


def test_contexts_that_act_differently_matter():
    rng = np.random.default_rng(0)
    y = rng.normal(1.0, 0.2, (4000, 2)) + np.repeat([[0.5, 0.0], [0.0, 0.0]], 2000, axis=0)
    assert relevance(np.ones(4000), y, np.repeat(np.arange(40), 100), np.repeat([1.0, 0.0], 2000)) > 0.99


def test_demonstrations_without_weight_do_not_count():
    w, y = np.ones(4), np.array([[1.0], [1.2], [-1.0], [-1.2]])
    found = relevance(w, y, [0, 1, 2, 3], np.array([1.0, 1.0, 0.0, 0.0]))
    more = np.array([1.0, 1.0, 0.0, 0.0, 1.0, 0.0])
    assert relevance(np.append(w, [0.0, 0.0]), np.vstack([y, [[9.0], [9.0]]]), range(6), more) == pytest.approx(found)


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


def test_three_contexts_by_hand():
    """Means 2, -1 and 1 of two demonstrations each, 0.2 apart: V = 0.01 in each, three pairs of equal weight."""
    y = np.array([1.9, 2.1, -0.9, -1.1, 0.9, 1.1])[:, None]
    found = relevance_of_contexts(np.ones(6), y, np.arange(6), np.repeat(np.eye(3), 2, axis=0))
    assert found == pytest.approx(1.0 - 3 * 0.02 / (9.0 + 1.0 + 4.0))


def test_a_context_with_a_single_demonstration_does_not_count():
    y, members = np.array([1.0, 1.2, -1.0, -1.2, 9.0])[:, None], np.eye(3)[[0, 0, 1, 1, 2]]
    found = relevance_of_contexts(np.ones(5), y, np.arange(5), members)
    assert found == pytest.approx(relevance_of_contexts(np.ones(4), y[:4], np.arange(4), members[:4]))
