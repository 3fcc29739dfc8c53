"""Invariances of Competitive Agglomeration, and degenerate samples."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.metrics import adjusted_rand_score
from threadpoolctl import threadpool_limits

from benchmarks.learners.cluster_sets import demonstrations_and_phase, insertion, separated
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration


def fit(X, **arguments):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return CompetitiveAgglomeration(n_init=1, random_state=0).fit(X, **arguments)


@pytest.fixture(scope="module")
def demonstrated():
    X, y = insertion(0, 900)
    groups, phase = demonstrations_and_phase(y)
    return X, groups, phase, fit(X, groups=groups, phase=phase)


@given(seed=st.integers(0, 2**31))
@settings(max_examples=5, deadline=None)
def test_units_of_the_channels_do_not_matter(demonstrated, seed):
    X, groups, phase, plain = demonstrated
    rng = np.random.default_rng(seed)
    scale, shift = np.exp(rng.uniform(-8, 8, 14)), rng.normal(size=14) * 10
    other = fit(X * scale + shift * scale, groups=groups, phase=phase)
    assert other.n_clusters_ == plain.n_clusters_
    assert adjusted_rand_score(plain.labels_, other.labels_) > 0.999
    np.testing.assert_allclose(other.means_, (plain.means_ + shift) * scale, rtol=1e-4, atol=1e-4 * scale.max())


@given(seed=st.integers(0, 2**31))
@settings(max_examples=5, deadline=None)
def test_order_of_samples_and_channels_does_not_matter(demonstrated, seed):
    X, groups, phase, plain = demonstrated
    rng = np.random.default_rng(seed)
    rows, channels = rng.permutation(len(X)), rng.permutation(14)
    other = fit(X[rows][:, channels], groups=groups[rows], phase=phase[rows])
    assert other.n_clusters_ == plain.n_clusters_
    assert adjusted_rand_score(plain.labels_[rows], other.labels_) > 0.999


def test_names_of_demonstrations_do_not_matter():
    X, y = insertion(1, 900)
    groups, phase = demonstrations_and_phase(y)
    names = np.array([f"demonstration {g * 7 % 30}" for g in groups])
    a, b = fit(X, groups=groups, phase=phase), fit(X, groups=names, phase=phase)
    np.testing.assert_array_equal(a.labels_, b.labels_)


def test_same_seed_and_any_number_of_threads_give_the_same_bits():
    X, _ = separated(0, N=1200)
    with threadpool_limits(1):
        one = CompetitiveAgglomeration(n_init=1, random_state=3).fit(X)
    with threadpool_limits(2):
        two = CompetitiveAgglomeration(n_init=1, random_state=3).fit(X)
    np.testing.assert_array_equal(one.means_, two.means_)
    np.testing.assert_array_equal(one.covariances_, two.covariances_)


@given(N=st.integers(2, 40), d=st.integers(1, 6), seed=st.integers(0, 2**31), kind=st.sampled_from(["full", "diag"]))
@settings(max_examples=30, deadline=None)
def test_any_finite_data_gives_finite_states(N, d, seed, kind):
    rng = np.random.default_rng(seed)
    X = np.round(rng.normal(size=(N, d)) * 2.0)  # many duplicates and ties
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        dut = CompetitiveAgglomeration(covariance_type=kind, n_init=2, random_state=0).fit(X)
    assert 1 <= dut.n_clusters_ <= max(1, N // (2 * (d + 1)))
    assert np.isfinite(dut.covariances_).all()
    np.testing.assert_allclose(dut.predict_proba(X).sum(axis=1), 1.0)
    assert dut.weights_.sum() == pytest.approx(1.0)


def test_constant_and_repeated_channels_do_not_matter():
    X, y = separated(0, N=900, d=4)
    dut = fit(np.column_stack([X, np.full(900, 3.7), X[:, 0]]))
    assert dut.n_clusters_ == 6
    assert adjusted_rand_score(y, dut.labels_) > 0.95
    assert fit(np.full((50, 3), 2.5)).n_clusters_ == 1


def test_forces_may_be_exactly_zero_in_free_motion():
    X, y = insertion(0)
    X[y == 0, 3:9] = 0.0
    groups, phase = demonstrations_and_phase(y)
    dut = CompetitiveAgglomeration(random_state=0).fit(X, groups=groups, phase=phase)
    assert adjusted_rand_score(y, dut.labels_) >= 0.95
