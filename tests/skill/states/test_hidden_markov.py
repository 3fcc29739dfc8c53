from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skill.states.hidden_markov import (
    MarkovChain,
    backward,
    forward,
    learnt_chain,
    most_probable_path,
    smoothed,
)

CHAIN = MarkovChain(np.array([0.6, 0.4]), np.array([[0.9, 0.1], [0.3, 0.7]]))


def random_chain(rng, M):
    return MarkovChain(rng.dirichlet(np.ones(M)), rng.dirichlet(np.ones(M), size=M))


def enumerated(log_likelihoods, chain):
    """Probability of each state at each sample: the sum over all paths, weighted by their probability."""
    n, M = log_likelihoods.shape
    probabilities = np.zeros((n, M))
    for path in product(range(M), repeat=n):
        weight = chain.initial[path[0]] * np.exp(log_likelihoods[np.arange(n), path].sum())
        for k, i in pairwise(path):
            weight *= chain.transitions[k, i]
        probabilities[np.arange(n), path] += weight
    return probabilities / probabilities.sum(axis=1, keepdims=True)


def test_forward_recursion_worked_by_hand():
    likelihoods = np.array([[0.5, 0.25], [0.1, 0.4]])
    first = np.array([0.6 * 0.5, 0.4 * 0.25]) / 0.4  # 0.75, 0.25
    predicted = np.array([0.75 * 0.9 + 0.25 * 0.3, 0.75 * 0.1 + 0.25 * 0.7])  # 0.75, 0.25
    second = predicted * likelihoods[1] / (predicted @ likelihoods[1])
    np.testing.assert_allclose(forward(np.log(likelihoods), CHAIN), [first, second], rtol=1e-12)


@given(seed=st.integers(0, 10_000), n=st.integers(1, 6), M=st.integers(1, 3))
def test_smoothing_is_the_sum_over_all_paths(seed, n, M):
    rng = np.random.default_rng(seed)
    chain, log_likelihoods = random_chain(rng, M), rng.normal(scale=2.0, size=(n, M))
    expected = enumerated(log_likelihoods, chain)
    np.testing.assert_allclose(smoothed(log_likelihoods, chain), expected, atol=1e-9)
    for t in range(n):
        np.testing.assert_allclose(
            forward(log_likelihoods, chain)[t], enumerated(log_likelihoods[: t + 1], chain)[t], atol=1e-9
        )


def test_smoothing_equals_the_reference_implementation():
    hmm = pytest.importorskip("hmmlearn.hmm")
    rng = np.random.default_rng(3)
    chain, X = random_chain(rng, 3), rng.normal(size=(200, 2), scale=2.0)
    reference = hmm.GaussianHMM(3, covariance_type="spherical", init_params="", params="")
    reference.startprob_, reference.transmat_ = chain.initial, chain.transitions
    reference.means_, reference.covars_ = rng.normal(size=(3, 2)), np.array([0.5, 1.0, 2.0])
    log_likelihoods = reference._compute_log_likelihood(X)
    np.testing.assert_allclose(smoothed(log_likelihoods, chain), reference.predict_proba(X), atol=1e-9)


@pytest.mark.parametrize("offset", [-1e4, 1e4])
def test_likelihoods_beyond_the_range_of_numbers(offset):
    log_likelihoods = np.random.default_rng(0).normal(size=(50, 2)) + offset
    for method in (forward, backward, smoothed):
        np.testing.assert_allclose(method(log_likelihoods, CHAIN), method(log_likelihoods - offset, CHAIN), atol=1e-9)


def test_an_impossible_step_does_not_end_the_filter():
    """A chain that never leaves its first state, and a sample that only the second can have caused."""
    chain = MarkovChain(np.array([1.0, 0.0]), np.eye(2))
    belief = forward(np.array([[0.0, -2000.0], [-2000.0, 0.0]]), chain)
    np.testing.assert_allclose(belief, [[1.0, 0.0], [0.0, 1.0]])


def test_transitions_are_counted_within_sequences_only():
    """States that are certain: the expectations are counts. Each row has one pseudo-count, in equal parts."""
    states = np.array([0, 0, 0, 1, 1, 0, 1, 1])
    groups = np.array([7, 7, 7, 7, 7, 9, 9, 9])
    log_likelihoods = np.where(np.eye(2)[states] > 0, 0.0, -500.0)
    chain = learnt_chain(log_likelihoods, groups)
    np.testing.assert_allclose(chain.transitions, [[2.5 / 5, 2.5 / 5], [0.5 / 3, 2.5 / 3]], atol=1e-12)
    np.testing.assert_allclose(chain.initial, [2.5 / 3, 0.5 / 3], atol=1e-12)


def test_transitions_are_learnt_from_uncertain_states():
    rng = np.random.default_rng(5)
    true = np.array([[0.97, 0.03], [0.06, 0.94]])
    state, states = 0, []
    for _ in range(8_000):
        states.append(state)
        state = int(rng.random() < true[state, 1])
    x = np.array(states) * 3.0 + rng.normal(size=len(states))
    log_likelihoods = -0.5 * (x[:, None] - [0.0, 3.0]) ** 2
    chain = learnt_chain(log_likelihoods, np.zeros(len(x), dtype=int))
    np.testing.assert_allclose(chain.transitions, true, atol=0.02)


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 5), M=st.integers(1, 3))
def test_no_path_is_more_probable(seed, n, M):
    rng = np.random.default_rng(seed)
    chain = MarkovChain(rng.dirichlet(np.ones(M)), rng.dirichlet(np.ones(M), size=M))
    likelihoods = rng.uniform(0.1, 1.0, size=(n, M))

    def probability(path):
        steps = chain.initial[path[0]] * np.prod([chain.transitions[a, b] for a, b in pairwise(path)])
        return steps * np.prod(likelihoods[np.arange(n), list(path)])

    found = most_probable_path(np.log(likelihoods), chain)
    np.testing.assert_array_equal(found.sum(axis=1), 1.0)
    best = max(probability(path) for path in product(range(M), repeat=n))
    np.testing.assert_allclose(probability(tuple(found.argmax(axis=1))), best)
