from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal, multivariate_t
from sklearn.exceptions import ConvergenceWarning
from sklearn.metrics import adjusted_rand_score

from benchmarks.learners.cluster_sets import ellipses
from benchmarks.learners.clustering import with_outliers
from skill.clustering.cluster_initialization import components_of_partition
from skill.clustering.cluster_merging import merge_closest, merged_pair
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.clustering.effective_sample_size import design_effect
from skill.clustering.expectation_maximization import em_step, expectation_maximization
from skill.clustering.gaussian_components import (
    GaussianComponents,
    log_normalizers,
    precision_factors,
    squared_mahalanobis,
)
from skill.clustering.gaussian_states import UNKNOWN
from skill.clustering.student_tails import distance_gate, score_variances, tail_weights, tailed_log_densities
from skill.states.contact_state_filter import ContactStateFilter
from tests.skill.clustering.components import no_prior, random_components, spherical

NU = 4.0


def student_samples(seed, n, v, F, degrees=NU):
    return multivariate_t(v, F, df=degrees, seed=np.random.default_rng(seed)).rvs(n)


@pytest.mark.parametrize("degrees", [1.0, 4.0, np.inf])
def test_densities_are_those_of_scipy(degrees):
    components = random_components(0, M=3, d=4)
    X = np.random.default_rng(1).normal(scale=4.0, size=(20, 4))
    factors = precision_factors(components.covariances)
    squared = squared_mahalanobis(X, components.means, factors)
    found = tailed_log_densities(log_normalizers(components.weights, factors), squared, 4, degrees)
    for i, (P, v, F) in enumerate(zip(components.weights, components.means, components.covariances, strict=True)):
        true = multivariate_normal(v, F) if np.isinf(degrees) else multivariate_t(v, F, df=degrees)
        np.testing.assert_allclose(found[:, i], np.log(P) + true.logpdf(X), rtol=1e-10)


def test_gate_worked_by_hand():
    # In two channels, P(q > x) = (1 + x / nu)^(-nu / 2).
    assert distance_gate(0.99, 2, NU) == pytest.approx(NU * (0.01 ** (-2.0 / NU) - 1.0))
    assert distance_gate(0.99, 3) == pytest.approx(chi2.ppf(0.99, 3))


def test_weights_worked_by_hand():
    np.testing.assert_allclose(tail_weights(np.array([0.0, 3.0, 60.0]), 3, NU), [7 / 4, 1.0, 7 / 64])


def test_moments_are_weighted_by_the_tails():
    Z = np.random.default_rng(2).standard_t(3.0, size=(50, 2))
    components = replace(random_components(3, M=2, d=2), degrees=NU)
    columns, weights = [], []
    for P, v, F in zip(components.weights, components.means, components.covariances, strict=True):
        columns.append(P * multivariate_t(v, F, df=NU).pdf(Z))
        weights.append((NU + 2) / (NU + np.einsum("na,ab,nb->n", Z - v, np.linalg.inv(F), Z - v)))
    p, w = np.stack(columns, axis=1), np.stack(weights, axis=1)
    h = p / p.sum(axis=1, keepdims=True)
    step = em_step(Z, components)
    assert step.log_likelihood == pytest.approx(np.log(p.sum(axis=1)).sum())
    np.testing.assert_allclose(step.cardinalities, h.sum(axis=0))
    np.testing.assert_allclose(step.weight_sums, (h * w).sum(axis=0))
    for i in range(2):
        np.testing.assert_allclose(step.means[i], np.average(Z, axis=0, weights=h[:, i] * w[:, i]))
        np.testing.assert_allclose(step.covariances[i], np.cov(Z.T, aweights=h[:, i] * w[:, i], bias=True))


def test_the_likelihood_never_falls():
    Z = np.vstack([student_samples(4, 200, np.zeros(2), np.eye(2)), student_samples(5, 100, [4.0, 0.0], np.eye(2))])
    components = replace(spherical([0.5, 0.5], [[-1.0, 0.0], [1.0, 0.0]]), degrees=NU)
    values = []
    for _ in range(40):
        components, value, _ = expectation_maximization(Z, components, no_prior(2), max_iter=2, tol=-np.inf)
        values.append(value)
    assert (np.diff(values) > -1e-9).all()
    assert values[-1] > values[0] + 5.0


def test_location_and_scale_of_a_student_distribution_are_found():
    F = np.array([[2.0, 0.7], [0.7, 0.5]])
    Z = student_samples(6, 20_000, [1.0, -2.0], F)
    start = replace(components_of_partition(Z, np.zeros(len(Z), dtype=int), no_prior(2)), degrees=NU)
    found, _, converged = expectation_maximization(Z, start, no_prior(2), max_iter=200, tol=1e-9)
    assert converged
    assert found.degrees == NU
    np.testing.assert_allclose(found.means[0], [1.0, -2.0], atol=0.03)
    np.testing.assert_allclose(found.covariances[0], F, rtol=0.04)


@pytest.mark.parametrize("d", [1, 3])
def test_variances_of_the_scores(d):
    y = student_samples(7, 400_000, np.zeros(d), np.eye(d)).reshape(-1, d)
    w = tail_weights((y**2).sum(axis=1), d, NU)
    usual, of_diagonal = score_variances(d, NU)
    assert (w * y[:, 0]).var() == pytest.approx(usual, rel=0.01)
    assert (w * y[:, 0] ** 2).var() / 2.0 == pytest.approx(of_diagonal, rel=0.01)
    if d > 1:
        assert (w * y[:, 0] * y[:, 1]).var() == pytest.approx(usual, rel=0.01)
    assert score_variances(d, np.inf) == (1.0, 1.0)


