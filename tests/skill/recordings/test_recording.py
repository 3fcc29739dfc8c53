"""A recording is checked when it is made; averaging keeps the mean and the order of time and never fills a gap."""

import re

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from skill.recordings.recording import Recording


def recording(time, values=None, phases=None, channels=("fz",)):
    time = np.asarray(time, dtype=float)
    return Recording("snap.csv", time, np.ones((len(time), 1)) if values is None else values, channels, phases)


TIME = np.arange(4) / 100
REFUSED = {
    "one sample": (lambda: recording([0]), "snap.csv: found 1 samples, expected at least 2"),
    "NaN time": (lambda: recording([0, 1, np.nan]), "snap.csv: time is not finite in sample 2 (1 such samples)"),
    "back": (lambda: recording([0, 0.3, 0.1, 0.2]), "snap.csv: time 0.1 s jumps back from 0.3 s in sample 2 (1 such"),
    "twice": (lambda: recording([0, 0.3, 0.3]), "snap.csv: time 0.3 s occurs twice in sample 2 (1 such samples)"),
    "shape": (lambda: recording(TIME, np.ones((3, 1))), "snap.csv: values of shape (3, 1), expected (4, 1)"),
    "phases": (lambda: recording(TIME, phases=[1, 2]), "snap.csv: phases of type int64 and shape (2,)"),
    "float phases": (lambda: recording(TIME, phases=[0.5] * 4), "expected integers or texts of shape (4,)"),
    "rate": (lambda: recording(TIME).averaged(0), "snap.csv: a rate of 0 Hz, expected a positive number"),
    "too short": (lambda: recording(TIME).averaged(1), "snap.csv: lasts 0.03 s, too short to be averaged to 1 Hz"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_recording_is_refused(name):
    make, message = REFUSED[name]
    with pytest.raises(ValueError, match=re.escape(message)):
        make()


def test_numbers_become_floats_and_the_rate_ignores_gaps():
    found = recording([0, 10, 20, 5000, 5010], np.arange(5, dtype=np.int16)[:, None], ["a", "a", "b", "b", "b"])
    assert found.values.dtype == found.time.dtype == float
    assert found.rate == pytest.approx(0.1)
    assert found.duration == 5010
    assert found.phases.dtype.kind == "U"


def test_each_sample_is_the_mean_of_its_interval():
    time = np.arange(12) / 200
    found = recording(time, np.arange(12.0)[:, None] ** 2, [0, 0, 0, 1, 2, 1, 2, 3, 9, 8, 8, 9]).averaged(50)
    np.testing.assert_allclose(found.time, [0.0075, 0.0275, 0.0475], rtol=1e-12)
    np.testing.assert_allclose(found.values[:, 0], [14 / 4, (16 + 25 + 36 + 49) / 4, (64 + 81 + 100 + 121) / 4])
    assert found.phases.tolist() == [0, 2, 9]  # 2 is more frequent; 8 and 9 are equally so, and 9 is first


def test_a_slower_recording_is_returned_as_it_is():
    found = recording(np.arange(10) / 50.3)
    assert found.averaged(50) is found
    assert found.averaged(49) is not found


steps = st.lists(st.floats(1e-4, 0.3), min_size=9, max_size=60)


@given(steps=steps, share=st.floats(0.05, 0.9), seed=st.integers(0, 99), start=st.sampled_from([0.0, -5.0, 1e6]))
def test_averaging_irregular_samples(steps, share, seed, start):
    rng = np.random.default_rng(seed)
    time = start + np.concatenate([[0], np.cumsum(steps)])
    values = np.column_stack([time, rng.normal(size=len(time))])
    before = Recording("a, trial 3", time, values, ("p", "q"), trial="3")
    # The means of the intervals, found one after the other.
    rate = share * before.rate
    interval = np.floor((time - time[0] + 0.5 / before.rate) * rate)
    groups = [np.flatnonzero(interval == k) for k in np.unique(interval)]
    assume(len(groups) > 1)
    after = before.averaged(rate)
    assert (after.name, after.channels, after.trial) == (before.name, before.channels, "3")
    np.testing.assert_allclose(after.time, [time[g].mean() for g in groups], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(after.values, [values[g].mean(axis=0) for g in groups], rtol=1e-9, atol=1e-9)
