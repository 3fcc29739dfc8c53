"""Contexts: the right number, the right demonstrations, and none where there is nothing to find."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skill.states.context_mixture import MAX_SAMPLES, ContextMixture, correlation_times
from tests.skill.states.mixtures import agreement, make_mixture


def fitted(X, U, Y, group, **settings_):
    return ContextMixture(**settings_).fit(X, Y, inputs=U, groups=group)


@pytest.fixture(scope="module")
def two_contexts():
    *data, _ = make_mixture((1.0, -1.0))
    return fitted(*data)


@pytest.mark.parametrize("slopes", [(1.0, -1.0), (1.5, 0.0, -1.5)])
def test_the_number_and_the_demonstrations_of_contexts_are_found(slopes):
    *data, contexts = make_mixture(slopes)
    dut = fitted(*data, max_contexts=4)
    assert dut.n_contexts_ == len(slopes)
    assert agreement(dut.responsibilities_, contexts) == 1.0
    np.testing.assert_allclose(dut.weights_, 1 / len(slopes), atol=0.02)
    assert len(dut.gains_) == len(slopes)  # one more did not help


@pytest.mark.parametrize("seed", range(3))
def test_there_is_a_single_context_where_there_is_nothing_to_find(seed):
    *data, _ = make_mixture((1.0,), seed=seed)
    dut = fitted(*data)
    assert dut.n_contexts_ == 1
    np.testing.assert_array_equal(dut.responsibilities_, 1.0)


def test_a_different_level_within_one_law_of_motion_is_no_context_without_an_effect():
    # Groups differ in where they are, not in how they answer.
    X, U, Y, group, _ = make_mixture((1.0,), groups=12, seed=1)
    assert fitted(X + 0.2 * (group % 2)[:, None], U, Y, group).n_contexts_ == 1


def test_a_peculiar_demonstration_alone_is_no_context():
    X, U, Y, group, _ = make_mixture((1.0,))
    strange = np.where(group == 3, -1.0, 1.0)
    assert fitted(X, U, Y * strange[:, None], group).n_contexts_ == 1


def test_the_order_and_the_names_of_groups_do_not_matter():
    X, U, Y, group, contexts = make_mixture((1.0, -1.0), groups=12)
    # Mixed, and interleaved; each group is in the order of time.
    renamed = np.random.default_rng(2).permutation(12)[group]
    order = np.lexsort([renamed, np.arange(len(group)) % 40])
    dut = fitted(X, U, Y, group, max_contexts=3)
    other = fitted(X[order], U[order], Y[order], 100 + group[order], max_contexts=3)
    np.testing.assert_array_equal(other.groups_, np.arange(100, 112))
    np.testing.assert_allclose(other.responsibilities_, dut.responsibilities_, atol=1e-9)
    np.testing.assert_allclose(other.gains_, dut.gains_, atol=1e-9)
    assert agreement(dut.responsibilities_, contexts) == 1.0


@settings(max_examples=5, deadline=None)
@given(
    scale=st.tuples(*[st.sampled_from([1e-3, 0.1, 50.0])] * 3),
    shift=st.tuples(*[st.sampled_from([-20.0, 0.0, 3.0])] * 2),
)
def test_the_units_do_not_matter(scale, shift):
    X, U, Y, group, _ = make_mixture((1.0, -1.0), groups=12, length=25)
    dut = fitted(X, U, Y, group)
    other = fitted(scale[0] * X + shift[0], scale[1] * U, scale[2] * Y + shift[1], group)
    np.testing.assert_allclose(dut.responsibilities_, other.responsibilities_, atol=1e-6)


def test_unseen_demonstrations_are_recognised(two_contexts):
    X, U, Y, group, contexts = make_mixture((1.0, -1.0), seed=9)
    found = two_contexts.predict_proba(X, Y, inputs=U, groups=group)
    assert agreement(found, contexts) == 1.0
    assert found.max(axis=1).mean() > 0.99


def test_groups_without_samples_have_the_weights_of_the_contexts(two_contexts):
    found = two_contexts.probabilities_of([4, 999])
    np.testing.assert_array_equal(found[0], two_contexts.responsibilities_[4])
    np.testing.assert_array_equal(found[1], two_contexts.weights_)


def test_a_demonstration_is_judged_by_the_others_alone():
    """With itself among the samples, noise of this set makes two contexts."""
    *data, _ = make_mixture((1.0,), groups=14, length=15, noise=0.6, seed=1)
    assert fitted(*data).n_contexts_ == 1


class Scored:
    """Stands in for EM: every result with K contexts has the scores of K."""

    n_groups = 4

    def __init__(self, scores):
        self.scores = scores

    def run(self, start):
        return SimpleNamespace(responsibilities=np.full_like(start, 1 / start.shape[1]))

    def split_score(self, fit):
        return np.array(self.scores[fit.responsibilities.shape[1]])


@pytest.mark.parametrize(
    ("second", "number"),
    [([1.0, 1.0, 1.0, 0.9], 2), ([3.0, -1.0, 1.0, -1.0], 1), ([2.0, 0.5, 1.0, -0.5], 2)],
)
def test_one_context_more_must_gain_more_than_its_standard_error(second, number):
    """Gains of 1, 0.5 and 0.75 on average, with standard errors of 0.03, 0.96 and 0.52."""
    dut = ContextMixture(max_contexts=2)
    found = dut._selected(Scored({1: [0.0] * 4, 2: second}), np.random.default_rng(0))
    assert found.responsibilities.shape[1] == number
    assert dut.gains_ == [(pytest.approx(np.mean(second)), pytest.approx(np.std(second, ddof=1) / 2))]


def test_repeated_samples_add_no_evidence():
    X, U, Y, group, _ = make_mixture((1.0, -1.0), groups=12, length=20)
    repeated = np.repeat(np.arange(len(X)), 4)
    once = fitted(X, U, Y, group, n_contexts=2)
    often = fitted(X[repeated], U[repeated], Y[repeated], group[repeated], n_contexts=2)
    ratio = often.correlation_times_ / once.correlation_times_
    assert (ratio > 3.0).all()
    assert (ratio < 5.0).all()


def test_many_samples_are_thinned_and_the_correlation_times_remain_in_samples():
    X, U, Y, group, contexts = make_mixture((1.0, -1.0), groups=12, length=MAX_SAMPLES // 8)
    dut = fitted(X, U, Y, group, n_contexts=2)
    assert len(dut.samples_) <= MAX_SAMPLES
    assert (dut.correlation_times_ >= 2.0).all()  # every second sample is kept
    assert agreement(dut.responsibilities_, contexts) == 1.0


def test_correlation_times_of_an_autoregressive_process():
    rng, rho = np.random.default_rng(0), 0.8
    noise = rng.normal(size=(20000, 2))
    series = np.zeros_like(noise)
    for t in range(1, len(noise)):
        series[t] = [rho, 0.0] * series[t - 1] + noise[t]
    times = correlation_times(series, np.repeat(np.arange(20), 1000))
    assert times[0] == pytest.approx((1 + rho) / (1 - rho), rel=0.15)
    assert times[1] == pytest.approx(1.0, abs=0.1)


def test_a_stored_estimator_gives_the_same_evidence(two_contexts):
    X, U, Y, _, _ = make_mixture((1.0, -1.0), groups=8)
    again = ContextMixture.from_arrays(two_contexts.to_arrays())
    expected = two_contexts.log_likelihoods(X, Y, inputs=U)
    np.testing.assert_array_equal(again.log_likelihoods(X, Y, inputs=U), expected)
    np.testing.assert_array_equal(again.weights_, two_contexts.weights_)
    assert again.n_contexts_ == 2


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("group", lambda a: a + 50, "array 'group' goes up to"),
        ("responsibilities", lambda a: 0.5 * a, "rows that sum to one"),
        ("correlation_times", lambda a: 0.1 * a, "correlation_times"),
        ("inputs", lambda a: a[:-1], "inputs"),
        ("groups", lambda a: a[::-1], "array 'groups': expected increasing numbers"),
    ],
)
def test_damaged_arrays_are_refused(name, change, message):
    *data, _ = make_mixture((1.0, -1.0), groups=6, length=10)
    arrays = fitted(*data, n_contexts=2).to_arrays()
    with pytest.raises(ValueError, match=message):
        ContextMixture.from_arrays({**arrays, name: change(arrays[name])})


@pytest.mark.parametrize(
    ("settings_", "message"),
    [
        ({"n_contexts": 0}, "The 'n_contexts' parameter of ContextMixture must be"),
        ({"max_contexts": 0}, "The 'max_contexts' parameter"),
        ({"bandwidth": -1.0}, "The 'bandwidth' parameter"),
    ],
)
def test_a_bad_parameter_is_refused(settings_, message):
    *data, _ = make_mixture((1.0,), groups=4, length=5)
    with pytest.raises(ValueError, match=message):
        fitted(*data, **settings_)


def test_bad_samples_are_refused():
    X, U, Y, group, _ = make_mixture((1.0,), groups=4, length=5)
    with pytest.raises(ValueError, match=r"inconsistent numbers of samples: \[20, 20, 19, 20\]"):
        fitted(X, U[1:], Y, group)
    with pytest.raises(ValueError, match="Input y contains NaN"):
        fitted(X, U, np.where(group[:, None] == 1, np.nan, Y), group)
    with pytest.raises(ValueError, match="found 1 group, expected at least 2"):
        fitted(X, U, Y, np.zeros(20))
