import numpy as np

from skill.arrays import outlier_limits, resolution, sequences, standard_scale


def test_sequences_are_the_rows_of_each_group_in_their_order():
    found = list(sequences(np.array([2, 0, 2, 0, 1])))
    assert [rows.tolist() for rows in found] == [[1, 3], [4], [0, 2]]
    alternating = np.arange(1000) % 3
    for k, rows in enumerate(sequences(alternating)):
        assert rows.tolist() == list(range(k, 1000, 3))


def test_outlier_limits_worked_by_hand():
    """Of 0, ..., 100, the 1 % quantiles are 1 and 99: the limits are 2 ranges of 98 beyond them."""
    X = np.column_stack([np.arange(101.0), np.r_[np.zeros(100), 9.0]])
    low, high = outlier_limits(X)
    np.testing.assert_array_equal(low, [-195.0, -np.inf])  # a channel that hardly varies has no limits
    np.testing.assert_array_equal(high, [295.0, np.inf])


def test_one_wild_sample_does_not_change_the_scale():
    X = np.random.default_rng(0).normal(size=(3000, 2))
    np.testing.assert_array_equal(standard_scale(X), X.std(axis=0))  # nothing else changes
    for value in (-50.0, -1e3, 1e9):
        spiked = X.copy()
        spiked[7, 1] = value
        np.testing.assert_allclose(standard_scale(spiked), X.std(axis=0), rtol=0.05)


def test_weights_count_like_repetitions():
    rng = np.random.default_rng(0)
    X, weights = rng.normal(size=(200, 3)), rng.integers(1, 4, size=200)
    X[5] = 1e3
    repeated = np.repeat(X, weights, axis=0)
    np.testing.assert_array_equal(outlier_limits(X, weights), outlier_limits(repeated))
    np.testing.assert_allclose(standard_scale(X, weights), standard_scale(repeated))


def test_resolution_is_the_smallest_step():
    X = np.array([[0.5, 3.0], [0.0, 3.0], [2.0, 3.0], [0.5, 3.0]])
    np.testing.assert_array_equal(resolution(X), [0.5, 0.0])
    assert resolution(X[:1]).tolist() == [0.0, 0.0]
