import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.exceptions import ConvergenceWarning
from sklearn.metrics import adjusted_rand_score
from sklearn.utils.estimator_checks import parametrize_with_checks
from threadpoolctl import threadpool_limits

from skill.clustering import competitive_agglomeration
from skill.clustering.competitive_agglomeration import (
    CompetitiveAgglomeration,
    checked_groups,
    checked_phase,
    nearest_centre,
    phase_slices,
    survivors,
)
from skill.clustering.expectation_maximization import CovariancePrior, components_of_partition
from tests.skill.clustering.components import densities, no_prior, spherical, weighted_moments
from tests.skill.clustering.labelled_sets import (
    demonstrations_and_phase,
    ellipses,
    insertion,
    separated,
    spheres,
    with_outliers,
)

GOLDEN = Path(__file__).parents[2] / "data" / "golden_ca.npz"
SYMMETRIC = np.array([[-1.0], [1.0]])


def fit(X, groups=None, phase=None, **parameters):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return CompetitiveAgglomeration(**{"n_init": 1, "random_state": 0, **parameters}).fit(
            X, groups=groups, phase=phase
        )


@pytest.mark.slow
@parametrize_with_checks([CompetitiveAgglomeration(n_init=1, random_state=0)])
def test_scikit_learn_conventions(estimator, check):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        check(estimator)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("generate", "min_ari"), [(ellipses, 0.96), (lambda seed: separated(seed, c=1.0), 0.97)], ids=["ellipses", "c=1"]
)
def test_finds_the_number_of_gaussian_clusters(generate, min_ari):
    X, y = generate(100)
    dut = CompetitiveAgglomeration(random_state=100).fit(X)
    assert dut.n_clusters_ == 6
    assert adjusted_rand_score(y, dut.labels_) >= min_ari
    np.testing.assert_array_equal(dut.labels_, dut.predict(X))


@pytest.mark.slow
@pytest.mark.parametrize("N", [3_000, 10_000])
def test_number_of_contact_states_does_not_grow_with_the_sampling_rate(N):
    X, y = insertion(200, N)
    groups, phase = demonstrations_and_phase(y)
    dut = CompetitiveAgglomeration(random_state=0).fit(X, groups=groups, phase=phase)
    assert dut.n_clusters_ == 6
    assert adjusted_rand_score(y, dut.labels_) >= 0.95
    # About 25 independent samples a demonstration, at 100 as at 1,000 samples each.
    assert 400 < dut.n_effective_ < 1200


def test_outliers_are_no_state():
    seed = 100
    X, y = with_outliers(seed)
    normal = CompetitiveAgglomeration(random_state=seed).fit(X)
    heavy = CompetitiveAgglomeration(tails="heavy", random_state=seed).fit(X)
    assert (normal.n_clusters_, heavy.n_clusters_) == (7, 6)
    known = y >= 0
    assert adjusted_rand_score(y[known], heavy.labels_[known]) > 0.95


# --- starts, competition and selection ---------------------------------------------------------------------


@pytest.fixture
def starts(monkeypatch):
    """Arguments of each start: samples, components, prior and the initial strength of the competition."""
    recorded = []
    original = CompetitiveAgglomeration._run_start

    def recording(self, *arguments):
        recorded.append(arguments)
        return original(self, *arguments)

    monkeypatch.setattr(CompetitiveAgglomeration, "_run_start", recording)
    return recorded


def test_defaults_of_the_starts(starts):
    X, _ = spheres(0)  # 575 samples, 2 channels
    fit(X, n_init=5)
    assert len(starts) == 5
    Z, components, prior, eta0 = starts[0]
    np.testing.assert_allclose(Z, (X - X.mean(axis=0)) / X.std(axis=0))
    assert (len(components), eta0) == (30, 1.0)
    assert (prior.count, prior.variance) == (3.0, pytest.approx(1.0))
    np.testing.assert_allclose(prior.floor, 1e-6)


def test_few_samples_have_few_initial_clusters(starts):
    rng = np.random.default_rng(0)
    fit(rng.normal(size=(59, 4)))
    fit(rng.normal(size=(9, 4)))
    assert [len(arguments[1]) for arguments in starts] == [5, 1]  # N // (2 (d + 1)), at least 1


def test_constant_samples_have_a_unit_prior(starts):
    fit(np.full((20, 2), 2.5))
    assert starts[0][2].variance == 1.0


