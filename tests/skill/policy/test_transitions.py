"""Transitions of demonstrations, worked by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skill.features.canonical_frame import turned_rows
from skill.features.wrench_features import CanonicalFeatures
from skill.policy.transitions import HORIZON, Transitions, transitions
from tests.skill.policy.made_up import PERIOD, RADIUS, transitions_of


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
    parts = zip(observed, labels, [True, False, True], strict=True)
    return Transitions.joined([transitions_of(*part, n_states=4) for part in parts])


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


def observed(force=(3.0, 0.0, 1.0), moment=(0.0, 0.0, 0.0), turned=(0.0, 0.0)):
    return np.array([[*force, *moment, -0.002, *turned]])


def answers(before, after):
    """The motions and answers from one observation to the next, in the canonical frame."""
    rows = np.vstack([before, after])
    found = transitions(
        rows,
        np.zeros(2, int),
        good=True,
        n_states=1,
        features=CanonicalFeatures(),
        peg_radius=RADIUS,
        period=HORIZON,
    )
    return found.inputs[0], found.outputs[0]


def test_answers_are_told_in_the_frame_of_the_first_force():
    # The force points along y, so that x of the canonical frame is y of the peg frame.
    inputs, outputs = answers(
        observed(force=(0.0, 5.0, 0.0)), observed(force=(0.0, 7.0, 0.5), moment=(0.02, 0.0, 0.0), turned=(0.0, 0.03))
    )
    np.testing.assert_allclose(outputs, [2.0, 0.0, 0.0, -2.0, 0.5], atol=1e-12)
    np.testing.assert_allclose(inputs[:2], [0.03, 0.0], atol=1e-12)


@given(angle=st.floats(-3.1, 3.1), seed=st.integers(0, 1000))
def test_turning_the_scene_about_the_axis_changes_nothing(angle, seed):
    rows = np.random.default_rng(seed).normal(size=(2, 9))
    rows[:, 0] += 3.0
    turned = rows.copy()
    for k in (0, 3, 7):
        turned[:, k : k + 2] = turned_rows(rows[:, k:], np.full(2, angle))
    for one, other in zip(answers(rows[:1], rows[1:]), answers(turned[:1], turned[1:]), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-7)
