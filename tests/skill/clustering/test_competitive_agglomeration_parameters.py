"""How the parameters of Competitive Agglomeration reach the competition, and what is selected of its results."""

import warnings

import numpy as np
import pytest
from sklearn.exceptions import ConvergenceWarning
from sklearn.metrics import adjusted_rand_score

from benchmarks.learners.cluster_sets import demonstrations_and_phase, ellipses, insertion, separated, spheres
from skill.clustering import competitive_agglomeration
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from tests.skill.clustering.components import densities


@pytest.fixture
def calls(monkeypatch):
    """Arguments of each competition: positional (Z, components, prior, schedule) and keywords."""
    recorded = []

    def spy(name):
        original = getattr(competitive_agglomeration, name)

        def recording(*arguments, **keywords):
            recorded.append((arguments, keywords))
            return original(*arguments, **keywords)

        monkeypatch.setattr(competitive_agglomeration, name, recording)

    spy("compete")
    spy("compete_for_prototypes")
    return recorded


def fit_quietly(X, groups=None, phase=None, **parameters):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return CompetitiveAgglomeration(**{"random_state": 0, **parameters}).fit(X, groups=groups, phase=phase)


def test_defaults_of_the_competition(calls):
    X, _ = spheres(0)  # 575 samples, 2 channels
    fit_quietly(X)
    assert len(calls) == 5
    (Z, components, prior, schedule), keywords = calls[0]
    np.testing.assert_allclose(Z, (X - X.mean(axis=0)) / X.std(axis=0))
    assert len(components) == 30
    assert (prior.count, prior.variance, prior.diagonal) == (3.0, pytest.approx(1.0), False)
    np.testing.assert_allclose(prior.floor, 1e-6)
    assert [schedule(k) for k in (0, 10)] == pytest.approx([1.0, np.exp(-1.0)])
    assert keywords == {"min_cardinality": 5.0, "max_iter": 100, "tol": pytest.approx(1e-3), "min_eta": 0.05}


def test_minimum_cardinality_grows_with_the_number_of_parameters(calls):
    X, _ = separated(0, N=300, d=4)
    fit_quietly(X, n_init=1)
    fit_quietly(X, n_init=1, covariance_type="diag")
    fit_quietly(X, n_init=1, min_cardinality=11.0)
    assert [keywords["min_cardinality"] for _, keywords in calls] == [7.0, 5.0, 11.0]
    assert [len(arguments[1]) for arguments, _ in calls] == [30, 30, 30]
    assert [arguments[2].diagonal for arguments, _ in calls] == [False, True, False]


def test_few_samples_have_few_initial_clusters(calls):
    rng = np.random.default_rng(0)
    fit_quietly(rng.normal(size=(59, 4)), n_init=1)
    fit_quietly(rng.normal(size=(9, 4)), n_init=1)
    assert [len(arguments[1]) for arguments, _ in calls] == [5, 1]  # N // (2 (d + 1)), at least 1


def test_competition_without_merging_has_no_minimum_strength(calls):
    X, _ = spheres(0)
    fit_quietly(X, n_init=1, merge=None, tol=0.01, max_iter=7, shrinkage=4.0, reg_covar=0.25)
    (_, _, prior, _), keywords = calls[0]
    assert keywords == {"min_cardinality": 5.0, "max_iter": 7, "tol": pytest.approx(0.01), "min_eta": 0.0}
    assert prior.count == 4.0
    np.testing.assert_allclose(prior.floor, 0.25)


def test_tolerance_and_floor_are_relative_to_the_spread(calls):
    X = spheres(0)[0]
    X = (X - X.mean(axis=0)) / X.std(axis=0) * [1.0, 7.0]
    fit_quietly(X, n_init=1, standardize=False)
    (Z, _, prior, _), keywords = calls[0]
    np.testing.assert_allclose(Z, X, atol=1e-12)
    assert prior.variance == pytest.approx(25.0)  # the mean of 1 and 49
    assert keywords["tol"] == pytest.approx(5e-3)
    np.testing.assert_allclose(prior.floor, 25e-6)


def test_samples_are_centred_for_gaussian_clusters_only(calls):
    X, _ = spheres(0)
    fit_quietly(X, n_init=1, standardize=False)
    fit_quietly(X, distance="euclid", n_init=1, standardize=False, max_iter=1)
    np.testing.assert_allclose(calls[0][0][0], X - X.mean(axis=0))
    np.testing.assert_array_equal(calls[1][0][0], X)


