"""Rates and times of episodes."""

import numpy as np
import pytest

from interfaces.exports.episodes import check_times, endings, frame_rate, with_units


def test_the_rate_is_a_whole_number():
    assert frame_rate(0.02 * np.arange(9), "a") == 50
    assert frame_rate(7.0 + np.arange(9) / 30.0, "a") == 30
    with pytest.raises(ValueError, match=r"^a: sampled at 33\.333 Hz, expected a whole number"):
        frame_rate(0.03 * np.arange(9), "a")
    with pytest.raises(ValueError, match=r"^a: sampled at 0\.33333 Hz"):
        frame_rate(3.0 * np.arange(9), "a")


def test_times_may_differ_by_half_a_frame():
    times = 3.0 + 0.02 * np.arange(50)
    times[7] += 0.009
    check_times(times, 50, "a")
    times[9:] += 0.012
    with pytest.raises(ValueError, match=r"^a: sample 9 at 3\.192 s, expected 3\.18 s at 50 samples"):
        check_times(times, 50, "a")


@pytest.mark.parametrize("success", [True, False])
def test_only_the_last_frame_ends_an_episode(success):
    found = endings(4, success=success)
    assert found["next.done"].tolist() == [False, False, False, True]
    assert found["next.success"].tolist() == [False, False, False, success]


def test_names_with_units():
    assert with_units(("fx", "mx"), ("N", "N m")) == ("fx [N]", "mx [N m]")
