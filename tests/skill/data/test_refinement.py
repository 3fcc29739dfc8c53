import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.spatial.transform import Rotation

from skill.data.demonstration import ACTIONS
from skill.data.refinement import (
    INTENDED,
    intended_actions,
    refine_demonstration,
    smooth_actions,
    with_following_actions,
)

step = st.floats(-1.0, 1.0).map(lambda v: round(v, 3))
action_arrays = arrays(float, array_shapes(min_dims=2, max_dims=2, min_side=2, max_side=25), elements=step)


def demonstration(actions):
    frame = pd.DataFrame(np.atleast_2d(actions), columns=list(ACTIONS))
    frame.insert(0, "time", np.arange(len(frame)) * 0.02)
    return frame.assign(ax=0.0, ay=0.0, az=1.0, angle=0.0, dangle=0.0)


def along_x(*steps):
    actions = np.zeros((len(steps), 6))
    actions[:, 0] = steps
    return demonstration(actions)


def max_difference(actions):
    return np.linalg.norm(np.diff(actions, axis=0), axis=1).max()


@settings(deadline=None)
@given(action_arrays, st.floats(0.01, 1.0))
def test_averaging_terminates_and_preserves_the_motion(actions, rough):
    smoothed = smooth_actions(actions, rough)
    assert max_difference(smoothed) <= rough
    np.testing.assert_allclose(smoothed.sum(axis=0), actions.sum(axis=0), atol=1e-9)


def test_removed_motion_is_added_to_the_next_sample_and_at_the_end_to_the_last():
    refined = refine_demonstration(along_x(0.1, 3.0, 0.2, 0.3, 4.0, 0.25), still=0.5, rough=np.inf)
    np.testing.assert_allclose(refined["ux"], [3.1, 4.75])
    np.testing.assert_array_equal(refined["time"], [0.02, 0.08])
    assert list(refined.index) == [0, 1]


def test_rotations_count_as_motion_of_the_surface():
    actions = np.zeros((3, 6))
    actions[:, 3] = [0.2, 0.05, 0.3]
    refined = refine_demonstration(demonstration(actions), still=1e-3, rough=np.inf)
    np.testing.assert_allclose(refined["rx"], [0.2, 0.35])


def test_the_rotation_step_spans_the_removed_samples():
    samples = along_x(1.0, 0.0, 0.0, 1.0, 1.0)
    R = Rotation.from_rotvec(np.outer([0.0, 0.1, 0.3, 0.6, 1.0], [1.0, 0.0, 0.0]))
    samples[["ax", "ay", "az"]] = [1.0, 0.0, 0.0]
    samples["angle"] = R.magnitude()
    samples["dangle"] = [0.0, 0.1, 0.2, 0.3, 0.4]
    refined = refine_demonstration(samples, still=0.5, rough=np.inf)
    np.testing.assert_allclose(refined["dangle"], [0.0, 0.6, 0.4])


@pytest.mark.parametrize(
    ("change", "remedy"),
    [
        ({"still": -1.0}, "zero or more"),
        ({"still": np.nan}, "zero or more"),
        ({"still": 5.0}, "lower `still`"),
        ({"rough": 0.0}, "infinity to skip"),
        ({"rough": np.nan}, "infinity to skip"),
    ],
)
def test_bad_arguments_raise(change, remedy):
    with pytest.raises(ValueError, match=remedy):
        refine_demonstration(along_x(1.0, 2.0, 3.0), **({"still": 0.1, "rough": 0.5} | change))


def test_an_action_of_exactly_the_threshold_is_removed_and_a_difference_of_it_is_kept():
    refined = refine_demonstration(along_x(0.5, 1.0, 2.0, 4.0), still=0.5, rough=2.0)
    np.testing.assert_array_equal(refined["ux"], [1.5, 2.0, 4.0])
    assert len(refine_demonstration(along_x(1.0, 0.0, 2.0), still=0.0, rough=9.0)) == 2


def test_rotations_are_smoothed_as_motion_of_the_surface():
    actions = np.zeros((3, 6))
    actions[:, 3] = [1.0, 3.0, 3.0]  # differences of 0.02 m at the radius of 0.01 m
    smoothed = refine_demonstration(demonstration(actions), still=0.0, rough=0.019)
    np.testing.assert_allclose(smoothed["rx"], [2.0, 2.0, 3.0])


def test_pairs_that_start_at_even_samples_are_averaged_first():
    smoothed = smooth_actions(np.array([[0.0], [4.0], [8.0], [12.0]]), 3.0)
    # (0 4)(8 12), then 2 (2 10) 10, and (2 6)(6 10) again
    np.testing.assert_array_equal(smoothed[:, 0], [4.0, 6.0, 6.0, 8.0])