def test_starts_by_phase(starts):
    X, y = insertion(0, 1500)
    groups, phase = demonstrations_and_phase(y)
    fit(X, groups, phase, n_init=5)
    assert [len(arguments[1]) for arguments in starts] == [30, 21, 15, 11, 8]
    assert starts[0][3] == 5.0
    np.testing.assert_allclose(starts[4][1].weights, np.bincount((8 * phase).astype(int)) / len(X))
    starts.clear()
    fit(X, groups, phase, n_init=5, m_init=3)
    assert [len(arguments[1]) for arguments in starts] == [3, 2, 1]  # starts of equal numbers run once


def test_large_sets_are_searched_by_a_part(starts, monkeypatch):
    monkeypatch.setattr(competitive_agglomeration, "MAX_SEARCHED", 500)
    X, y = spheres(0)
    dut = fit(X, n_init=2)
    assert [len(arguments[0]) for arguments in starts] == [500, 500]
    assert dut.n_clusters_ == 4
    assert adjusted_rand_score(y, dut.labels_) > 0.98
    # All samples polish the candidates and count in the criterion.
    best = dut.merge_path_[np.argmin(dut.merge_path_[:, 2])]
    assert best[1] == pytest.approx(dut.score_samples(X).sum() + len(X) * np.log(X.std(axis=0)).sum(), rel=1e-3)
    assert best[2] == pytest.approx(-2.0 * best[1] + 23 * np.log(len(X)))
    starts.clear()
    fit(X, groups=np.arange(len(X)) % 9)
    fit(X[:500])
    assert [len(arguments[0]) for arguments in starts] == [575, 500]


def reference_competition(Z, components, prior, eta0, min_cardinality, iterations):
    """The equations of the competition without blocks and features; one death in an iteration at most."""
    weights, means, covariances = components.weights, components.means, components.covariances
    N_i = weights * len(Z)
    numbers, log_likelihoods = [], []
    for k in range(iterations):
        p = densities(Z, type(components)(weights, means, covariances))
        h = p / p.sum(axis=1, keepdims=True)
        numbers.append(len(weights))
        log_likelihoods.append(np.log(p.sum(axis=1)).sum())
        eta = eta0 * np.exp(-k / 10.0)
        u = h * (1.0 + eta * len(Z) / np.sum(N_i**2) * (N_i - h @ N_i[:, None]))
        u = np.clip(u, 0.0, 1.0)
        u /= u.sum(axis=1, keepdims=True)
        N_i = u.sum(axis=0)
        means, covariances = weighted_moments(Z, u**2)
        covariances = prior.apply(covariances, (u**2).sum(axis=0))
        weights = N_i / N_i.sum()
        if N_i.min() < min_cardinality:
            keep = np.arange(len(N_i)) != np.argmin(N_i)
            N_i, means, covariances = N_i[keep], means[keep], covariances[keep]
            weights = weights[keep] / weights[keep].sum()
    return weights, means, covariances, numbers, log_likelihoods


