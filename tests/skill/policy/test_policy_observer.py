"""What a policy would do while somebody else moves the peg."""

import numpy as np
import pytest

from skill.features.measurement import MEASURED, observed_series
from skill.policy.policy_observer import PolicyObserver
from skill.states.estimate import estimates


def test_a_judgement_is_the_estimate_and_the_action_of_the_policy(skill, demonstrations):
    """The own turn is the sum of the turns."""
    observer, samples = PolicyObserver(skill), demonstrations[0].samples
    measured, turns = samples[list(MEASURED)].to_numpy(), samples[["rx", "ry"]].to_numpy()
    found = [observer.watch(*row) for row in zip(measured, turns, strict=True)]
    expected = list(estimates(skill.estimator(), observed_series(samples)))
    assert [(j.state, j.known) for j in found] == [(e.state, e.known) for e in expected]
    assert len({judgement.state for judgement in found}) > 1
    assert {judgement.known for judgement in found} == {False, True}
    for i in (0, len(found) // 2, len(found) - 1):
        action = skill.act(measured[i], expected[i])
        np.testing.assert_allclose(action.turn, found[i].action.turn, rtol=1e-9)
        assert action.feed == pytest.approx(found[i].action.feed)
    assert min(judgement.action.feed for judgement in found) < 0.0  # into the hole


def test_a_sample_that_is_not_finite_is_an_error(skill):
    with pytest.raises(ValueError, match="finite"):
        PolicyObserver(skill).watch([np.nan, *np.zeros(6)], [0.0, 0.0])
