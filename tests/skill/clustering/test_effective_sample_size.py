import numpy as np
import pytest

from skill.clustering.cluster_initialization import components_of_partition
from skill.clustering.effective_sample_size import design_effect
from tests.skill.clustering.components import densities, no_prior, random_components, spherical


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


def test_two_demonstrations_worked_by_hand():
    # One Gaussian N(0, 1) and two demonstrations of four equal samples at -1 and 1. The scores of the mean sum to -4
    # and 4, those of the variance, (z^2 - 1) / sqrt(2), to zero. (16 + 16) / 8 samples / 2 parameters = 2; the factor
    # J / (J - 1) = 2 makes it 4, the number of copies.
    Z = np.array([[-1.0]] * 4 + [[1.0]] * 4)
    groups = np.repeat([0, 1], 4)
    assert design_effect(Z, spherical([1.0], [[0.0]]), groups) == pytest.approx(4.0)


def test_three_demonstrations_worked_by_hand():
    # Samples 0, 0, 3 in demonstrations of two: scores of the mean 0, 0, 6; of the variance -2, -2, 16 over sqrt(2).
    # (36 + (4 + 4 + 256) / 2) / 6 samples / 2 parameters * 3 / 2.
    Z = np.array([[0.0], [0.0], [0.0], [0.0], [3.0], [3.0]])
    groups = np.repeat([0, 1, 2], 2)
    assert design_effect(Z, spherical([1.0], [[0.0]]), groups) == pytest.approx(1.5 * (36.0 + 132.0) / 6.0 / 2.0)


def test_scores_of_a_mixture_sample_by_sample():
    rng = np.random.default_rng(1)
    components = random_components(2, M=3, d=2)
    Z = np.cumsum(rng.normal(size=(40, 2)), axis=0) * 0.5
    groups = rng.integers(0, 5, 40)
    p = densities(Z, components)
    h = p / p.sum(axis=1, keepdims=True)
    ratios = []
    for i in range(3):
        L = np.linalg.cholesky(components.covariances[i])
        w = np.linalg.solve(L, (Z - components.means[i]).T).T
        outer = (w[:, :, None] * w[:, None, :] - np.eye(2)) / np.sqrt(2.0)
        total = 0.0
        for g in range(5):
            mine = groups == g
            total += np.square(h[mine, i] @ w[mine]).sum()
            total += np.square(np.einsum("t,tab->ab", h[mine, i], outer[mine])).sum()
        ratios.append(total / h[:, i].sum())
    expected = 5 / 4 * np.mean(ratios) / 5
    assert expected > 1.0
    assert design_effect(Z, components, groups) == pytest.approx(expected)


def test_design_effect_is_at_least_one():
    Z = np.array([[-1.0], [1.0], [-1.0], [1.0]])
    assert design_effect(Z, spherical([1.0], [[0.0]]), np.array([0, 0, 1, 1])) == 1.0


def test_component_without_samples_has_no_weight():
    Z = np.array([[-1.0]] * 4 + [[1.0]] * 4)
    groups = np.repeat([0, 1], 4)
    two = spherical([0.5, 0.5], [[0.0], [1e3]])
    assert design_effect(Z, two, groups) == pytest.approx(2.0)  # the mean of 4 and 0


def test_block_size_does_not_matter(monkeypatch):
    rng = np.random.default_rng(0)
    Z = np.cumsum(rng.normal(size=(60, 2)), axis=0)
    groups = np.repeat([0, 1, 2], 20)
    components = random_components(0, M=2, d=2)
    whole = design_effect(Z, components, groups)
    monkeypatch.setattr("skill.clustering.expectation_maximization.BLOCK", 7)
    assert design_effect(Z, components, groups) == pytest.approx(whole)