def test_constant_samples_have_a_unit_prior(calls):
    fit_quietly(np.full((20, 2), 2.5), n_init=1)
    assert calls[0][0][2].variance == 1.0


def test_sensor_variance_is_part_of_the_floor(calls):
    X, _ = spheres(0)
    fit_quietly(X, n_init=1, sensor_variance=[4.0, 9.0])
    np.testing.assert_allclose(calls[0][0][2].floor, 1e-6 + np.array([4.0, 9.0]) / X.var(axis=0))


@pytest.mark.parametrize("parameters", [{"distance": "gk"}, {"distance": "euclid"}, {"bias": "literal"}])
def test_defaults_of_the_published_competition(calls, parameters):
    X, _ = separated(0, N=300, d=4)
    dut = fit_quietly(X, n_init=1, max_iter=20, merge=None, **parameters)
    (_, components, _, schedule), keywords = calls[0]
    assert len(components) == 30
    assert [schedule(k) for k in (0, 3, 13)] == pytest.approx([5.0, 5.0, 5.0 / np.e])
    distance = parameters.get("distance", "fmle")
    expected = {"death_rule": "cardinality", "min_count": 5.0, "max_iter": 20, "tol": 1e-3}
    assert keywords == {"distance": distance, **expected}
    assert dut.distance_ == distance


def test_ramp_has_the_death_rule_of_the_authors_program(calls):
    X, _ = spheres(0)
    fit_quietly(X, distance="euclid", schedule="ramp", n_init=1, merge=None, eta0=2.0, tau=5.0, min_cardinality=3)
    fit_quietly(X, schedule="ramp", n_init=1, merge=None, rise=2, decay=4)
    (_, _, _, schedule), keywords = calls[0]
    assert (keywords["death_rule"], keywords["min_count"]) == ("nearest", 3)
    assert [schedule(k) for k in (0, 10, 30, 35)] == pytest.approx([2.0 * np.exp(-2.0), 2.0, 2.0, 2.0 / np.e])
    assert [calls[1][0][3](k) for k in (0, 2, 4, 14)] == pytest.approx([np.exp(-0.2), 1.0, 1.0, np.exp(-1.0)])


def test_starts_by_phase(calls):
    X, y = insertion(0, 1500)
    groups, phase = demonstrations_and_phase(y)
    fit_quietly(X, groups, phase)
    assert [len(arguments[1]) for arguments, _ in calls] == [30, 21, 15, 11, 8]
    assert calls[0][0][3](0) == 5.0
    np.testing.assert_allclose(calls[4][0][1].weights, np.bincount((8 * phase).astype(int)) / len(X))
    calls.clear()
    fit_quietly(X, groups, phase, m_init=3, merge=None)
    assert [len(arguments[1]) for arguments, _ in calls] == [3, 2, 1]  # starts of equal numbers run once
    calls.clear()
    fit_quietly(X, groups, phase, init="phase", n_init=1, merge=None)
    fit_quietly(X, groups, phase, init="k-means++", n_init=1, merge=None)
    slices = np.bincount((30 * phase).astype(int)) / len(X)
    np.testing.assert_allclose(calls[0][0][1].weights, slices)
    assert not np.array_equal(calls[1][0][1].weights, slices)


def test_given_centres_are_in_the_units_of_the_samples(calls):
    X, _ = spheres(0)
    fit_quietly(X, init=X[:4])
    fit_quietly(X, init=X[:1])
    assert len(calls) == 2
    np.testing.assert_allclose(calls[0][0][1].means, ((X - X.mean(axis=0)) / X.std(axis=0))[:4])
    assert len(calls[1][0][1]) == 1


