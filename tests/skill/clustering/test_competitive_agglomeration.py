import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn.metrics import adjusted_rand_score
from sklearn.utils.estimator_checks import parametrize_with_checks

from benchmarks.learners.cluster_sets import (
    demonstrations_and_phase,
    ellipses,
    insertion,
    iris,
    overlapping,
    separated,
    spheres,
)
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration

GOLDEN = Path(__file__).parents[2] / "data" / "golden_ca.npz"


@pytest.mark.slow
@parametrize_with_checks(
    [
        CompetitiveAgglomeration(random_state=0),
        CompetitiveAgglomeration("gk", merge=None, n_init=1, random_state=0),
        CompetitiveAgglomeration("euclid", merge=None, n_init=1, random_state=0),
        CompetitiveAgglomeration(covariance_type="diag", schedule="ramp", n_init=1, random_state=0),
    ]
)
def test_scikit_learn_conventions(estimator, check):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        check(estimator)


# --- known answers ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", ["A", "B", "C"])
def test_euclidean_competition_agrees_with_the_program_of_its_authors(case):
    with np.load(GOLDEN) as golden:
        X, centres = golden[f"X_{case}"], golden[f"C0_{case}"]
        eta0, tau, rise, decay, max_iter, tol, _ = golden[f"params_{case}"]
        expected_centres, expected_sizes = golden[f"centers_{case}"], golden[f"sizes_{case}"]
    dut = CompetitiveAgglomeration(
        "euclid",
        schedule="ramp",
        eta0=eta0,
        tau=tau,
        rise=int(rise),
        decay=int(decay),
        max_iter=int(max_iter),
        tol=tol,
        merge=None,
        init=centres,
        standardize=False,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        dut.fit(X)
    assert dut.n_clusters_ == len(expected_centres)
    nearest = np.argmin(np.linalg.norm(dut.means_[:, None] - expected_centres, axis=2), axis=0)
    np.testing.assert_allclose(dut.means_[nearest], expected_centres, atol=1e-6)
    np.testing.assert_array_equal(np.bincount(dut.labels_)[nearest], expected_sizes)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("generate", "number", "min_ari"),
    [
        (spheres, 4, 0.98),
        (ellipses, 6, 0.96),
        (overlapping, 4, 0.66),
        (lambda seed: separated(seed, c=2.0), 6, 0.99),
        (lambda seed: separated(seed, c=1.0), 6, 0.97),
        (iris, 2, 0.567),
    ],
    ids=["spheres", "ellipses", "overlapping", "c=2", "c=1", "iris"],
)
@pytest.mark.parametrize("seed", [100, 101])
def test_finds_the_number_of_gaussian_clusters(generate, number, min_ari, seed):
    X, y = generate(seed)
    dut = CompetitiveAgglomeration(random_state=seed).fit(X)
    assert dut.n_clusters_ == number
    assert adjusted_rand_score(y, dut.labels_) >= min_ari


@pytest.mark.parametrize(
    ("distance", "generate", "number"), [("euclid", spheres, 4), ("gk", ellipses, 6)], ids=["euclid", "gk"]
)
def test_published_distances_on_the_published_figures(distance, generate, number):
    right = 0
    for seed in range(100, 105):
        X, y = generate(seed)
        dut = CompetitiveAgglomeration(distance, merge=None, n_init=1, random_state=seed).fit(X)
        right += dut.n_clusters_ == number and adjusted_rand_score(y, dut.labels_) > 0.94
    # The published competition depends on its start; it is kept for comparison.
    assert right >= 4


def test_printed_equations_collapse_and_warn():
    X, _ = ellipses(0)
    dut = CompetitiveAgglomeration(bias="literal", merge=None, n_init=1, random_state=0)
    with pytest.warns(UserWarning, match="use bias='posterior'"):
        dut.fit(X)
    assert dut.n_clusters_ <= 2


# --- demonstrations: the number of states does not grow with the sampling rate ------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("N", [3_000, 10_000, 30_000])
def test_number_of_contact_states_does_not_grow_with_the_sampling_rate(N):
    X, y = insertion(200, N)
    groups, phase = demonstrations_and_phase(y)
    dut = CompetitiveAgglomeration(random_state=0).fit(X, groups=groups, phase=phase)
    assert dut.n_clusters_ == 6
    assert adjusted_rand_score(y, dut.labels_) >= 0.95
    # About 25 independent samples a demonstration, at 100 as at 1,000 samples each.
    assert 400 < dut.n_effective_ < 1200


