import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from sklearn.metrics import adjusted_rand_score

from benchmarks.learners.published_competition import (
    PublishedCompetition,
    compete_for_prototypes,
    competitive_memberships,
    exponential_schedule,
    fuzzy_prototypes,
    log_squared_distances,
)
from skill.clustering.expectation_maximization import components_of_partition
from tests.skill.clustering.components import no_prior, random_components
from tests.skill.clustering.labelled_sets import ellipses, spheres

GOLDEN = Path(__file__).parents[2] / "data" / "golden_ca.npz"


@pytest.mark.parametrize("case", ["A", "B", "C"])
def test_euclidean_competition_agrees_with_the_program_of_its_authors(case):
    with np.load(GOLDEN) as golden:
        X, centres = golden[f"X_{case}"], golden[f"C0_{case}"]
        eta0, tau, rise, decay, max_iter, tol, _ = golden[f"params_{case}"]
        expected_centres, expected_sizes = golden[f"centers_{case}"], golden[f"sizes_{case}"]
    dut = PublishedCompetition(
        "euclid",
        ramp=(int(rise), int(decay)),
        eta0=eta0,
        tau=tau,
        max_iter=int(max_iter),
        tol=tol,
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


def test_the_euclidean_distance_on_the_published_figure():
    right = 0
    for seed in range(100, 105):
        X, y = spheres(seed)
        dut = PublishedCompetition("euclid", random_state=seed).fit(X)
        right += dut.n_clusters_ == 4 and adjusted_rand_score(y, dut.labels_) > 0.94
    # The published competition depends on its start; it is kept for comparison.
    assert right >= 4


def test_printed_equations_collapse():
    X, _ = ellipses(0)
    assert PublishedCompetition(random_state=0).fit(X).n_clusters_ <= 2


def test_membership_of_the_fmle_distance_is_the_posterior():
    components = random_components(3)
    Z = np.random.default_rng(0).normal(size=(20, 3))
    H = competitive_memberships(log_squared_distances(Z, components, "fmle"), None, 1.0)
    densities = np.stack(
        [
            P * multivariate_normal(v, F).pdf(Z)
            for P, v, F in zip(components.weights, components.means, components.covariances, strict=True)
        ],
        axis=1,
    )
    np.testing.assert_allclose(H, densities / densities.sum(axis=1, keepdims=True), atol=1e-12)


@pytest.mark.parametrize("literal", [False, True])
def test_prototypes_worked_by_hand(literal):
    Z = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0]])
    U = np.array([[0.5, 0.5], [0.75, 0.25], [0.2, 0.8]])
    found = fuzzy_prototypes(Z, U, no_prior(2), literal=literal)
    np.testing.assert_allclose(found.weights, [1.45 / 3, 1.55 / 3])
    w = U[:, 1] ** 2
    mean = w @ Z / (w.sum() + 1e-6)  # the authors' program avoids a division by zero
    np.testing.assert_allclose(found.means[1], mean, rtol=1e-12)
    scatter = sum(w[j] * np.outer(Z[j] - mean, Z[j] - mean) for j in range(3))
    np.testing.assert_allclose(found.covariances[1], scatter / (1.55 if literal else w.sum()))


def reference_competition(Z, components, schedule, min_count, iterations):
    """Euclidean competition from its equations, deaths by cardinality; returns means and numbers."""
    means = components.means
    U = None
    numbers = []
    for k in range(iterations):
        d2 = np.maximum(((Z[:, None] - means) ** 2).sum(axis=2), 1e-6)
        numbers.append(len(means))
        inverse = 1.0 / d2
        H = inverse / inverse.sum(axis=1, keepdims=True)
        if k < 3:
            U = H
        else:
            N_i = U.sum(axis=0)
            alpha = schedule(k) * np.sum(U**2 * d2) / np.sum(N_i**2)
            U = np.clip(H + alpha * inverse * (N_i - H @ N_i[:, None]), 0.0, 1.0)
            U /= U.sum(axis=1, keepdims=True)
            U = U[:, U.sum(axis=0) >= min_count]
        means = (U**2).T @ Z / ((U**2).sum(axis=0) + 1e-6)[:, None]
    return means, numbers


def test_competition_against_its_equations():
    Z, _ = ellipses(0)
    start = components_of_partition(Z, np.random.default_rng(0).integers(0, 12, len(Z)), no_prior(2))
    schedule = exponential_schedule(5.0, 5.0)
    found = compete_for_prototypes(
        Z,
        start,
        no_prior(2),
        schedule,
        distance="euclid",
        death_rule="cardinality",
        min_count=20.0,
        max_iter=20,
        tol=0.0,
    )
    means, numbers = reference_competition(Z, start, schedule, 20.0, 20)
    assert found.history.n_clusters == numbers
    assert numbers[:4] == [12, 12, 12, 12]
    assert 1 < len(means) < 12
    np.testing.assert_allclose(found.components.means, means, rtol=1e-7)
    np.testing.assert_array_equal(found.labels, np.argmin(((Z[:, None] - means) ** 2).sum(axis=2), axis=1))
    np.testing.assert_allclose(found.history.eta, [schedule(k) for k in range(20)])
    assert not found.converged