def test_design_effect_of_independent_and_of_repeated_samples():
    Z = student_samples(8, 4000, np.zeros(3), np.eye(3))
    start = replace(spherical([1.0], [np.zeros(3)]), degrees=NU)
    fitted, _, _ = expectation_maximization(Z, start, no_prior(3), max_iter=200, tol=1e-9)
    assert design_effect(Z, fitted, np.repeat(np.arange(400), 10)) == pytest.approx(1.0, abs=0.15)
    five, ten = (design_effect(np.repeat(Z[:400], n, axis=0), fitted, np.repeat(np.arange(400), n)) for n in (5, 10))
    assert five > 2.0
    assert ten == pytest.approx(2.0 * five, rel=1e-9)


def test_design_effect_of_a_mixture_sample_by_sample():
    components = replace(random_components(10, M=2, d=2), degrees=NU)
    rng = np.random.default_rng(11)
    Z, groups = np.cumsum(rng.normal(size=(40, 2)), axis=0) * 0.5, rng.integers(0, 5, 40)
    triples = list(zip(components.weights, components.means, components.covariances, strict=True))
    p = np.stack([P * multivariate_t(v, F, df=NU).pdf(Z) for P, v, F in triples], axis=1)
    h = p / p.sum(axis=1, keepdims=True)
    usual, of_diagonal = score_variances(2, NU)
    ratios = []
    for i, (_, v, F) in enumerate(triples):
        y = np.linalg.solve(np.linalg.cholesky(F), (Z - v).T).T
        w = tail_weights((y**2).sum(axis=1), 2, NU)
        scores = [w * y[:, 0] / np.sqrt(usual), w * y[:, 1] / np.sqrt(usual), w * y[:, 0] * y[:, 1] / np.sqrt(usual)]
        scores += [(w * y[:, a] ** 2 - 1.0) / np.sqrt(2.0 * of_diagonal) for a in range(2)]
        total = sum(np.sum((h[groups == g, i] @ score[groups == g]) ** 2) for g in range(5) for score in scores)
        ratios.append(total / h[:, i].sum())
    assert design_effect(Z, components, groups) == pytest.approx(5 / 4 * np.mean(ratios) / 5)


@pytest.mark.parametrize("seed", [100, 101])
def test_outliers_are_no_state(seed):
    X, y = with_outliers(seed)
    normal = CompetitiveAgglomeration(random_state=seed).fit(X)
    heavy = CompetitiveAgglomeration(tails="heavy", random_state=seed).fit(X)
    assert (normal.n_clusters_, heavy.n_clusters_) == (7, 6)
    known = y >= 0
    assert adjusted_rand_score(y[known], heavy.labels_[known]) > 0.95


def test_clusters_without_outliers_are_found_too():
    X, y = ellipses(0)
    dut = CompetitiveAgglomeration(tails="heavy", random_state=0).fit(X)
    assert dut.n_clusters_ == 6
    assert adjusted_rand_score(y, dut.labels_) > 0.95


@pytest.fixture(scope="module")
def heavy():
    X, _ = ellipses(0)
    return CompetitiveAgglomeration(tails="heavy", n_init=1, random_state=0).fit(X), X


def test_states_keep_their_tails_in_a_file(heavy):
    dut, X = heavy
    restored = CompetitiveAgglomeration.from_arrays(dut.to_arrays())
    assert restored.degrees_of_freedom_ == dut.degrees_of_freedom_ == NU
    assert restored.get_params()["tails"] == "heavy"
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
    causal = ContactStateFilter(dut, gate=0.999)
    steps = [causal.step(causal.initial_log_belief(), x) for x in X[:50]]
    np.testing.assert_allclose([step.probabilities for step in steps], dut.predict_proba(X[:50]), atol=1e-12)
    edge = dut.means_[0] + np.sqrt(distance_gate(0.999, 2, NU)) * np.linalg.cholesky(dut.covariances_[0])[:, 0]
    inside, outside = (dut.means_[0] + f * (edge - dut.means_[0]) for f in (0.999, 1.001))
    assert dut.mahalanobis([outside])[0, 0] > causal.threshold > dut.mahalanobis([inside])[0, 0]
    lonely = CompetitiveAgglomeration()
    lonely._set_states(GaussianComponents(np.ones(1), dut.means_[:1], dut.covariances_[:1], NU))
    lonely.n_features_in_ = 2
    np.testing.assert_array_equal(lonely.predict([inside, outside], gate=0.999), [0, UNKNOWN])


def test_mergers_and_prototypes():
    components = replace(random_components(9, M=3, d=2), degrees=NU)
    assert merged_pair(components, np.array([0]), np.array([1])).degrees == NU
    assert merge_closest(components).degrees == NU
    X, _ = ellipses(0)
    with pytest.warns(ConvergenceWarning):
        dut = CompetitiveAgglomeration("gk", tails="heavy", merge=None, max_iter=20, n_init=1, random_state=0).fit(X)
    assert np.isinf(dut.degrees_of_freedom_)


def test_marginals_keep_the_tails():
    dut = CompetitiveAgglomeration()
    dut._set_states(GaussianComponents(np.ones(1), np.zeros((1, 2)), np.diag([1.0, 4.0])[None], NU))
    dut.n_features_in_ = 2
    x = np.array([[3.0]])
    assert dut.score_samples(x, channels=[1])[0] == pytest.approx(multivariate_t([0.0], [[4.0]], df=NU).logpdf(3.0))
