import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal

from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.states.contact_state_filter import ContactStateFilter, StateEstimator


def states(M=3, d=4, seed=0):
    """A classifier with known states, without a fit."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(M, d, d))
    covariances = A @ A.transpose(0, 2, 1) + np.eye(d)
    factors = np.stack([np.linalg.inv(np.linalg.cholesky(F)).T for F in covariances])
    return CompetitiveAgglomeration.from_arrays(
        {
            "weights": rng.dirichlet(np.ones(M)),
            "means": rng.normal(size=(M, d)) * 3.0,
            "covariances": covariances,
            "precision_factors": factors,
            "design_effect": np.array(1.0),
            "distance": np.array("fmle"),
        }
    )


@pytest.mark.parametrize("channels", [None, [0, 2]])
def test_without_transitions_it_is_the_posterior(channels):
    model = states()
    dut = ContactStateFilter(model, gate=None, channels=channels)
    X = np.random.default_rng(1).normal(size=(20, 4 if channels is None else 2)) * 3.0
    probabilities = np.stack([dut.step(dut.initial_log_belief(), x).probabilities for x in X])
    np.testing.assert_allclose(probabilities, model.predict_proba(X, channels=channels), atol=1e-12)
    distances = [dut.step(dut.initial_log_belief(), x).mahalanobis for x in X]
    labels = model.predict(X, channels=channels)
    np.testing.assert_allclose(distances, model.mahalanobis(X, channels=channels)[np.arange(20), labels])


def test_forward_recursion_worked_by_hand():
    model = states(M=2, d=1)
    A = np.array([[0.9, 0.1], [0.3, 0.7]])
    dut = ContactStateFilter(model, gate=None, transitions=A)
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


def test_unknown_sample_leaves_the_belief_to_the_transitions():
    model = states(M=2, d=3)
    A = np.array([[0.8, 0.2], [0.4, 0.6]])
    far = np.full(3, 1e4)
    estimate = ContactStateFilter(model, transitions=A).step(np.log([0.5, 0.5]), far)
    assert not estimate.known
    np.testing.assert_allclose(estimate.probabilities, A.T @ [0.5, 0.5])
    kept = ContactStateFilter(model).step(np.log([0.25, 0.75]), far)
    np.testing.assert_allclose(kept.probabilities, [0.25, 0.75])


def test_gate_is_the_chi_square_quantile():
    model = states(M=1, d=4)
    step = float(np.sqrt(chi2.ppf(0.99, 4)))
    direction = np.linalg.cholesky(model.covariances_[0])[:, 0]
    dut = ContactStateFilter(model, gate=0.99)
    assert dut.step([0.0], model.means_[0] + 0.999 * step * direction).known
    assert not dut.step([0.0], model.means_[0] + 1.001 * step * direction).known


def test_step_changes_neither_its_arguments_nor_the_filter():
    dut = ContactStateFilter(states(), transitions=np.full((3, 3), 1 / 3))
    log_belief = dut.initial_log_belief()
    before = log_belief.copy()
    first = dut.step(log_belief, np.zeros(4))
    second = dut.step(log_belief, np.zeros(4))
    np.testing.assert_array_equal(log_belief, before)
    np.testing.assert_array_equal(first.log_belief, second.log_belief)
    first.log_belief[:] = 0.0
    np.testing.assert_array_equal(dut.step(before, np.zeros(4)).log_belief, second.log_belief)


def test_transitions_bridge_a_sample_that_looks_like_another_state():
    model = states(M=2, d=1)
    sticky = np.array([[0.999, 0.001], [0.001, 0.999]])
    estimator = StateEstimator(ContactStateFilter(model, gate=None, transitions=sticky))
    for _ in range(20):
        home, _ = estimator.update(model.means_[0])
    between = 0.4 * model.means_[0] + 0.6 * model.means_[1]
    assert estimator.update(between)[0] == home == 0
    np.testing.assert_allclose(estimator.reset().log_belief, np.log(model.weights_))


def test_certain_belief_can_be_revised():
    model = states(M=2, d=1)
    dut = ContactStateFilter(model, gate=None, transitions=np.array([[0.9, 0.1], [0.1, 0.9]]))
    estimate = dut.step([0.0, -np.inf], model.means_[1])
    assert np.isfinite(estimate.log_belief).all()
    assert estimate.probabilities.sum() == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"gate": 1.5}, "gate=1.5"),
        ({"transitions": np.eye(2)}, r"expected \(3, 3\)"),
        ({"transitions": np.ones((3, 3))}, "each row summing to one"),
        ({"channels": [0, 9]}, "between 0 and 3"),
    ],
)
def test_wrong_arguments(arguments, message):
    with pytest.raises(ValueError, match=message):
        ContactStateFilter(states(), **arguments)


def test_wrong_samples():
    dut = ContactStateFilter(states())
    with pytest.raises(ValueError, match=r"expected \(4,\)"):
        dut.step(dut.initial_log_belief(), np.zeros(3))
    with pytest.raises(ValueError, match="not finite"):
        dut.step(dut.initial_log_belief(), np.full(4, np.nan))
