import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal

from skill.clustering.gaussian_states import GaussianStates
from skill.states.contact_state_filter import ContactStateFilter
from tests.skill.clustering.components import random_components


def states(M=3, d=4, degrees=np.inf):
    """A classifier with known states, without a fit."""
    found = GaussianStates()
    found._set_states(random_components(0, M, d, degrees))
    found.n_features_in_ = d
    return found


@pytest.mark.parametrize("degrees", [np.inf, 4.0])
@pytest.mark.parametrize("channels", [None, [0, 2]])
def test_the_probabilities_at_the_first_sample_are_the_posterior(channels, degrees):
    model = states(degrees=degrees)
    dut = ContactStateFilter(model, np.eye(3), gate=None, channels=channels)
    X = np.random.default_rng(1).normal(size=(20, 4 if channels is None else 2)) * 3.0
    probabilities = np.stack([dut.step(dut.initial_log_belief(), x).probabilities for x in X])
    np.testing.assert_allclose(probabilities, model.predict_proba(X, channels=channels), atol=1e-12)


def test_forward_recursion_worked_by_hand():
    model = states(M=2, d=1)
    A = np.array([[0.9, 0.1], [0.3, 0.7]])
    dut = ContactStateFilter(model, A, gate=None)
    belief = model.weights_
    log_belief = dut.initial_log_belief()
    for x in (0.3, -1.2, 2.0):
        likelihood = [multivariate_normal(m, F).pdf(x) for m, F in zip(model.means_, model.covariances_, strict=True)]
        belief = (A.T @ belief) * likelihood
        belief /= belief.sum()
        estimate = dut.step(log_belief, [x])
        log_belief = estimate.log_belief
        np.testing.assert_allclose(estimate.probabilities, belief, rtol=1e-12)
        np.testing.assert_allclose(np.exp(log_belief), belief, rtol=1e-12)


def test_unknown_sample_only_propagates_the_belief():
    model = states(M=2, d=3)
    A = np.array([[0.8, 0.2], [0.4, 0.6]])
    far = np.full(3, 1e4)
    estimate = ContactStateFilter(model, A).step(np.log([0.5, 0.5]), far)
    assert not estimate.known
    np.testing.assert_allclose(estimate.probabilities, A.T @ [0.5, 0.5])


def test_the_gate_is_on_by_default():
    model = states(M=1, d=4)
    direction = np.linalg.cholesky(model.covariances_[0])[:, 0]
    dut = ContactStateFilter(model, np.eye(1))
    limit = np.sqrt(chi2.ppf(0.999, 4))
    assert dut.step([0.0], model.means_[0] + 0.999 * limit * direction).known
    assert not dut.step([0.0], model.means_[0] + 1.001 * limit * direction).known
    assert ContactStateFilter(model, np.eye(1), gate=None).step([0.0], model.means_[0] + 1e3).known


def test_the_gate_uses_the_state_most_probable_with_the_sample():
    model = states(M=2, d=1)
    dut = ContactStateFilter(model, [[0.5, 0.5], [0.5, 0.5]], gate=1e-6)
    assert all(dut.step(np.log([0.5, 0.5]), mean).known for mean in model.means_)


def test_certain_belief_can_be_revised():
    model = states(M=2, d=1)
    dut = ContactStateFilter(model, [[0.9, 0.1], [0.1, 0.9]], gate=None)
    estimate = dut.step([0.0, -np.inf], model.means_[1])
    assert np.isfinite(estimate.log_belief).all()
    assert estimate.probabilities.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("channels", [[0], None])
@pytest.mark.parametrize("gate", [0.999, None])
@pytest.mark.parametrize("value", [1e200, -1e200, 1.7e308])
@pytest.mark.filterwarnings("error")
def test_a_sample_far_away_has_finite_probabilities(channels, gate, value):
    dut = ContactStateFilter(states(), np.full((3, 3), 1.0 / 3.0), channels=channels, gate=gate)
    estimate = dut.step(dut.initial_log_belief(), np.full(dut.n_channels, value))
    assert estimate.probabilities.sum() == pytest.approx(1.0)
    assert estimate.known == (gate is None)
