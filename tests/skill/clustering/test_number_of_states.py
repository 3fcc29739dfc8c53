import numpy as np
import pytest

from skill.clustering.component_merging import Mixture
from skill.clustering.expectation_maximization import components_of_partition
from skill.clustering.gaussian_components import score_variances, tail_weights
from skill.clustering.number_of_states import (
    bayesian_information_criterion,
    design_effect,
    mixture_parameters,
    number_for_density,
    number_of_demonstrated,
    number_of_independent,
)
from tests.skill.clustering.components import densities, no_prior, random_components, spherical


def mixtures(**log_likelihoods):
    """Mixtures with the given log-likelihoods, keyed "M1", "M2", ..."""
    return {
        int(key[1:]): Mixture(spherical(np.full(int(key[1:]), 1.0), np.arange(float(key[1:]))[:, None]), value)
        for key, value in log_likelihoods.items()
    }


def test_criterion_worked_by_hand():
    assert mixture_parameters(3, 5) == 17
    assert bayesian_information_criterion(-100.0, 3, 5, 50) == pytest.approx(200.0 + 17 * np.log(50))
    assert bayesian_information_criterion(-100.0, 3, 5, 50, 4.0) == pytest.approx(50.0 + 17 * np.log(12.5))
    # The effective sample size is at least two.
    assert bayesian_information_criterion(-8.0, 1, 2, 10, 8.0) == pytest.approx(2.0 + 2 * np.log(2.0))


def test_number_of_independent_states_minimises_the_criterion():
    penalty = 3 * np.log(100)  # of one component with two parameters and its weight
    better, worse = mixtures(M3=-50.0, M2=-50.0 - 0.49 * penalty, M1=-100.0), mixtures(M2=-50.0, M1=-60.0)
    assert number_of_independent(better, 2, 100) == 2
    assert number_of_independent(worse, 2, 100) == 2
    assert number_of_independent(mixtures(M2=-50.0, M1=-50.0 - 0.49 * penalty), 2, 100) == 1
    assert number_of_independent(mixtures(M2=-50.0, M1=-50.0 - 0.51 * penalty), 2, 100) == 2


@pytest.fixture
def design_effects(monkeypatch):
    """Replaces the design effect: that of M components is 10 / M."""
    monkeypatch.setattr(
        "skill.clustering.number_of_states.design_effect", lambda Z, components, groups: 10.0 / len(components)
    )


@pytest.mark.parametrize(
    ("factor", "number"),
    [(1.02, 3), (0.98, 1)],  # of the gain that just supports the third state; the second has no support of its own
)
def test_larger_number_needs_support_under_the_smaller(design_effects, factor, number):
    Z, groups = np.zeros((1000, 1)), np.zeros(1000, dtype=int)
    tau = 5.0  # under two components
    gain = 0.5 * tau * 3 * np.log(1000 / tau)
    candidates = mixtures(M3=-100.0, M2=-100.0 - factor * gain, M1=-100.0 - factor * gain)
    chosen, effect = number_of_demonstrated(candidates, 2, Z, groups)
    assert chosen == number
    assert effect == pytest.approx(10.0 / number)


def test_equal_support_keeps_the_smaller_number(monkeypatch):
    monkeypatch.setattr("skill.clustering.number_of_states.bayesian_information_criterion", lambda *arguments: 1.0)
    monkeypatch.setattr("skill.clustering.number_of_states.design_effect", lambda Z, components, groups: 1.0)
    chosen, _ = number_of_demonstrated(mixtures(M2=0.0, M1=0.0), 2, np.zeros((10, 1)), np.zeros(10, dtype=int))
    assert chosen == 1


def test_missing_numbers_are_skipped(design_effects):
    candidates = mixtures(M1=-1000.0, M4=-10.0)
    assert number_of_demonstrated(candidates, 2, np.zeros((1000, 1)), np.zeros(1000, dtype=int))[0] == 4


@pytest.mark.parametrize(("factor", "number"), [(1.02, 3), (0.98, 2)])
def test_number_for_the_density_minimises_the_criterion_at_the_median_effect(design_effects, factor, number):
    Z, groups = np.zeros((1000, 1)), np.zeros(1000, dtype=int)
    tau = 5.0  # the median of 10, 5 and 10/3
    gain = tau * 3  # of the log-likelihood, for the three parameters of a component and its weight
    candidates = mixtures(M3=-100.0, M2=-100.0 - factor * gain, M1=-100.0 - 3.0 * gain)
    chosen, effect = number_for_density(candidates, 2, Z, groups)
    assert chosen == number
    assert effect == pytest.approx(10.0 / number)


