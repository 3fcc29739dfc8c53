"""Prediction and storage of Gaussian states."""

import io

import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal, multivariate_t

from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.clustering.gaussian_components import GaussianComponents, distance_gate
from skill.clustering.gaussian_states import UNKNOWN, GaussianStates
from skill.states.contact_state_filter import ContactStateFilter
from tests.skill.clustering.labelled_sets import ellipses, separated

NU = 4.0


@pytest.fixture(scope="module")
def fitted():
    X, y = separated(0, N=1500)
    return CompetitiveAgglomeration(n_init=1, random_state=0).fit(X), X, y


def states():
    """A single standard normal state in two channels."""
    return GaussianStates.from_arrays(
        {
            "weights": np.ones(1),
            "means": np.array([[3.0, -1.0]]),
            "covariances": np.eye(2)[None],
            "precision_factors": np.eye(2)[None],
            "design_effect": np.array(1.0),
        }
    )


def test_probabilities_and_densities_against_scipy(fitted):
    dut, X, _ = fitted
    densities = np.stack(
        [
            P * multivariate_normal(v, F).pdf(X[:50])
            for P, v, F in zip(dut.weights_, dut.means_, dut.covariances_, strict=True)
        ],
        axis=1,
    )
    np.testing.assert_allclose(dut.score_samples(X[:50]), np.log(densities.sum(axis=1)), rtol=1e-9)
    np.testing.assert_allclose(dut.predict_proba(X[:50]), densities / densities.sum(axis=1, keepdims=True), atol=1e-9)
    np.testing.assert_array_equal(dut.predict(X[:50]), densities.argmax(axis=1))


def test_marginal_prediction_is_that_of_the_marginal_gaussians(fitted):
    dut, X, _ = fitted
    channels = [9, 0, 4]
    densities = np.stack(
        [
            P * multivariate_normal(v[channels], F[np.ix_(channels, channels)]).pdf(X[:50, channels])
            for P, v, F in zip(dut.weights_, dut.means_, dut.covariances_, strict=True)
        ],
        axis=1,
    )
    part = X[:50, channels]
    np.testing.assert_allclose(
        dut.predict_proba(part, channels=channels),
        densities / densities.sum(axis=1, keepdims=True),
        atol=1e-9,
    )
    np.testing.assert_allclose(dut.score_samples(part, channels=channels), np.log(densities.sum(axis=1)), rtol=1e-9)
    np.testing.assert_array_equal(dut.predict(part, channels=channels), densities.argmax(axis=1))


FAR = [1e200, 1.7e308, 1e100, 1e30]