def test_competition_against_its_equations():
    X, _ = spheres(0)
    Z = (X - X.mean(0)) / X.std(0)
    prior = CovariancePrior(count=3.0, variance=1.0, floor=np.full(2, 1e-6))
    start = components_of_partition(Z, np.random.default_rng(0).integers(0, 12, len(Z)), prior)
    found, history, converged = CompetitiveAgglomeration(tol=0.0, max_iter=25)._compete(Z, start, prior, 1.0)
    weights, means, covariances, numbers, log_likelihoods = reference_competition(Z, start, prior, 1.0, 5.0, 25)
    assert history.n_clusters == numbers
    assert numbers[0] == 12
    assert numbers[-1] < 12 - 1  # several clusters died
    np.testing.assert_allclose(history.eta, [1.0 * np.exp(-k / 10.0) for k in range(25)])
    np.testing.assert_allclose(history.log_likelihood, log_likelihoods, rtol=1e-9)
    np.testing.assert_allclose(found.weights, weights, rtol=1e-6)
    np.testing.assert_allclose(found.means, means, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(found.covariances, covariances, rtol=1e-6, atol=1e-8)
    assert not converged


@pytest.mark.parametrize(("centre", "iterations"), [(0.0, 3), (1.0, 4)])
def test_competition_converges_after_three_still_iterations(centre, iterations):
    # From 1, the first iteration moves the centre to 0, the next three do not.
    dut = CompetitiveAgglomeration(max_iter=10, tol=0.5)
    found, history, converged = dut._compete(SYMMETRIC, spherical([1.0], [[centre]]), no_prior(1), 1.0)
    assert converged
    assert len(history.eta) == iterations
    np.testing.assert_allclose(found.covariances, [[[1.0]]])


def test_death_restarts_the_count_of_still_iterations():
    Z = np.tile(SYMMETRIC, (4, 1))
    start = spherical([0.5, 0.5], [[0.0], [0.0]])
    # Two equal components share every sample: neither moves, but one of them is too small and dies at once.
    found, history, converged = CompetitiveAgglomeration(max_iter=10)._compete(Z, start, no_prior(1), 0.0)
    assert converged
    assert history.n_clusters == [2, 1, 1, 1]
    np.testing.assert_allclose(found.weights, [1.0])


def test_competition_ends_when_it_becomes_negligible():
    dut = CompetitiveAgglomeration(max_iter=40, tol=0.0)
    _, history, converged = dut._compete(SYMMETRIC, spherical([1.0], [[0.0]]), no_prior(1), 1.0)
    assert converged
    assert history.eta[-1] * np.exp(-0.1) < 0.05 <= history.eta[-1]
    # A competition that is negligible from the start does not end for that reason.
    _, history, converged = dut._compete(SYMMETRIC, spherical([1.0], [[0.0]]), no_prior(1), 0.01)
    assert not converged


@pytest.mark.parametrize("stage", ["_compete", "expectation_maximization"])
def test_fit_converges_if_competition_and_em_converge(monkeypatch, stage):
    X, _ = spheres(0)
    assert fit(X).converged_
    owner = CompetitiveAgglomeration if stage == "_compete" else competitive_agglomeration
    original = getattr(owner, stage)
    monkeypatch.setattr(owner, stage, lambda *args, **kwargs: (*original(*args, **kwargs)[:2], False))
    with pytest.warns(ConvergenceWarning, match="not converged after max_iter=100 iterations") as record:
        assert not CompetitiveAgglomeration(n_init=1, random_state=0).fit(X).converged_
    assert {warning.filename for warning in record} == {__file__}  # the line that calls fit


def test_effective_number_of_samples():
    X, y = insertion(0, 600)
    groups, phase = demonstrations_and_phase(y)
    dut = fit(X, groups, phase)
    assert dut.design_effect_ > 1.1
    assert dut.n_effective_ == pytest.approx(len(X) / dut.design_effect_)
    tau, row = dut.design_effect_, dut.merge_path_[dut.merge_path_[:, 0] == dut.n_clusters_][0]
    expected = -2.0 * row[1] / tau + (120 * row[0] - 1) * np.log(len(X) / tau)
    assert row[2] == pytest.approx(expected)


def test_at_most_a_tenth_of_the_clusters_dies_in_an_iteration():
    keep = survivors(np.arange(20.0), 15.0)
    np.testing.assert_array_equal(np.flatnonzero(~keep), [0, 1])
    np.testing.assert_array_equal(survivors(np.array([3.0, 1.0, 2.0]), 5.0), [True, False, True])
    np.testing.assert_array_equal(np.flatnonzero(~survivors(np.arange(29.0), 15.0)), [0, 1])
    # The last cluster survives, and one of the minimum cardinality.
    assert survivors(np.array([1.0]), 10.0).all()
    np.testing.assert_array_equal(survivors(np.array([5.0, 7.0]), 5.0), [True, True])
    np.testing.assert_array_equal(survivors(np.array([4.999, 7.0]), 5.0), [False, True])


def test_nearest_centre():
    rng = np.random.default_rng(1)
    Z, centres = rng.normal(size=(10_000, 3)), rng.normal(size=(6, 3))
    expected = np.argmin(np.linalg.norm(Z[:, None] - centres, axis=2), axis=1)
    np.testing.assert_array_equal(nearest_centre(Z, centres), expected)


def test_phase_slices():
    slices = phase_slices(np.array([0.0, 0.24, 0.25, 0.99, 1.0]), 4)
    np.testing.assert_array_equal(slices, [0, 0, 1, 3, 3])


def test_units_and_order_of_samples_and_channels_do_not_matter():
    X, y = insertion(0, 900)
    groups, phase = demonstrations_and_phase(y)
    plain = fit(X, groups, phase)
    rng = np.random.default_rng(1)
    scale, shift = np.exp(rng.uniform(-8, 8, 14)), rng.normal(size=14) * 10
    rows, channels = rng.permutation(len(X)), rng.permutation(14)
    other = fit(((X + shift) * scale)[rows][:, channels], groups[rows], phase[rows])
    assert other.n_clusters_ == plain.n_clusters_
    assert adjusted_rand_score(plain.labels_[rows], other.labels_) > 0.999
    expected = ((plain.means_ + shift) * scale)[:, channels]
    np.testing.assert_allclose(other.means_, expected, rtol=1e-4, atol=1e-4 * scale.max())


def test_same_seed_and_any_number_of_threads_give_the_same_bits():
    X, _ = separated(0, N=1200)
    with threadpool_limits(1):
        one = CompetitiveAgglomeration(n_init=1, random_state=3).fit(X)
    with threadpool_limits(2):
        two = CompetitiveAgglomeration(n_init=1, random_state=3).fit(X)
    np.testing.assert_array_equal(one.means_, two.means_)
    np.testing.assert_array_equal(one.covariances_, two.covariances_)


@given(N=st.integers(2, 40), d=st.integers(1, 6), seed=st.integers(0, 2**31))
def test_any_finite_data_gives_finite_states(N, d, seed):
    rng = np.random.default_rng(seed)
    X = np.round(rng.normal(size=(N, d)) * 2.0)  # many duplicates and ties
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        dut = CompetitiveAgglomeration(n_init=2, random_state=0).fit(X)
    assert 1 <= dut.n_clusters_ <= max(1, N // (2 * (d + 1)))
    assert np.isfinite(dut.covariances_).all()
    np.testing.assert_allclose(dut.predict_proba(X).sum(axis=1), 1.0)
    assert dut.weights_.sum() == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"m_init": 0}, r"'m_init' .* must be an int in the range \[1, inf\). Got 0"),
        ({"eta0": np.inf}, "'eta0' .* Got inf"),
    ],
)
def test_parameters_out_of_range_are_errors(parameters, message):
    with pytest.raises(ValueError, match=message):
        CompetitiveAgglomeration(**parameters).fit(spheres(0)[0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"groups": [0, 1]}, r"groups has shape \(2,\), expected \(575,\)"),
        ({"phase": [0.5]}, r"phase has shape \(1,\)"),
        ({"phase": np.linspace(0, 2, 575)}, "divide the time since the start"),
        ({"phase": np.linspace(-0.1, 1, 575)}, r"phase lies between -0.1 and 1, expected \[0, 1\]"),
        ({"phase": np.full(575, np.nan)}, r"expected \[0, 1\]"),
    ],
)
def test_wrong_groups_and_phases_are_errors(arguments, message):
    with pytest.raises(ValueError, match=message):
        CompetitiveAgglomeration().fit(spheres(0)[0], **arguments)


