import numpy as np
import pytest

from skill.clustering.cluster_initialization import (
    components_at_centres,
    components_of_partition,
    nearest_centre,
    phase_slices,
    seed_centres,
)
from skill.clustering.expectation_maximization import CovariancePrior
from tests.skill.clustering.components import no_prior


def test_seeds_are_different_samples():
    Z = np.random.default_rng(0).normal(size=(50, 2))
    centres = seed_centres(Z, 7, np.random.RandomState(0))
    assert centres.shape == (7, 2)
    assert len({tuple(c) for c in centres} & {tuple(z) for z in Z}) == 7


@pytest.mark.parametrize("block", [8192, 3])
def test_nearest_centre(block):
    rng = np.random.default_rng(1)
    Z, centres = rng.normal(size=(40, 3)), rng.normal(size=(6, 3))
    expected = np.argmin(np.linalg.norm(Z[:, None] - centres, axis=2), axis=1)
    np.testing.assert_array_equal(nearest_centre(Z, centres, block=block), expected)


def test_phase_slices():
    slices = phase_slices(np.array([0.0, 0.24, 0.25, 0.99, 1.0]), 4)
    np.testing.assert_array_equal(slices, [0, 0, 1, 3, 3])


def test_components_of_a_partition_worked_by_hand():
    Z = np.array([[0.0, 0.0], [10.0, 0.0], [2.0, 0.0], [10.0, 4.0], [1.0, 3.0]])
    labels = np.array([5, 2, 5, 2, 5])
    prior = CovariancePrior(count=1.0, variance=1.0, floor=np.array([0.5, 0.0]), diagonal=False)
    found = components_of_partition(Z, labels, prior)
    np.testing.assert_allclose(found.weights, [0.4, 0.6])
    np.testing.assert_allclose(found.means, [[10.0, 2.0], [1.0, 1.0]])
    # Two samples of variance (0, 4) and one of the prior's, 0.1 / 2 with two clusters in two channels.
    np.testing.assert_allclose(found.covariances[0], np.diag([0.05 / 3 + 0.5, 8.05 / 3]))


def test_components_at_centres_worked_by_hand():
    Z = np.array([[0.0], [2.0], [9.0]])
    found = components_at_centres(Z, np.array([[0.0], [10.0], [100.0]]), no_prior(1))
    np.testing.assert_allclose(found.weights, [0.5, 0.25, 0.25])  # the empty centre has the weight of one sample
    np.testing.assert_array_equal(found.means, [[0.0], [10.0], [100.0]])
    np.testing.assert_allclose(found.covariances[:, 0, 0], [2.0, 1.0, 0.0])


def test_regularised_components_at_centres():
    prior = CovariancePrior(count=1.0, variance=1.0, floor=np.array([0.25]), diagonal=False)
    found = components_at_centres(np.array([[0.0], [2.0]]), np.array([[0.0], [9.0]]), prior)
    # 0.1 * 2^-2 = 0.025 counts as one sample beside two samples of second moment 2, and beside none.
    np.testing.assert_allclose(found.covariances[:, 0, 0], [4.025 / 3 + 0.25, 0.025 + 0.25])
