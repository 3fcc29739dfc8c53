"""Statistics of features, against NumPy over all frames."""

import numpy as np
import pytest

from interfaces.exports.statistics import QUANTILES, as_lists, feature_statistics, joined_statistics


@pytest.fixture
def parts():
    rng = np.random.default_rng(0)
    return [rng.normal(k, 1.0 + k, size=(n, 3)) for k, n in enumerate((5, 40, 17))]


def test_the_statistics_of_an_episode(parts):
    found = feature_statistics(parts[1])
    np.testing.assert_allclose(found["std"], parts[1].std(axis=0))
    np.testing.assert_allclose(found["q90"], np.quantile(parts[1], 0.9, axis=0))
    assert found["count"].tolist() == [40]


def test_single_numbers_and_flags_have_one_dimension():
    found = as_lists(feature_statistics(np.array([False, False, False, True])))
    assert (found["min"], found["max"], found["mean"], found["count"]) == ([0.0], [1.0], [0.25], [4])


def test_joined_statistics_are_those_of_all_frames(parts):
    joined = joined_statistics([feature_statistics(part) for part in parts])
    rows = np.vstack(parts)
    for name in ("min", "max", "mean", "std"):
        np.testing.assert_allclose(joined[name], getattr(rows, name)(axis=0))
    assert joined["count"].tolist() == [62]


def test_joined_quantiles_are_weighted_means(parts):
    joined = joined_statistics([feature_statistics(part) for part in parts])
    for name, share in QUANTILES.items():
        each = [np.quantile(part, share, axis=0) for part in parts]
        np.testing.assert_allclose(joined[name], np.average(each, axis=0, weights=[5, 40, 17]))