@pytest.mark.filterwarnings("error")
def test_checked_groups_are_indices_of_two_demonstrations_or_more():
    np.testing.assert_array_equal(checked_groups(["b", "a", "b"], 3), [1, 0, 1])
    assert checked_groups(None, 3) is None
    with pytest.warns(UserWarning, match="use two or more demonstrations"):
        assert checked_groups([4, 4, 4], 3) is None


def test_checked_phase_includes_both_ends():
    np.testing.assert_array_equal(checked_phase([0, 1], 2), [0.0, 1.0])
    assert checked_phase(None, 2) is None


def test_more_states_than_initial_clusters_are_told():
    X, _ = spheres(0)
    with pytest.warns(UserWarning, match="began with, m_init=3: raise m_init"):
        CompetitiveAgglomeration(m_init=3, random_state=0).fit(X)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert CompetitiveAgglomeration(m_init=12, random_state=0).fit(X).n_clusters_ == 4


def test_one_wild_sample_does_not_move_the_states():
    X, _ = spheres(0)
    spiked = np.vstack([X, [[-1e6, 1e6]]])
    labels = CompetitiveAgglomeration(random_state=0).fit(spiked).labels_[:-1]
    assert adjusted_rand_score(labels, CompetitiveAgglomeration(random_state=0).fit(X).labels_) > 0.98


def test_rounded_values_leave_the_variance_of_rounding():
    """Two states of one value each: their variances are those of rounding to the step between them, 1/12."""
    X = np.repeat([[0.0], [1.0]], 400, axis=0)
    dut = CompetitiveAgglomeration(random_state=0).fit(X)
    assert (dut.covariances_ >= 1.0 / 12.0).all()


@pytest.mark.parametrize(
    ("case", "sizes"), [("A", [100, 100, 100]), ("B", [58, 60, 60, 62]), ("C", [78, 79, 80, 80, 81, 82])]
)
def test_clusters_in_the_sets_of_the_published_program(case, sizes):
    """The program of the authors ends with 8, 3 and 17 spherical clusters."""
    with np.load(GOLDEN) as golden:
        X, published = golden[f"X_{case}"], golden[f"sizes_{case}"]
    assert sorted(np.bincount(CompetitiveAgglomeration(random_state=0).fit(X).labels_)) == sizes
    assert len(published) == {"A": 8, "B": 3, "C": 17}[case]