def test_demonstrations_of_one_sample_are_independent():
    X, _ = separated(1, N=600, d=3)
    alone = CompetitiveAgglomeration(n_init=1, random_state=0).fit(X)
    grouped = CompetitiveAgglomeration(n_init=1, random_state=0).fit(X, groups=np.arange(600))
    assert grouped.n_clusters_ == alone.n_clusters_
    assert grouped.design_effect_ < 1.2


def test_repeated_samples_change_nothing_if_groups_are_given():
    X, y = insertion(3, 1500)
    groups, phase = demonstrations_and_phase(y)
    once = CompetitiveAgglomeration(n_init=1).fit(X, groups=groups, phase=phase)
    X3, groups3, phase3 = (np.repeat(a, 3, axis=0) for a in (X, groups, phase))
    thrice = CompetitiveAgglomeration(n_init=1).fit(X3, groups=groups3, phase=phase3)
    assert thrice.n_clusters_ == once.n_clusters_
    assert thrice.design_effect_ == pytest.approx(3 * once.design_effect_, rel=0.1)


def test_single_demonstration_warns():
    X, _ = separated(0, N=300, d=3)
    with pytest.warns(UserWarning, match="use two or more demonstrations"):
        CompetitiveAgglomeration(n_init=1, random_state=0).fit(X, groups=np.zeros(300))


# --- the course of the competition --------------------------------------------------------------------------


def test_history_contains_number_strength_and_likelihood():
    X, _ = spheres(0)
    dut = CompetitiveAgglomeration(n_init=1, tau=5.0, eta0=2.0, random_state=0).fit(X)
    history = dut.history_
    assert set(history) == {"n_clusters", "eta", "log_likelihood"}
    assert {len(a) for a in history.values()} == {dut.n_iter_}
    np.testing.assert_allclose(history["eta"], 2.0 * np.exp(-np.arange(dut.n_iter_) / 5.0))
    assert (np.diff(history["n_clusters"]) <= 0).all()
    assert np.isfinite(history["log_likelihood"]).all()
    assert dut.merge_path_[-1, 0] == 1
    assert dut.n_clusters_ == dut.merge_path_[np.argmin(dut.merge_path_[:, 2]), 0]


def test_labels_as_initial_partition():
    X, y = separated(0, N=800, d=4)
    dut = CompetitiveAgglomeration(init=y).fit(X)
    assert dut.history_["n_clusters"][0] == 6
    assert adjusted_rand_score(y, dut.labels_) > 0.95


def test_sensor_variance_is_in_squared_units_of_the_channel():
    X, _ = spheres(0)
    noise = np.array([4.0, 0.0])
    plain = CompetitiveAgglomeration(m_init=1, n_init=1, shrinkage=0.0, reg_covar=0.0).fit(X)
    noisy = CompetitiveAgglomeration(m_init=1, n_init=1, shrinkage=0.0, reg_covar=0.0, sensor_variance=noise).fit(X)
    np.testing.assert_allclose(noisy.covariances_[0] - plain.covariances_[0], np.diag(noise), atol=1e-9)
    np.testing.assert_allclose(plain.covariances_[0], np.cov(X.T, bias=True), rtol=1e-9)


def test_diagonal_covariances_are_diagonal():
    X, _ = separated(0, N=600, d=4)
    dut = CompetitiveAgglomeration(covariance_type="diag", n_init=1, random_state=0).fit(X)
    assert not (dut.covariances_ * (1 - np.eye(4))).any()


@pytest.mark.filterwarnings("error")
def test_a_table_with_named_columns_is_fitted_and_predicted_without_a_warning():
    X, _ = separated(0, N=300)
    frame = pd.DataFrame(X, columns=[f"channel {k}" for k in range(X.shape[1])])
    dut = CompetitiveAgglomeration(random_state=0, n_init=1).fit(frame)
    assert list(dut.feature_names_in_) == list(frame.columns)
    np.testing.assert_array_equal(dut.labels_, dut.predict(frame))
    np.testing.assert_array_equal(dut.labels_, CompetitiveAgglomeration(random_state=0, n_init=1).fit(X).labels_)
    with pytest.raises(ValueError, match="feature names"):
        dut.predict(frame[frame.columns[::-1]])
