import numpy as np
import pytest

from skill.states.recurrence import recurrent_sets

WEIGHTS = np.array([0.4, 0.3, 0.2, 0.1])
LENGTH = 20


def densities(components):
    """Log-densities of samples, each of which one component explains best and the next one second best."""
    components = np.asarray(components)
    distances = np.abs(components[:, None] - np.arange(len(WEIGHTS)))
    return -3.0 * distances + np.log(WEIGHTS)


def sets_of(recordings, sets=(0, 1, 2, 3), n_alike=1.0):
    """The sets after the merger, of recordings that are sequences of components."""
    components = np.concatenate([np.repeat(recording, LENGTH) for recording in recordings])
    groups = np.repeat(np.arange(len(recordings)), [LENGTH * len(recording) for recording in recordings])
    return recurrent_sets(densities(components), WEIGHTS, np.array(sets), groups, n_alike).tolist()


def test_a_set_of_a_single_recording_joins_what_takes_its_place():
    recordings = [[0, 1, 2], [0, 1, 2], [0, 1, 2], [0, 1, 3]]
    assert sets_of(recordings) == [0, 1, 2, 2]


@pytest.mark.parametrize(("odd", "joined"), [([0, 1, 0, 2, 3], 0), ([0, 2, 1, 2, 3], 2)])
def test_the_place_is_told_by_what_comes_before_and_after(odd, joined):
    """Component 1 lies half-way between 0 and 2."""
    found = sets_of([[0, 2, 3]] * 5 + [odd])
    assert len(set(found)) == 3
    assert found[1] == found[joined]


@pytest.mark.parametrize(("visits", "n_recordings", "stays"), [(2, 3, True), (2, 4, False), (3, 4, True), (3, 9, True)])
def test_three_recordings_are_enough_or_two_of_three(visits, n_recordings, stays):
    recordings = [[0, 3, 1, 2]] * visits + [[0, 1, 2]] * (n_recordings - visits)
    assert (sets_of(recordings) == [0, 1, 2, 3]) == stays


def test_an_end_like_no_other_is_a_state_and_another_force_at_the_end_is_none():
    assert sets_of([[0, 1, 2]] * 3 + [[0, 1, 2, 3]]) == [0, 1, 2, 3]
    assert sets_of([[0, 1, 2]] * 3 + [[3, 0, 1, 2]]) == [0, 1, 2, 3]
    assert sets_of([[0, 1, 2]] * 3 + [[3, 1, 2]]) == [0, 1, 2, 0]


def test_a_few_samples_are_no_occurrence():
    components, groups = [], []
    for recording, n_third in enumerate([40, 1, 1, 1]):  # a tenth of the mean number is 1.075
        components += [0] * LENGTH + [1] * LENGTH + [3] * n_third + [2] * LENGTH
        groups += [recording] * (3 * LENGTH + n_third)
    found = recurrent_sets(densities(components), WEIGHTS, np.arange(4), np.array(groups), 1.0)
    assert len(set(found)) == 3


def test_sets_of_several_components_stay_together():
    recordings = [[0, 1, 2]] * 3 + [[0, 3, 2]]
    assert sets_of(recordings, sets=(0, 0, 1, 1)) == [0, 0, 1, 1]
    # Component 3 alone is a set of one recording; its neighbour in the mixture, and in time, is 2.
    assert sets_of(recordings, sets=(0, 0, 1, 2)) == [0, 0, 1, 1]


@pytest.mark.parametrize(("n_alike", "sets"), [(1.0, [0, 1, 2, 3]), (5.0, [0, 1, 2, 2])])
def test_a_set_that_is_smoothed_away_joins_the_most_probable_one(n_alike, sets):
    """Three samples of component 3 have the evidence of a visit only if each counts."""
    components = np.tile(np.repeat([0, 1, 2, 3, 2], [LENGTH, LENGTH, LENGTH, 3, LENGTH]), 4)
    groups = np.repeat(np.arange(4), 4 * LENGTH + 3)
    assert recurrent_sets(densities(components), WEIGHTS, np.arange(4), groups, n_alike).tolist() == sets


def test_a_visit_between_two_that_follow_each_other_prolongs_the_more_probable_of_them():
    """Component 1 would be the most probable one of all."""
    found = sets_of([[2, 3, 1]] * 5 + [[2, 0, 3, 1]])
    assert found == [1, 0, 1, 2]


def test_long_visits_count_more():
    components = [[2, 3, 1]] * 3 + [[2, 0, 1]]
    order = np.concatenate([np.repeat(recording, LENGTH) for recording in components])
    groups = np.repeat(np.arange(4), 3 * LENGTH)
    # Two short visits of component 0, where component 2 is prolonged, against a long one in the place of 3.
    order = np.concatenate([order, np.repeat([2, 0, 2, 0, 2, 3, 1], [LENGTH, 6, LENGTH, 6, LENGTH, LENGTH, LENGTH])])
    groups = np.concatenate([groups, np.full(len(order) - len(groups), 4)])
    found = recurrent_sets(densities(order), WEIGHTS, np.arange(4), groups, 1.0)
    assert found[0] == found[3]


def test_nothing_is_merged_below_one_set():
    assert sets_of([[0, 1], [2, 3]], sets=(0, 0, 0, 0)) == [0, 0, 0, 0]
    assert len(set(sets_of([[0], [1], [2], [3]]))) == 1  # no set recurs
