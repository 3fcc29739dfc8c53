import numpy as np
import pytest

from skill.clustering.cluster_merging import Mixture
from skill.clustering.state_number import (
    bayesian_information_criterion,
    mixture_parameters,
    number_for_density,
    number_of_demonstrated,
    number_of_independent,
)
from tests.skill.clustering.components import spherical


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


def test_effective_sample_size_in_the_criterion_is_at_least_two():
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
        "skill.clustering.state_number.design_effect", lambda Z, components, groups: 10.0 / len(components)
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
    monkeypatch.setattr("skill.clustering.state_number.bayesian_information_criterion", lambda *arguments: 1.0)
    monkeypatch.setattr("skill.clustering.state_number.design_effect", lambda Z, components, groups: 1.0)
    chosen, _ = number_of_demonstrated(mixtures(M2=0.0, M1=0.0), 2, np.zeros((10, 1)), np.zeros(10, dtype=int))
    assert chosen == 1


def test_single_candidate(design_effects):
    assert number_of_demonstrated(mixtures(M2=0.0), 2, np.zeros((10, 1)), np.zeros(10, dtype=int)) == (2, 5.0)


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
