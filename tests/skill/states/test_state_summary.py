import math

import numpy as np
import pytest

from skill.states.phase_agreement import compare_with_phases
from skill.states.state_summary import FORCE, MOMENT, UNUSED, short_number, summarise_states
from tests.state_recordings import FORCES, MOMENTS, NAMES, labelled

WRENCHES = np.hstack([FORCES, MOMENTS])


def test_summary_worked_by_hand():
    a = labelled([0, 0, 0, 1, 2, 2, 1, 1], WRENCHES)
    b = labelled([0, 1, 1, 1, 1], WRENCHES)
    free, touch, press = summarise_states([a, b], 3)
    assert free.share == pytest.approx(4 / 13)
    assert touch.share == pytest.approx(7 / 13)
    assert (free.visits, touch.visits, press.visits) == (1.0, 1.5, 0.5)
    assert (free.recordings, touch.recordings, press.recordings) == (2, 2, 1)
    assert free.duration == pytest.approx((0.2, 0.12, 0.28))  # visits of 0.3 and 0.1 s
    assert touch.duration.median == pytest.approx(0.2)  # 0.1, 0.2 and 0.4 s, the last two up to the end
    assert free.following == ((1, 1.0),)
    assert touch.following == ((None, pytest.approx(2 / 3)), (2, pytest.approx(1 / 3)))
    assert press.following == ((1, 1.0),)
    assert list(press.quantities) == ["fx", "fy", "fz", "mx", "my", "mz", FORCE, MOMENT]
    assert press.quantities[FORCE] == pytest.approx((20.0, 20.0, 20.0))
    assert press.quantities[MOMENT].median == pytest.approx(0.5)
    assert press.quantities["fx"].median == -12.0
    assert (free.name, touch.name, press.name) == NAMES


def test_ranges_are_those_of_the_middle_eighty_per_cent():
    force = np.linspace(0.0, 10.0, 101)
    item = labelled([0] * 101, [[0.0] * 6])
    item.recording.values[:, 2] = force
    (state,) = summarise_states([item], 1)
    assert state.quantities["fz"] == pytest.approx((5.0, 1.0, 9.0))


def test_a_gap_counts_as_one_interval():
    time = [0.0, 0.1, 0.2, 1.2, 1.3]  # a gap of 1 s after the last sample of state 0
    states = summarise_states([labelled([0, 0, 0, 1, 1], WRENCHES, time=time)], 2)
    assert states[0].duration.median == pytest.approx(0.3)
    assert states[1].duration.median == pytest.approx(0.2)
    assert states[0].share == pytest.approx(0.3 / 0.5)
    time = [0.0, 0.1, 0.2, 0.6, 0.7]  # no gap: samples that are left out
    states = summarise_states([labelled([0, 0, 0, 1, 1], WRENCHES, time=time)], 2)
    assert states[0].duration.median == pytest.approx(0.6)


def test_a_state_without_samples_has_a_summary():
    used, unused = summarise_states([labelled([0, 0, 0], WRENCHES)], 2)
    assert used.share == 1.0
    assert unused.name == UNUSED
    assert (unused.share, unused.visits, unused.recordings, unused.following) == (0.0, 0.0, 0, ())
    assert math.isnan(unused.duration.median)
    assert math.isnan(unused.quantities["fz"].low)


def names(wrenches, channels=("fx", "fy", "fz", "mx", "my", "mz")):
    states = np.repeat(np.arange(len(wrenches)), 5)
    return [s.name for s in summarise_states([labelled(states, wrenches, channels=channels)], len(wrenches))]


@pytest.mark.parametrize(
    ("wrench", "name"),
    [
        ([0, 0, -12.4, 0, 0, 0], "12 N along -z"),
        ([30, 0, 40, 0, 0, 0], "50 N along +z +x"),
        ([10, 10, -10, 0, 0, 0], "17 N along +x +y -z"),
        ([0, 0, 1, 0, 0, 0], "free"),
        ([0, 0, 1, 0, 2, 0], "little force, 2 N m about +y"),
        ([0, 0, 12, 0, 0, 0.2], "12 N along +z"),  # a small moment is not named
    ],
)
def test_a_state_is_named_after_its_median_force_and_moment(wrench, name):
    assert names([wrench, [0, -20, 0, 1.0, 0, 0]])[0] == name


def test_forces_that_change_their_direction_have_none():
    a = labelled([0] * 10, WRENCHES[[1]])
    a.recording.values[::2, 2] *= -1
    assert summarise_states([a], 1)[0].name == "8 N in changing directions"


@pytest.mark.parametrize(("moment", "name"), [([0, 0, 0], "no forces"), ([0, 2, 0], "no forces, 2 N m about +y")])
def test_a_recording_without_forces_says_so(moment, name):
    assert names([[0, 0, 0, *moment], [0, 0, 0, 1.0, 0, 0]])[0] == name


def test_moments_that_are_noise_are_not_named():
    a = labelled([0] * 50, WRENCHES[[1]])
    a.recording.values[:, 3:] = np.random.default_rng(0).normal(scale=0.1, size=(50, 3))
    assert summarise_states([a], 1)[0].name == "8 N along -z"


def test_without_forces_of_three_axes_a_state_is_named_after_its_channels():
    assert names([[12.4, 0.0031], [0.1, 0.0]], ("fz", "depth")) == ["fz 12 N, depth 3.1 mm", "fz 0.1 N, depth 0 mm"]
    assert names([[1.0, 2.0]], ("grip", "fx")) == ["fx 2 N, grip 1"]


@pytest.mark.parametrize(
    ("value", "text"), [(12.4, "12"), (0.284, "0.28"), (1234.0, "1200"), (-0.06, "-0.06"), (0, "0")]
)
def test_short_numbers_have_two_digits_and_no_exponent(value, text):
    assert short_number(value) == text


# ------------------------------------------------------------ known phases


def test_agreement_with_phases_worked_by_hand():
    a = labelled([0, 0, 1, 1], WRENCHES, phases=np.array([10, 9, 9, 2]))
    b = labelled([1, 1, 1, 1], WRENCHES)  # without phases: does not count
    agreement = compare_with_phases([a, b], 3)
    assert agreement.phases == ("2", "9", "10")
    assert agreement.counts.tolist() == [[0, 1, 0], [1, 1, 0], [1, 0, 0]]
    # Pairs of equal state 2, of equal phase 1, of both 0, of all 6: (0 - 1/3) / (3/2 - 1/3)
    assert agreement.ari == pytest.approx(-2 / 7)


def test_names_of_phases_stay_in_the_order_of_time():
    a = labelled([0, 1, 1], WRENCHES, phases=np.array(["reach", "press", "press"]))
    b = labelled([0, 0], WRENCHES, phases=np.array([3, 3]))
    agreement = compare_with_phases([a, b], 2)
    assert agreement.phases == ("reach", "press", "3")
    assert agreement.counts.tolist() == [[1, 0], [0, 2], [2, 0]]
    assert compare_with_phases([labelled([0, 1], WRENCHES)], 2) is None
