"""The judgement of contexts, against shares worked by hand and against laws that are known."""

import numpy as np
import pytest

from benchmarks.contexts import OFF, agreement, found_in, told
from skill.states.context_mixture import ContextMixture
from tests.skill.states.mixtures import make_mixture
from tests.skill.test_skill_contexts import hinged_demonstrations


def test_the_agreement_is_that_with_the_majority_of_a_context():
    pivots = np.array([3.0, 2.0, -1.0, -2.0, -3.0, 0.1]) * 1e-3  # the last one is too near to count
    assert abs(pivots[-1]) < OFF
    assert agreement(np.array([0, 0, 1, 1, 1, 0]), pivots) == 1.0
    assert agreement(np.array([0, 1, 1, 1, 1, 1]), pivots) == pytest.approx(4 / 5)
    assert agreement(np.zeros(6, dtype=int), pivots) == pytest.approx(3 / 5)
    assert agreement(np.arange(6), pivots) == 1.0


def test_sides_with_laws_of_their_own_are_told_and_others_are_not():
    for slopes, low, high in (((1.0, -1.0), 0.95, 1.0), ((1.0, 1.0), 0.0, 0.8)):
        X, U, Y, group, contexts = make_mixture(slopes)
        mixture = ContextMixture(n_contexts=2).fit(X, Y, inputs=U, groups=group)
        share = told(mixture, group, np.where(contexts == 0, 1e-3, -1e-3))[-1]
        assert low <= share <= high


def test_a_set_of_demonstrations_with_two_laws_has_two_contexts():
    demonstrations = hinged_demonstrations()
    for k, demonstration in enumerate(demonstrations):
        height = 2e-3 if k % 2 == 0 else -2e-3
        demonstration.metadata["scenario"] = f"rig: {{pivot_height: {height}}}"
    row = found_in(demonstrations)
    assert row["contexts"] == 2
    assert row["side"] == 1.0
    assert row["chance"] == 0.5
    assert row["gain"][0] > row["gain"][1] > 0.0
