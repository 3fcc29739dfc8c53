"""The filter of the context: Bayes' rule, step by step."""

import numpy as np
import pytest

from skill.features.responses import ResponseFeatures
from skill.features.wrench_features import RawFeatures
from skill.states.context_filter import MIN_PROBABILITY, ContextFilter, pair_probabilities
from skill.states.context_mixture import ContextMixture

PERIOD = 0.05  # two periods are a horizon


def runs_of(sign, number, seed):
    """Observations of runs in which the lateral force answers to turns about y with a slope of this sign."""
    rng = np.random.default_rng(seed)
    for _ in range(number):
        turned = np.cumsum(rng.normal(0.0, 1e-3, (60, 2)), axis=0)
        rows = np.zeros((60, 9))
        rows[:, 0] = 10.0 + sign * 1e3 * turned[:, 1]
        rows[:, :6] += rng.normal(0.0, 0.2, (60, 6)) * [1, 1, 1, 0.01, 0.01, 0.01]
        rows[:, 6] = -0.002
        rows[:, 7:] = turned
        yield rows


RESPONSES = ResponseFeatures(RawFeatures(), 0.01)


@pytest.fixture(scope="module")
def mixture():
    found = [RESPONSES.of_series(run, PERIOD) for sign in (1, -1) for run in runs_of(sign, 6, seed=2 + sign)]
    X, U, Y = (np.vstack([getattr(f, name) for f in found]) for name in ("features", "inputs", "outputs"))
    groups = np.repeat(np.arange(12), [len(f.features) for f in found])
    return ContextMixture(n_contexts=2).fit(X, Y, inputs=U, groups=groups)


@pytest.fixture(scope="module")
def dut(mixture):
    return ContextFilter(mixture, RESPONSES, PERIOD)


def estimates(dut, rows):
    memory = dut.initial_memory()
    for row in rows:
        estimate = dut.step(memory, row)
        memory = estimate.memory
        yield estimate


def test_the_context_of_a_run_is_recognised_and_kept(dut, mixture):
    first = mixture.responsibilities_[0].argmax()  # of the runs with positive slope
    for sign in (1, -1):
        (rows,) = runs_of(sign, 1, seed=50)
        found = np.array([e.probabilities[first] for e in estimates(dut, rows)])
        right = found if sign > 0 else 1.0 - found
        assert right[0] == pytest.approx(0.5, abs=0.05)
        assert (right[30:] > 0.95).all()
        free = np.vstack([rows, np.zeros((20, 9))])
        assert [e.probabilities[first] for e in estimates(dut, free)][-1] == pytest.approx(found[-1], abs=0.05)


def test_a_step_is_bayes_rule_with_the_evidence_of_the_mixture(dut, mixture):
    (rows,) = runs_of(1, 1, seed=51)
    *_, before, after = estimates(dut, rows[:20])
    answer = RESPONSES.between(rows[17:18], rows[19:20])
    evidence = mixture.log_likelihoods(answer.features, answer.outputs, inputs=answer.inputs)[0]
    np.testing.assert_allclose(after.evidence, evidence - evidence.mean())
    expected = before.probabilities * np.exp(evidence - evidence.max())
    np.testing.assert_allclose(after.probabilities, expected / expected.sum(), atol=3 * MIN_PROBABILITY)


def test_before_a_horizon_has_passed_nothing_is_known(dut, mixture):
    (rows,) = runs_of(1, 1, seed=52)
    found = list(estimates(dut, rows[:3]))
    for estimate in found[:2]:
        np.testing.assert_array_equal(estimate.evidence, 0.0)
        np.testing.assert_allclose(estimate.probabilities, mixture.weights_, atol=1e-4)
    assert np.abs(found[2].evidence).max() > 0.0


def test_a_free_or_deep_peg_tells_nothing(dut):
    (rows,) = runs_of(1, 1, seed=53)
    for column, value in ((slice(0, 6), 0.0), (6, -0.02)):
        quiet = rows.copy()
        quiet[:, column] = value
        for estimate in estimates(dut, quiet):
            np.testing.assert_array_equal(estimate.evidence, 0.0)


def test_no_context_is_ever_excluded(dut):
    rows = np.vstack([*runs_of(1, 8, seed=54)])
    for estimate in estimates(dut, rows):
        assert estimate.probabilities.min() >= MIN_PROBABILITY
        assert estimate.probabilities.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("observation", [np.zeros(7), np.full(9, np.nan)])
def test_a_bad_observation_is_refused(dut, observation):
    with pytest.raises(ValueError, match="expected 9 finite numbers"):
        dut.step(dut.initial_memory(), observation)


def test_pairs_are_products_and_sum_to_one():
    states, contexts = np.array([[0.2, 0.3, 0.5], [1.0, 0.0, 0.0]]), np.array([[0.9, 0.1]])
    pairs = pair_probabilities(states, contexts)
    np.testing.assert_allclose(pairs[0], [0.18, 0.02, 0.27, 0.03, 0.45, 0.05])
    np.testing.assert_allclose(pairs.sum(axis=1), 1.0)
