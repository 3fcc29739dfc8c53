"""Prediction and storage of Gaussian states."""

import io

import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal
from sklearn.exceptions import ConvergenceWarning, NotFittedError

from benchmarks.learners.cluster_sets import separated, spheres
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.clustering.gaussian_components import GaussianComponents
from skill.clustering.gaussian_states import UNKNOWN, GaussianStates
from skill.clustering.student_tails import distance_gate
from tests.skill.clustering.components import random_components


@pytest.fixture(scope="module")
def fitted():
    X, y = separated(0, N=1500)
    return CompetitiveAgglomeration(n_init=1, random_state=0).fit(X), X, y


def states():
    """A single standard normal state in two channels."""
    return CompetitiveAgglomeration.from_arrays(
        {
            "weights": np.ones(1),
            "means": np.array([[3.0, -1.0]]),
            "covariances": np.eye(2)[None],
            "precision_factors": np.eye(2)[None],
            "design_effect": np.array(1.0),
            "distance": np.array("fmle"),
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


def test_order_of_the_channels_does_not_matter(fitted):
    dut, X, _ = fitted
    order = np.random.default_rng(0).permutation(14)
    np.testing.assert_allclose(dut.predict_proba(X[:, order], channels=order), dut.predict_proba(X), atol=1e-9)


def test_gate_rejects_the_nominal_share_and_all_distant_samples(fitted):
    dut, X, _ = fitted
    unknown = np.mean(dut.predict(X, gate=0.95) == -1)
    assert 0.02 < unknown < 0.08
    assert (dut.predict(X + 100.0, gate=0.999) == -1).all()
    assert (dut.predict(X[:, [0, 1]] + 100.0, channels=[0, 1], gate=0.999) == -1).all()
    far = dut.mahalanobis(X).min(axis=1) > chi2.ppf(0.95, 14)
    np.testing.assert_array_equal(far, dut.predict(X, gate=0.95) == -1)


FAR = [1e200, 1.7e308, 1e100, 1e30]


@pytest.mark.parametrize("distance", [{}, {"distance": "gk", "merge": None}, {"distance": "euclid", "merge": None}])
@pytest.mark.parametrize("value", FAR)
@pytest.mark.filterwarnings("error:overflow", "error:invalid")
def test_probabilities_far_away_are_finite_and_sum_to_one(distance, value):
    rng = np.random.default_rng(0)
    X = np.vstack([rng.normal(size=(60, 3)), rng.normal(8.0, 3.0, (60, 3))])
    dut = CompetitiveAgglomeration(random_state=0, n_init=1, max_iter=300, **distance).fit(X)
    far = value * np.array([[1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [0.0, 0.0, 1.0]])
    probabilities = dut.predict_proba(far)
    np.testing.assert_allclose(probabilities.sum(axis=1), 1.0)
    np.testing.assert_array_equal(dut.predict(far), probabilities.argmax(axis=1))
    assert np.isfinite(dut.score_samples(far)).all()
    assert (dut.predict(far, gate=0.999) == UNKNOWN).all()


@pytest.mark.parametrize("value", FAR)
def test_a_sample_far_away_belongs_to_the_state_with_the_smallest_mahalanobis_distance(value):
    dut = CompetitiveAgglomeration()
    narrow, wide = np.eye(2), 4.0 * np.eye(2)
    dut._set_states(GaussianComponents(np.array([0.9, 0.1]), np.zeros((2, 2)), np.stack([narrow, wide])))
    dut.n_features_in_ = 2
    np.testing.assert_array_equal(dut.predict_proba([[value, value]]), [[0.0, 1.0]])


def test_bic_prefers_the_fit_to_a_single_gaussian(fitted):
    dut, X, _ = fitted
    single = CompetitiveAgglomeration(m_init=1, n_init=1).fit(X)
    assert single.n_clusters_ == 1
    assert dut.bic(X) < single.bic(X)


def stored_and_loaded(states):
    """The states after a way through a file without pickle."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **states.to_arrays())
    buffer.seek(0)
    with np.load(buffer, allow_pickle=False) as stored:
        return type(states).from_arrays(stored)


def test_stored_arrays_predict_identically(fitted):
    dut, X, _ = fitted
    restored = stored_and_loaded(dut)
    for method in ("predict", "predict_proba", "score_samples", "mahalanobis"):
        np.testing.assert_array_equal(getattr(restored, method)(X), getattr(dut, method)(X))
    np.testing.assert_array_equal(
        restored.predict_proba(X[:, [1, 3]], channels=[1, 3]),
        dut.predict_proba(X[:, [1, 3]], channels=[1, 3]),
    )
    assert restored.bic(X) == dut.bic(X)


def test_stored_arrays_of_prototypes_predict_identically():
    X, _ = spheres(0)
    dut = CompetitiveAgglomeration("gk", merge=None, n_init=1, random_state=0)
    with pytest.warns(ConvergenceWarning):
        dut.fit(X)
    restored = CompetitiveAgglomeration.from_arrays(dut.to_arrays())
    np.testing.assert_array_equal(restored.predict_proba(X), dut.predict_proba(X))


def test_loaded_states_report_the_parameters_of_the_fit(fitted):
    X = fitted[1]
    dut = CompetitiveAgglomeration(covariance_type="diag", m_init=3, reg_covar=0.05, n_init=1, eta0=0.1, random_state=7)
    assert stored_and_loaded(dut.fit(X)).get_params() == dut.get_params()


def test_parameters_that_are_arrays_and_generators(fitted):
    X = fitted[1]
    dut = CompetitiveAgglomeration(
        init=X[:4].astype(np.float32),
        sensor_variance=np.linspace(0.0, 1.3, 14),
        m_init=np.int64(3),
        standardize=np.bool_(True),
        shrinkage=0.1 + 0.2,
        random_state=np.random.RandomState(0),
    ).fit(X)
    loaded = stored_and_loaded(dut).get_params()
    assert loaded["init"].dtype == np.float32
    np.testing.assert_array_equal(loaded.pop("init"), dut.init)
    np.testing.assert_array_equal(loaded.pop("sensor_variance"), dut.sensor_variance)
    assert loaded["random_state"] is None
    assert loaded["shrinkage"] == 0.1 + 0.2
    same = {name: value for name, value in dut.get_params().items() if name in loaded and name != "random_state"}
    assert {name: loaded[name] for name in same} == same
    dut.set_params(init=object())
    with pytest.raises(TypeError, match="a parameter of type object cannot be stored"):
        dut.to_arrays()


def test_arrays_of_earlier_versions_load_with_default_parameters(fitted):
    dut, X, _ = fitted
    arrays = dut.to_arrays()
    del arrays["parameters"]
    loaded = CompetitiveAgglomeration.from_arrays(arrays)
    assert loaded.get_params() == CompetitiveAgglomeration().get_params()
    np.testing.assert_array_equal(loaded.predict_proba(X), dut.predict_proba(X))


def test_unknown_parameters_are_errors(fitted):
    arrays = fitted[0].to_arrays()
    with pytest.raises(ValueError, match=r"parameters \['colour'\] are not parameters of CompetitiveAgglomeration"):
        CompetitiveAgglomeration.from_arrays({**arrays, "parameters": np.array('{"colour": 1}')})


def test_stored_arrays_are_copies(fitted):
    dut = fitted[0]
    arrays = dut.to_arrays()
    loaded = CompetitiveAgglomeration.from_arrays(arrays)
    for name in ("weights", "means", "covariances", "precision_factors"):
        assert not np.shares_memory(arrays[name], getattr(dut, f"{name}_"))
        assert not np.shares_memory(arrays[name], getattr(loaded, f"{name}_"))
    assert loaded.n_clusters_ == dut.n_clusters_
    assert loaded.n_features_in_ == 14
    assert loaded.design_effect_ == dut.design_effect_


def test_damaged_arrays_are_errors(fitted):
    arrays = fitted[0].to_arrays()
    with pytest.raises(ValueError, match=r"'means'.*missing"):
        CompetitiveAgglomeration.from_arrays({k: v for k, v in arrays.items() if k != "means"})
    with pytest.raises(ValueError, match="'covariances' has shape"):
        CompetitiveAgglomeration.from_arrays({**arrays, "covariances": arrays["covariances"][:1]})
    with pytest.raises(ValueError, match=r"'means' has shape \(6,\), expected \(M, d\)"):
        CompetitiveAgglomeration.from_arrays({**arrays, "means": arrays["means"][:, 0]})
    for name in ("weights", "means", "covariances", "precision_factors"):
        with pytest.raises(ValueError, match=f"'{name}' is not finite"):
            CompetitiveAgglomeration.from_arrays({**arrays, name: arrays[name] * np.nan})


@pytest.mark.parametrize("channels", [[0, 0], [2], [0, 2], [-1], [1, -1], [], [0.5], [[0]]])
def test_wrong_channels_are_errors(channels):
    dut = states()
    with pytest.raises(ValueError, match="expected different indices between 0 and 1"):
        dut.predict_proba(np.zeros((1, 1)), channels=channels)


def test_wrong_numbers_of_columns_and_gates_are_errors():
    dut = states()
    with pytest.raises(ValueError, match="X has 2 columns, expected 1"):
        dut.predict(np.zeros((1, 2)), channels=[0])
    with pytest.raises(ValueError, match=r"gate=2.0: expected a probability"):
        dut.predict(np.zeros((1, 2)), gate=2.0)


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


@pytest.mark.parametrize(("covariance_type", "parameters"), [("full", 9), ("diag", 6)])
def test_criterion_worked_by_hand(covariance_type, parameters):
    X, y = separated(0, N=300, d=3)
    dut = CompetitiveAgglomeration(covariance_type=covariance_type, init=y, merge=None, max_iter=300)
    dut.fit(X, groups=np.arange(300) // 5)
    M, tau = dut.n_clusters_, dut.design_effect_
    assert tau > 1.0
    K = M * parameters + M - 1
    expected = -2.0 * dut.score_samples(X).sum() / tau + K * np.log(300 / tau)
    assert dut.bic(X) == pytest.approx(expected)
    assert dut.score(X) == pytest.approx(dut.score_samples(X).mean())


def test_prototypes_assign_samples_by_their_distance():
    X, _ = spheres(0)
    dut = CompetitiveAgglomeration("euclid", merge=None, n_init=1, random_state=0).fit(X)
    d2 = ((X[:, None] - dut.means_) ** 2).sum(axis=2)
    np.testing.assert_array_equal(dut.labels_, d2.argmin(axis=1))
    u = (1.0 / d2) / (1.0 / d2).sum(axis=1, keepdims=True)
    np.testing.assert_allclose(dut.predict_proba(X), u)
    # Densities are those of the Gaussians all the same.
    assert np.isfinite(dut.score_samples(X)).all()


def test_states_have_to_be_fitted():
    with pytest.raises(NotFittedError):
        CompetitiveAgglomeration().to_arrays()
    with pytest.raises(NotFittedError):
        CompetitiveAgglomeration().marginal()


def test_states_of_a_subclass_are_gaussian_and_of_independent_samples_by_default():
    dut = GaussianStates()
    dut._set_states(random_components(0))
    assert (dut.n_clusters_, dut.distance_, dut.design_effect_) == (4, "fmle", 1.0)
