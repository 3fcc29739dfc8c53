import numpy as np
import pytest
from scipy import stats

from systems.math.noise import BLOCK, _draw_block, standard_normal

N = 6000


def draws(seed, stream):
    return np.array([standard_normal(seed, stream, tick, 1)[0] for tick in range(N)])


@pytest.fixture(scope="module")
def series():
    return {(seed, stream): draws(seed, stream) for seed in (1, 2) for stream in ("sight", "sensor noise")}


def test_each_series_is_standard_normal(series):
    for x in series.values():
        # The Kolmogorov distance exceeds 2.2/sqrt(n) with probability 2 exp(-2 x 2.2^2) = 1.3e-4.
        assert stats.kstest(x, "norm").statistic < 2.2 / np.sqrt(N)


def test_streams_seeds_and_ticks_are_independent(series):
    names = list(series)
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            assert abs(np.corrcoef(series[a], series[b])[0, 1]) < 5 / np.sqrt(N), (a, b)
        assert abs(np.corrcoef(series[a][:-1], series[a][1:])[0, 1]) < 5 / np.sqrt(N), a


def test_the_order_of_the_ticks_does_not_matter():
    ticks = np.arange(3 * BLOCK)
    ordered = np.array([standard_normal(3, "a", tick, 2) for tick in ticks])
    assert len(np.unique(ordered)) == ordered.size  # no block repeats another
    _draw_block.cache_clear()
    shuffled = np.random.default_rng(0).permutation(ticks)
    np.testing.assert_array_equal([standard_normal(3, "a", tick, 2) for tick in shuffled], ordered[shuffled])


def test_a_draw_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        standard_normal(3, "a", 4, 6)[0] = 1.0
