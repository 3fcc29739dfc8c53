"""What a policy would do while somebody else moves the peg."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from skill.features.wrench_features import MEASURED
from skill.policy import WrappedPolicy
from skill.practice.policy_observer import PolicyObserver
from skill.states.contact_state_filter import StateEstimator
from skill.states.context_filter import ContextEstimate
from skill.training_samples import observed_series


def watched(skill, demonstration):
    observer = PolicyObserver(skill)
    samples = demonstration.samples
    rows = zip(samples[list(MEASURED)].to_numpy(), samples[["rx", "ry"]].to_numpy(), strict=True)
    return [observer.watch(measured, turn) for measured, turn in rows]


def test_states_are_those_of_the_filter(skill, demonstrations):
    found = watched(skill, demonstrations[0])
    estimator = StateEstimator(skill.state_filter()).reset()
    for judgement, measured in zip(found, demonstrations[0].samples[list(MEASURED)].to_numpy(), strict=True):
        state, estimate = estimator.update(skill.measured_features(measured))
        assert judgement.state == np.argmax(estimate.probabilities)
        assert state == (judgement.state if judgement.known else -1)
        np.testing.assert_array_equal(judgement.action.probabilities, estimate.probabilities)
    assert len({judgement.state for judgement in found}) > 1
    assert {judgement.known for judgement in found} == {False, True}


class Counting:
    """Two contexts, of which the first is as probable as observations have been many; keeps the observations."""

    n_contexts = 2

    def __init__(self):
        self.seen = []

    def initial_memory(self):
        return np.zeros(1)

    def step(self, memory, observation):
        self.seen.append(observation)
        share = (memory[0] + 1.0) / 1000.0
        return ContextEstimate(memory + 1.0, np.array([share, 1.0 - share]), np.zeros(2))


@dataclass(frozen=True)
class WithContexts(WrappedPolicy):
    """A skill with another follower of contexts, which keeps what it is asked with."""

    follower: Counting = field(default_factory=Counting)
    asked: list = field(default_factory=list)

    def context_filter(self):
        return self.follower

    def act(self, measured, probabilities=None, contexts=None):
        self.asked.append(contexts)
        return self.policy.act(measured, probabilities, None)


def test_contexts_are_followed_over_the_observations_that_they_are_learnt_from(skill, demonstrations):
    policy = WithContexts(skill)
    watched(policy, demonstrations[0])
    np.testing.assert_allclose(policy.follower.seen, observed_series(demonstrations[0].samples), atol=1e-15)
    shares = (1.0 + np.arange(len(policy.asked))) / 1000.0
    np.testing.assert_allclose(policy.asked, np.column_stack([shares, 1.0 - shares]))


def test_the_action_is_that_of_the_policy(skill, demonstrations):
    measured = demonstrations[0].samples[list(MEASURED)].to_numpy()
    found = watched(skill, demonstrations[0])
    for i in (0, len(found) // 2, len(found) - 1):
        action = skill.act(measured[i], found[i].action.probabilities, found[i].action.contexts)
        np.testing.assert_array_equal(action.turn, found[i].action.turn)
        assert action.feed == found[i].action.feed
    assert min(judgement.action.feed for judgement in found) < 0.0  # into the hole


def test_a_sample_that_is_not_finite_is_an_error(skill):
    with pytest.raises(ValueError, match="finite"):
        PolicyObserver(skill).watch([np.nan, *np.zeros(6)], [0.0, 0.0])