def test_the_rotation_step_of_a_removed_start_is_zero():
    samples = along_x(0.0, 1.0, 1.0)
    samples[["ax", "ay", "az"]] = [1.0, 0.0, 0.0]
    samples["angle"], samples["dangle"] = [0.0, 0.1, 0.3], [0.0, 0.1, 0.2]
    refined = refine_demonstration(samples, still=0.5, rough=np.inf)
    np.testing.assert_allclose(refined["dangle"], [0.0, 0.2])


@pytest.mark.parametrize("size", [1.0, 1e-3])
def test_a_difference_of_the_size_of_rounding_errors_is_not_averaged(size):
    """The limit is 1e-12 of the largest action, however small that is."""
    for difference, averaged in ((5e-13, False), (5e-12, True)):
        actions = size * np.array([[1.0], [1.0 + difference]])
        assert (smooth_actions(actions, 1e-300)[0] == smooth_actions(actions, 1e-300)[1]) == averaged
    assert len(smooth_actions(np.zeros((0, 6)), 1.0)) == 0


def turning(angles, *, feed=-1e-3, period=0.02):
    """Samples of a peg that turns about x and feeds by ``feed`` m after each sample but the last."""
    n = len(angles)
    samples = pd.DataFrame({"time": period * np.arange(n), "ax": 1.0, "ay": 0.0, "az": 0.0, "angle": angles})
    samples["uz"] = [feed] * (n - 1) + [0.0]
    return samples


def test_the_intended_turn_removes_the_remaining_rotation_with_the_time_constant():
    found = intended_actions(turning([0.06, 0.06, 0.03, 0.01]), correction_time=0.5, feed_time=0.02)
    assert list(found.columns) == list(INTENDED)
    np.testing.assert_allclose(found["intended_x"], 0.02 / 0.5 * np.array([-0.05, -0.05, -0.02, 0.0]), atol=1e-15)
    np.testing.assert_allclose(found["intended_y"], 0.0, atol=1e-15)


def test_no_intended_turn_exceeds_the_remaining_rotation():
    found = intended_actions(turning([0.06, 0.01]), correction_time=1e-6, feed_time=0.02)
    assert found["intended_x"][0] == pytest.approx(-0.05)


def test_the_intended_turn_is_expressed_in_the_peg_frame():
    """From a quarter turn about z, a further turn by 0.1 about y of H is one about x of P."""
    samples = turning([np.pi / 2] * 2).assign(ax=0.0, az=1.0)
    end = Rotation.from_rotvec([0.0, 0.1, 0.0]) * Rotation.from_rotvec([0.0, 0.0, np.pi / 2])
    vector = end.as_rotvec()
    samples.loc[1, ["ax", "ay", "az"]], samples.loc[1, "angle"] = vector / np.linalg.norm(vector), end.magnitude()
    found = intended_actions(samples, correction_time=0.02, feed_time=0.02)
    np.testing.assert_allclose(found.iloc[0, :2].to_numpy(dtype=float), [0.1, 0.0], atol=1e-12)


def test_the_intended_spin_is_that_about_the_axis_of_the_peg():
    found = intended_actions(turning([0.06, 0.04, 0.01]).assign(ax=0.0, az=1.0), correction_time=0.5, feed_time=0.02)
    np.testing.assert_allclose(found["intended_spin"], 0.02 / 0.5 * np.array([-0.05, -0.03, 0.0]), atol=1e-15)
    np.testing.assert_allclose(found[["intended_x", "intended_y"]], 0.0, atol=1e-15)


def test_the_intended_feed_is_the_mean_of_the_feeds_that_follow():
    samples = turning([0.0] * 5).assign(uz=[-3e-4, -1e-4, 0.0, -2e-4, 0.0])
    found = intended_actions(samples, correction_time=1.0, feed_time=0.04)
    np.testing.assert_allclose(found["intended_feed"], [-2e-4, -5e-5, -1e-4, -1e-4, 0.0], atol=1e-15)
    one = intended_actions(samples, correction_time=1.0, feed_time=1e-9)
    np.testing.assert_allclose(one["intended_feed"], samples["uz"], atol=1e-15)


@pytest.mark.parametrize("times", [{"correction_time": 0.0}, {"feed_time": -1.0}, {"correction_time": np.nan}])
def test_the_times_of_intended_actions_must_be_positive(times):
    name = next(iter(times))
    with pytest.raises(ValueError, match=f"{name} = .*expected a positive time in s"):
        intended_actions(turning([0.1, 0.0]), **{"correction_time": 0.4, "feed_time": 0.1, **times})


def test_a_row_holds_the_action_that_follows_it_and_the_last_row_none():
    recorded = along_x(1.0, 2.0, 3.0)
    found = with_following_actions(recorded)
    np.testing.assert_array_equal(found["ux"], [2.0, 3.0, 0.0])
    np.testing.assert_array_equal(found["time"], recorded["time"])
    np.testing.assert_array_equal(recorded["ux"], [1.0, 2.0, 3.0])  # a copy
