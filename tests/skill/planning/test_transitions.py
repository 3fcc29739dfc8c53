"""Transitions of demonstrations, worked by hand."""

import numpy as np
import pytest

from skill.planning.transitions import transitions
from tests.skill.planning.made_up import FEATURES, PERIOD


def numbered(n, *, force=1.0):
    """Observations whose lateral force is ``force`` times the number of the sample, in N."""
    observed = np.zeros((n, 9))
    observed[:, 0] = force * np.arange(n)
    observed[:, 4] = 0.01 * np.arange(n)  # N m; over the radius this is N
    observed[:, 6] = -1e-4 * np.arange(n)
    observed[:, 7] = 2e-3 * np.arange(n)
    return observed


@pytest.fixture
def found():
    labels = [[0, 0, 2, 2, 2, 1, 1, 1, 1, 1, 1], [0] * 7, [3] * 4]
    observed = [numbered(11), numbered(7, force=2.0), numbered(4)]
    return transitions(observed, labels, [True, False, True], FEATURES, n_states=4, period=PERIOD)


def test_each_sample_has_its_answer_one_horizon_later(found):
    # Five periods are a horizon, and four samples have none.
    np.testing.assert_allclose(found.outputs[:, 0], [5.0] * 6 + [10.0] * 2)
    np.testing.assert_allclose(found.outputs[:, 3], 5.0)
    np.testing.assert_allclose(found.inputs, [[1e-2, 0.0, -5e-4]] * 8)
    np.testing.assert_allclose(found.loads[:, 0], [0, 1, 2, 3, 4, 5, 0, 2])
    np.testing.assert_allclose(found.measured[:, 6], -1e-4 * np.array([0, 1, 2, 3, 4, 5, 0, 1]))
    assert list(found.good) == [True] * 6 + [False] * 2


def test_each_sample_knows_the_state_that_follows_and_where_it_begins(found):
    # The last visit leads to the insertion (4) at the last sample, or to another end (5).
    assert list(found.next_states) == [2, 2, 1, 1, 1, 4, 5, 5]
    np.testing.assert_allclose(found.times, PERIOD * np.array([2, 1, 3, 2, 1, 5, 6, 5]))
    np.testing.assert_allclose(found.changes[:, 0], [2, 1, 3, 2, 1, 5, 12, 10])
    np.testing.assert_allclose(found.changes[:, 3], [2, 1, 3, 2, 1, 5, 6, 5])
    assert not found.changes[:, [1, 2, 4]].any()