def test_the_density_may_have_more_components_than_there_are_states(design_effects):
    """A step that has no support of its own is passed, where the next has it for both."""
    Z, groups = np.zeros((1000, 1)), np.zeros(1000, dtype=int)
    gain = 5.0 * 3
    candidates = mixtures(M3=-100.0, M2=-100.0 - 0.98 * gain, M1=-100.0 - 2.04 * gain)
    assert number_for_density(candidates, 2, Z, groups)[0] == 2
    candidates = mixtures(M3=-100.0, M2=-100.0 - 2.05 * gain, M1=-100.0 - 2.04 * gain)
    assert number_for_density(candidates, 2, Z, groups)[0] == 3


def test_independent_and_repeated_samples():
    rng = np.random.default_rng(0)
    Z = rng.normal(size=(2000, 2))
    single = components_of_partition(Z, np.zeros(2000, dtype=int), no_prior(2))
    groups = np.repeat(np.arange(200), 10)
    assert design_effect(Z, single, groups) == pytest.approx(1.0, abs=0.15)
    # Ten copies of each sample count as one.
    alone = components_of_partition(Z[:200], np.zeros(200, dtype=int), no_prior(2))
    expected = 10.0 * design_effect(Z[:200], alone, np.arange(200))
    assert design_effect(np.repeat(Z[:200], 10, axis=0), alone, groups) == pytest.approx(expected, rel=1e-9)


def test_three_demonstrations_worked_by_hand():
    # Samples 0, 0, 3 in demonstrations of two: scores of the mean 0, 0, 6; of the variance -2, -2, 16 over sqrt(2).
    # (36 + (4 + 4 + 256) / 2) / 6 samples / 2 parameters * 3 / 2.
    Z = np.array([[0.0], [0.0], [0.0], [0.0], [3.0], [3.0]])
    groups = np.repeat([0, 1, 2], 2)
    assert design_effect(Z, spherical([1.0], [[0.0]]), groups) == pytest.approx(1.5 * (36.0 + 132.0) / 6.0 / 2.0)


def test_design_effect_is_at_least_one():
    Z = np.array([[-1.0], [1.0], [-1.0], [1.0]])
    assert design_effect(Z, spherical([1.0], [[0.0]]), np.array([0, 0, 1, 1])) == 1.0


def test_component_without_samples_has_no_weight():
    Z = np.array([[-1.0]] * 4 + [[1.0]] * 4)
    groups = np.repeat([0, 1], 4)
    two = spherical([0.5, 0.5], [[0.0], [1e3]])
    assert design_effect(Z, two, groups) == pytest.approx(2.0)  # the mean of 4 and 0


@pytest.mark.parametrize("degrees", [np.inf, 4.0])
def test_design_effect_of_a_mixture_sample_by_sample(degrees):
    components = random_components(10, M=2, d=2, degrees=degrees)
    rng = np.random.default_rng(11)
    Z, groups = np.cumsum(rng.normal(size=(40, 2)), axis=0) * 0.5, rng.integers(0, 5, 40)
    p = densities(Z, components)
    h = p / p.sum(axis=1, keepdims=True)
    usual, of_diagonal = score_variances(2, degrees)
    ratios = []
    for i, (v, F) in enumerate(zip(components.means, components.covariances, strict=True)):
        y = np.linalg.solve(np.linalg.cholesky(F), (Z - v).T).T
        w = np.ones(40) if degrees == np.inf else tail_weights((y**2).sum(axis=1), 2, degrees)
        scores = [w * y[:, 0] / np.sqrt(usual), w * y[:, 1] / np.sqrt(usual), w * y[:, 0] * y[:, 1] / np.sqrt(usual)]
        scores += [(w * y[:, a] ** 2 - 1.0) / np.sqrt(2.0 * of_diagonal) for a in range(2)]
        total = sum(np.sum((h[groups == g, i] @ score[groups == g]) ** 2) for g in range(5) for score in scores)
        ratios.append(total / h[:, i].sum())
    assert design_effect(Z, components, groups) == pytest.approx(5 / 4 * np.mean(ratios) / 5)
