import numpy as np
import pytest

from skill.clustering.standardised_samples import StandardisedSamples
from tests.skill.clustering.components import random_components

X = np.random.default_rng(0).normal(size=(200, 3)) * [1.0, 10.0, 0.1] + [5.0, 0.0, -2.0]


def test_standardised_channels():
    data = StandardisedSamples.of(X, centred=True, scaled=True)
    np.testing.assert_allclose(data.Z.mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(data.Z.std(axis=0), 1.0)
    np.testing.assert_allclose(data.shift + data.scale * data.Z, X)


def test_centring_and_scaling_are_optional():
    np.testing.assert_array_equal(StandardisedSamples.of(X, centred=False, scaled=False).Z, X)
    centred = StandardisedSamples.of(X, centred=True, scaled=False)
    np.testing.assert_allclose(centred.Z, X - X.mean(axis=0))
    scaled = StandardisedSamples.of(X, centred=False, scaled=True)
    np.testing.assert_allclose(scaled.Z, X / X.std(axis=0))


def test_channel_that_varies_by_round_off_only_keeps_its_unit():
    alternating = np.array([1.0, -1.0, 1.0, -1.0])
    eps = np.finfo(float).eps
    samples = 100.0 + 100.0 * eps * np.column_stack([0.0 * alternating, 8.0 * alternating, 16.0 * alternating])
    scale = StandardisedSamples.of(samples, centred=True, scaled=True).scale
    np.testing.assert_array_equal(scale[:2], [1.0, 1.0])
    assert scale[2] < 1e-10


@pytest.mark.parametrize("n", [300, 100_000])
@pytest.mark.parametrize("value", [0.1, -1.0 / 3.0, 1e6 + 0.1])
def test_constant_channel_keeps_its_unit_for_any_number_of_samples(n, value):
    """The error of the mean grows with n: the standard deviation of 300 numbers 0.1 is 5e-16."""
    samples = np.column_stack([np.full(n, value), np.linspace(0.0, 1.0, n)])
    scale = StandardisedSamples.of(samples, centred=True, scaled=True).scale
    np.testing.assert_array_equal(scale, [1.0, samples.std(axis=0)[1]])


def test_restored_components_have_the_units_of_the_samples():
    data = StandardisedSamples.of(X, centred=True, scaled=True)
    components = random_components(0)
    restored = data.restored(components)
    order = np.argsort(components.weights)[::-1]
    np.testing.assert_array_equal(restored.weights, components.weights[order])
    np.testing.assert_allclose(restored.means, data.shift + data.scale * components.means[order])
    S = np.diag(data.scale)
    np.testing.assert_allclose(restored.covariances, S @ components.covariances[order] @ S)
