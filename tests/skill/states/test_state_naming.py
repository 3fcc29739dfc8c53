import numpy as np
import pytest

from skill.states.state_naming import name_states

LABELS = ("free", "tip", "two-point")


def test_states_are_called_after_their_dominant_label():
    names = name_states([0, 0, 0, 1, 1, 2], [1, 1, 0, 2, 2, 0], LABELS, n_states=4)
    assert names.names == ["tip", "two-point", "free", "state 3"]
    assert names.purity[:3] == pytest.approx([2 / 3, 1.0, 1.0])
    assert np.isnan(names.purity[3])
    assert names.labels.tolist() == [1, 2, 0, -1]
    assert names.counts.tolist() == [[1, 2, 0], [0, 0, 2], [1, 0, 0], [0, 0, 0]]


def test_states_of_one_label_are_numbered_and_mixtures_bear_two():
    names = name_states([0, 0, 0, 0, 1, 1, 2, 2], [1, 1, 1, 0, 1, 1, 0, 2], LABELS, n_states=3)
    assert names.names == ["tip 2", "tip 1", "free / two-point"]


def test_unknown_samples_do_not_count():
    assert name_states([0, 0, -1], [1, -1, 2], LABELS, n_states=1).counts.tolist() == [[0, 1, 0]]


def test_naming_follows_a_permutation_of_the_states():
    rng = np.random.default_rng(0)
    states, labels = rng.integers(0, 5, 300), rng.integers(0, 3, 300)
    order = rng.permutation(5)
    names = name_states(states, labels, LABELS, n_states=5)
    turned = name_states(order[states], labels, LABELS, n_states=5)
    assert turned.purity[order] == pytest.approx(names.purity)
    assert sorted(turned.names) == sorted(names.names)


@pytest.mark.parametrize(
    ("states", "labels", "message"),
    [
        ([0, 1], [0], r"shape \(2,\)"),
        ([0, 2], [0, 0], "states lie between 0 and 2, expected -1 to 1"),
        ([0, 1], [0, 3], "labels lie between 0 and 3"),
    ],
)
def test_wrong_arguments_are_refused(states, labels, message):
    with pytest.raises(ValueError, match=message):
        name_states(states, labels, LABELS, n_states=2)
