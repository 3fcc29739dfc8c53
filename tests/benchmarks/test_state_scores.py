import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching

from benchmarks.state_scores import boundary_f1, recognition


def timeline(n, period=0.02):
    """Times of the samples of one recording, s, and their groups."""
    return period * np.arange(n), np.zeros(n, dtype=int)


def test_delay_and_share_of_recognised_changes():
    true = np.array([0] * 5 + [1] * 5 + [2] * 2 + [3] * 5)  # label 2 is too short to count
    delays, share = recognition(true, np.array([0] * 7 + [1] * 3 + [0] * 7), *timeline(17))  # label 3 is not recognised
    np.testing.assert_allclose(delays, [0.0, 0.04])
    assert share == pytest.approx(2 / 3)


def test_no_recognised_change_gives_no_delay():
    delays, share = recognition(np.zeros(5, dtype=int), np.ones(5, dtype=int), *timeline(5))
    assert np.isnan(delays).all()
    assert share == 0.0


def test_changes_worked_by_hand():
    """Three true changes at 1, 2 and 3 s; those found at 1.3, 2.4 and 2.9 s, of which two are near enough."""
    time, groups = timeline(400, 0.01)
    true = np.searchsorted([1.0, 2.0, 3.0], time + 1e-6)
    found = np.searchsorted([1.3, 2.4, 2.9], time + 1e-6)
    assert boundary_f1(true, found, time, groups) == pytest.approx(2 * 2 / 6)
    assert boundary_f1(true, true[::-1], time, groups) == 1.0  # in any numbering
    assert boundary_f1(true, np.zeros(400, dtype=int), time, groups) == 0.0


def test_the_end_of_a_recording_is_no_change():
    time, groups = np.tile(0.02 * np.arange(5), 2), np.repeat([0, 1], 5)
    assert boundary_f1(np.repeat([0, 1], 5), np.zeros(10, dtype=int), time, groups) == 1.0


@given(
    one=st.lists(st.integers(1, 60), unique=True, max_size=6),
    other=st.lists(st.integers(1, 60), unique=True, max_size=6),
)
def test_matching_is_the_best_one(one, other):
    """The assignment of the largest number of pairs, by a reference implementation."""
    time, groups = timeline(64, 0.1)
    labels = [np.searchsorted(sorted(changes), np.arange(64), side="right") for changes in (one, other)]
    near = np.abs(np.subtract.outer(sorted(one), sorted(other))) <= 3
    pairs = (maximum_bipartite_matching(csr_array(near)) >= 0).sum() if near.size else 0
    total = len(one) + len(other)
    assert boundary_f1(*labels, time, groups) == pytest.approx(2 * pairs / total if total else 1.0)