@pytest.mark.parametrize("value", FAR)
@pytest.mark.filterwarnings("error:overflow", "error:invalid")
def test_probabilities_far_away_are_finite_and_sum_to_one(value):
    rng = np.random.default_rng(0)
    X = np.vstack([rng.normal(size=(60, 3)), rng.normal(8.0, 3.0, (60, 3))])
    dut = CompetitiveAgglomeration(random_state=0, n_init=1, max_iter=300).fit(X)
    far = value * np.array([[1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [0.0, 0.0, 1.0]])
    probabilities = dut.predict_proba(far)
    np.testing.assert_allclose(probabilities.sum(axis=1), 1.0)
    np.testing.assert_array_equal(dut.predict(far), probabilities.argmax(axis=1))
    assert np.isfinite(dut.score_samples(far)).all()
    assert (dut.predict(far, gate=0.999) == UNKNOWN).all()


@pytest.mark.parametrize("value", FAR)
def test_a_sample_far_away_belongs_to_the_state_with_the_smallest_mahalanobis_distance(value):
    dut = GaussianStates()
    narrow, wide = np.eye(2), 4.0 * np.eye(2)
    dut._set_states(GaussianComponents(np.array([0.9, 0.1]), np.zeros((2, 2)), np.stack([narrow, wide])))
    dut.n_features_in_ = 2
    np.testing.assert_array_equal(dut.predict_proba([[value, value]]), [[0.0, 1.0]])


def stored_and_loaded(states):
    """The states after a way through a file without pickle."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **states.to_arrays())
    buffer.seek(0)
    with np.load(buffer, allow_pickle=False) as stored:
        return GaussianStates.from_arrays(stored)


def test_stored_arrays_predict_identically(fitted):
    dut, X, _ = fitted
    restored = stored_and_loaded(dut)
    for method in ("predict", "predict_proba", "score_samples"):
        np.testing.assert_array_equal(getattr(restored, method)(X), getattr(dut, method)(X))
    np.testing.assert_array_equal(
        restored.predict_proba(X[:, [1, 3]], channels=[1, 3]),
        dut.predict_proba(X[:, [1, 3]], channels=[1, 3]),
    )


def test_damaged_arrays_are_errors(fitted):
    arrays = fitted[0].to_arrays()
    with pytest.raises(ValueError, match=r"'means'.*missing"):
        GaussianStates.from_arrays({k: v for k, v in arrays.items() if k != "means"})
    with pytest.raises(ValueError, match="'covariances' has shape"):
        GaussianStates.from_arrays({**arrays, "covariances": arrays["covariances"][:1]})
    with pytest.raises(ValueError, match=r"'means' has shape \(6,\), expected \(M, d\)"):
        GaussianStates.from_arrays({**arrays, "means": arrays["means"][:, 0]})
    for name in ("weights", "means", "covariances", "precision_factors"):
        with pytest.raises(ValueError, match=f"'{name}' is not finite"):
            GaussianStates.from_arrays({**arrays, name: arrays[name] * np.nan})


def test_a_wrong_number_of_columns_is_an_error():
    with pytest.raises(ValueError, match="X has 2 columns, expected 1"):
        states().predict(np.zeros((1, 2)), channels=[0])


def test_gate_is_the_chi_square_quantile_of_the_channels():
    dut = states()
    step = np.sqrt(distance_gate(0.9, 2))
    assert step**2 == pytest.approx(chi2.ppf(0.9, 2))
    direction = np.array([[step, 0.0]])
    assert dut.predict(dut.means_ + 0.999 * direction, gate=0.9)[0] == 0
    assert dut.predict(dut.means_ + 1.001 * direction, gate=0.9)[0] == UNKNOWN == -1
    marginal = np.sqrt(chi2.ppf(0.9, 1))
    assert dut.predict(dut.means_[:1, :1] + 0.999 * marginal, channels=[0], gate=0.9)[0] == 0
    assert dut.predict(dut.means_[:1, :1] + 1.001 * marginal, channels=[0], gate=0.9)[0] == UNKNOWN


@pytest.mark.parametrize("probability", [0.0, 1.0, -0.5, 1.5])
def test_gate_is_a_probability_between_zero_and_one(probability):
    with pytest.raises(ValueError, match="expected a probability between 0 and 1"):
        distance_gate(probability, 3)


@pytest.fixture(scope="module")
def heavy():
    X, _ = ellipses(0)
    return CompetitiveAgglomeration(tails="heavy", n_init=1, random_state=0).fit(X), X


def test_states_keep_their_tails_in_a_file(heavy):
    dut, X = heavy
    restored = GaussianStates.from_arrays(dut.to_arrays())
    assert restored.degrees_of_freedom_ == dut.degrees_of_freedom_ == NU
    np.testing.assert_array_equal(restored.predict_proba(X), dut.predict_proba(X))
    assert "degrees_of_freedom" not in CompetitiveAgglomeration(n_init=1, random_state=0).fit(X).to_arrays()


def test_posterior_gate_and_filter_know_the_tails(heavy):
    dut, X = heavy
    p = np.stack(
        [
            P * multivariate_t(v, F, df=NU).pdf(X)
            for P, v, F in zip(dut.weights_, dut.means_, dut.covariances_, strict=True)
        ],
        axis=1,
    )
    np.testing.assert_allclose(dut.predict_proba(X), p / p.sum(axis=1, keepdims=True), atol=1e-9)
    np.testing.assert_allclose(dut.score_samples(X), np.log(p.sum(axis=1)))
    causal = ContactStateFilter(dut, np.eye(dut.n_clusters_))
    steps = [causal.step(causal.initial_log_belief(), x) for x in X[:50]]
    np.testing.assert_allclose([step.probabilities for step in steps], dut.predict_proba(X[:50]), atol=1e-12)
    edge = dut.means_[0] + np.sqrt(distance_gate(0.999, 2, NU)) * np.linalg.cholesky(dut.covariances_[0])[:, 0]
    inside, outside = (dut.means_[0] + f * (edge - dut.means_[0]) for f in (0.999, 1.001))
    lonely = GaussianStates()
    lonely._set_states(GaussianComponents(np.ones(1), dut.means_[:1], dut.covariances_[:1], NU))
    lonely.n_features_in_ = 2
    np.testing.assert_array_equal(lonely.predict([inside, outside], gate=0.999), [0, UNKNOWN])


def test_marginals_keep_the_tails():
    dut = GaussianStates()
    dut._set_states(GaussianComponents(np.ones(1), np.zeros((1, 2)), np.diag([1.0, 4.0])[None], NU))
    dut.n_features_in_ = 2
    x = np.array([[3.0]])
    assert dut.score_samples(x, channels=[1])[0] == pytest.approx(multivariate_t([0.0], [[4.0]], df=NU).logpdf(3.0))