def test_large_sets_are_searched_by_a_part(calls, monkeypatch):
    monkeypatch.setattr(competitive_agglomeration, "MAX_SEARCHED", 500)
    X, y = spheres(0)
    dut = fit_quietly(X, n_init=2)
    assert [len(arguments[0]) for arguments, _ in calls] == [500, 500]
    assert dut.n_clusters_ == 4
    assert adjusted_rand_score(y, dut.labels_) > 0.98
    # All samples polish the candidates and count in the criterion.
    best = dut.merge_path_[np.argmin(dut.merge_path_[:, 2])]
    assert best[1] == pytest.approx(dut.score(X) * len(X) + len(X) * np.log(X.std(axis=0)).sum(), rel=1e-3)
    assert best[2] == pytest.approx(-2.0 * best[1] + 23 * np.log(len(X)))
    assert dut.weights_.sum() == pytest.approx(1.0)
    calls.clear()
    fit_quietly(X, n_init=1, merge=None)
    fit_quietly(X, groups=np.arange(len(X)) % 9, n_init=1)
    fit_quietly(X[:500], n_init=1)
    assert [len(arguments[0]) for arguments, _ in calls] == [575, 575, 500]


def test_two_samples_are_enough():
    assert fit_quietly(np.array([[0.0], [1.0]])).n_clusters_ == 1
    with pytest.raises(ValueError, match="minimum of 2 is required"):
        fit_quietly(np.array([[0.0]]))


def test_warnings_name_the_line_that_calls_fit():
    X, _ = spheres(0)
    dut = CompetitiveAgglomeration(bias="literal", merge=None, n_init=1, max_iter=1, random_state=0)
    with pytest.warns() as record:
        dut.fit(X, groups=np.zeros(len(X)))
    assert len(record) == 3  # one demonstration, literal bias, not converged
    assert {warning.filename for warning in record} == {__file__}
    assert any("raise max_iter or tol" in str(warning.message) for warning in record)


@pytest.mark.parametrize("stage", ["compete", "expectation_maximization"])
def test_fit_converges_if_competition_and_em_converge(monkeypatch, stage):
    X, _ = spheres(0)
    assert fit_quietly(X, n_init=1).converged_
    original = getattr(competitive_agglomeration, stage)
    monkeypatch.setattr(
        competitive_agglomeration, stage, lambda *args, **kwargs: (*original(*args, **kwargs)[:2], False)
    )
    with pytest.warns(ConvergenceWarning, match="not converged after max_iter=100 iterations"):
        assert not CompetitiveAgglomeration(n_init=1, random_state=0).fit(X).converged_


def test_start_of_minimum_criterion_is_selected_without_merging(monkeypatch):
    X, _ = ellipses(0)
    Z = (X - X.mean(axis=0)) / X.std(axis=0)
    original = competitive_agglomeration.compete
    results = []

    def recording(*arguments, **keywords):
        results.append(original(*arguments, **keywords))
        return results[-1]

    monkeypatch.setattr(competitive_agglomeration, "compete", recording)
    dut = fit_quietly(X, merge=None, n_init=4, max_iter=30)
    log_likelihoods = [np.log(densities(Z, components).sum(axis=1)).sum() for components, _, _ in results]
    numbers = np.array([len(components) for components, _, _ in results])
    criteria = -2.0 * np.array(log_likelihoods) + (6 * numbers - 1) * np.log(len(X))
    best = int(np.argmin(criteria))
    assert np.ptp(criteria) > 1.0
    assert dut.n_clusters_ == numbers[best]
    np.testing.assert_allclose(dut.merge_path_, [[numbers[best], log_likelihoods[best], criteria[best]]])
    np.testing.assert_array_equal(dut.history_["log_likelihood"], results[best][1].log_likelihood)
    assert dut.design_effect_ == 1.0
    assert dut.n_effective_ == len(X)


def test_effective_number_of_samples():
    X, y = insertion(0, 600)
    groups, phase = demonstrations_and_phase(y)
    for merge in ("bic", None):
        dut = fit_quietly(X, groups, phase, n_init=1, merge=merge)
        assert dut.design_effect_ > 1.1
        assert dut.n_effective_ == pytest.approx(len(X) / dut.design_effect_)
        tau, row = dut.design_effect_, dut.merge_path_[dut.merge_path_[:, 0] == dut.n_clusters_][0]
        expected = -2.0 * row[1] / tau + (120 * row[0] - 1) * np.log(len(X) / tau)
        assert row[2] == pytest.approx(expected)


@pytest.mark.parametrize("parameters", [{}, {"distance": "euclid"}, {"distance": "euclid", "bias": "literal"}])
def test_only_the_literal_fmle_competition_warns(parameters):
    X, _ = spheres(0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        CompetitiveAgglomeration(n_init=1, random_state=0, **parameters).fit(X)
