import numpy as np
import pytest

from skill.states.state_naming import name_states

LABELS = ("free", "tip", "two-point")


def test_states_are_named_after_their_most_frequent_label():
    names = name_states([0, 0, 0, 1, 1, 2], [1, 1, 0, 2, 2, 0], LABELS, n_states=4)
    assert names.names == ["tip", "two-point", "free", "state 3"]
    assert names.purity[:3] == pytest.approx([2 / 3, 1.0, 1.0])
    assert np.isnan(names.purity[3])
    assert names.labels.tolist() == [1, 2, 0, -1]
    assert names.counts.tolist() == [[1, 2, 0], [0, 0, 2], [1, 0, 0], [0, 0, 0]]


def test_states_with_one_label_are_numbered_and_mixed_states_have_two():
    names = name_states([0, 0, 0, 0, 1, 1, 2, 2], [1, 1, 1, 0, 1, 1, 0, 2], LABELS, n_states=3)
    assert names.names == ["tip 2", "tip 1", "free / two-point"]


def test_unknown_samples_are_ignored():
    assert name_states([0, 0, -1], [1, -1, 2], LABELS, n_states=1).counts.tolist() == [[0, 1, 0]]


def test_share_of_a_clear_label():
    states = np.zeros(10, dtype=int)
    assert name_states(states, [1] * 6 + [0] * 4, LABELS, n_states=1).names == ["tip"]
    assert name_states(states, [1] * 5 + [0] * 3 + [2] * 2, LABELS, n_states=1).names == ["tip / free"]


def test_no_samples():
    nothing = np.zeros(0, dtype=int)
    assert name_states(nothing, nothing, LABELS, n_states=2).names == ["state 0", "state 1"]
