"""Prediction and storage of Gaussian states."""

import io

import numpy as np
import pytest

from skill.clustering.gaussian_components import GaussianComponents, distance_gate
from skill.clustering.gaussian_states import UNKNOWN, GaussianStates
from tests.skill.clustering.components import densities, random_components


def states_of(components):
    """The states of components."""
    found = GaussianStates()
    found._set_states(components)
    found.n_features_in_ = components.means.shape[1]
    return found


@pytest.mark.parametrize("channels", [None, [2, 0]])
@pytest.mark.parametrize("degrees", [np.inf, 4.0])
def test_probabilities_and_densities_in_all_or_some_channels_are_those_of_scipy(degrees, channels):
    components = random_components(0, degrees=degrees)
    dut, X = states_of(components), np.random.default_rng(1).normal(size=(50, 3 if channels is None else 2))
    c = [0, 1, 2] if channels is None else channels
    part = components.covariances[:, c][:, :, c]
    p = densities(X, GaussianComponents(components.weights, components.means[:, c], part, degrees))
    np.testing.assert_allclose(dut.score_samples(X, channels), np.log(p.sum(axis=1)), rtol=1e-9)
    np.testing.assert_allclose(dut.predict_proba(X, channels), p / p.sum(axis=1, keepdims=True), atol=1e-9)
    np.testing.assert_array_equal(dut.predict(X, channels), p.argmax(axis=1))


@pytest.mark.parametrize("value", [1e200, 1.7e308, 1e100, 1e30])
@pytest.mark.filterwarnings("error:overflow", "error:invalid")
def test_a_sample_far_away_belongs_to_the_state_with_the_smallest_mahalanobis_distance(value):
    both = np.stack([np.eye(2), 4.0 * np.eye(2)])
    dut = states_of(GaussianComponents(np.array([0.9, 0.1]), np.zeros((2, 2)), both))
    far = [[value, value]]
    np.testing.assert_array_equal(dut.predict_proba(far), [[0.0, 1.0]])
    assert np.isfinite(dut.score_samples(far)).all()
    assert dut.predict(far, gate=0.999)[0] == UNKNOWN == -1


@pytest.mark.parametrize("degrees", [np.inf, 4.0])
def test_stored_arrays_predict_identically(degrees):
    dut, X = states_of(random_components(0, degrees=degrees)), np.random.default_rng(1).normal(size=(50, 3))
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **dut.to_arrays())
    buffer.seek(0)
    with np.load(buffer, allow_pickle=False) as stored:
        restored = GaussianStates.from_arrays(stored)
    np.testing.assert_array_equal(restored.log_densities(X), dut.log_densities(X))
    np.testing.assert_array_equal(restored.predict(X, gate=0.5), dut.predict(X, gate=0.5))
    assert ("degrees_of_freedom" in dut.to_arrays()) == (degrees == 4.0)


def test_a_wrong_number_of_columns_is_an_error():
    with pytest.raises(ValueError, match="X has 2 columns, expected 1"):
        states_of(random_components(0)).predict(np.zeros((1, 2)), channels=[0])


@pytest.mark.parametrize("channels", [None, [0]])
@pytest.mark.parametrize("degrees", [np.inf, 4.0])
def test_samples_beyond_the_gate_of_their_channels_are_unknown(degrees, channels):
    dut = states_of(GaussianComponents(np.ones(1), np.array([[3.0, -1.0]]), np.eye(2)[None], degrees))
    d = 2 if channels is None else 1
    edge = np.eye(d)[:1] * np.sqrt(distance_gate(0.9, d, degrees))
    assert dut.predict(dut.means_[:, :d] + 0.999 * edge, channels, gate=0.9)[0] == 0
    assert dut.predict(dut.means_[:, :d] + 1.001 * edge, channels, gate=0.9)[0] == UNKNOWN


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [((0, 1, 0), 1.0, "upper triangular"), ((0, 0, 0), -1.0, "positive diagonal"), ((0, 0, 1), 9.0, "does not belong")],
)
def test_precision_factors_that_do_not_fit_are_refused(place, value, message):
    arrays = states_of(random_components(0)).to_arrays()
    arrays["precision_factors"][place] = value
    with pytest.raises(ValueError, match=message):
        GaussianStates.from_arrays(arrays)
