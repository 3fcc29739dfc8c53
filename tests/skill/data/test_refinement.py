import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.spatial.transform import Rotation

from skill.data.demonstration import ACTIONS
from skill.data.refinement import even_out, refine_demonstration

step = st.floats(-1.0, 1.0).map(lambda v: round(v, 3))
action_arrays = arrays(float, array_shapes(min_dims=2, max_dims=2, min_side=2, max_side=25), elements=step)


def demonstration(actions):
    frame = pd.DataFrame(np.atleast_2d(actions), columns=list(ACTIONS))
    frame.insert(0, "time", np.arange(len(frame)) * 0.02)
    return frame


def along_x(*steps):
    actions = np.zeros((len(steps), 6))
    actions[:, 0] = steps
    return demonstration(actions)


def greatest_difference(actions):
    return np.linalg.norm(np.diff(actions, axis=0), axis=1).max()


@pytest.mark.parametrize(("average", "expected"), [("both", [5, 5, 0]), ("later", [0, 5, 0])])
def test_the_two_readings_of_the_average(average, expected):
    even, count = even_out(np.array([[0.0], [10.0], [0.0]]), 5.0, average)
    np.testing.assert_array_equal(even[:, 0], expected)
    assert count == 1


@settings(deadline=None)
@given(action_arrays, st.floats(0.01, 1.0))
def test_averaging_both_ends_even_and_preserves_the_motion(actions, rough):
    even, count = even_out(actions, rough, "both")
    assert greatest_difference(even) <= rough
    np.testing.assert_allclose(even.sum(axis=0), actions.sum(axis=0), atol=1e-9)
    # Each averaging lowers the sum of squares by more than rough^2 / 2: this bounds their number.
    lost = (actions**2).sum() - (even**2).sum()
    assert count * rough**2 / 2 <= lost + 1e-9


@settings(deadline=None)
@given(action_arrays, st.floats(0.01, 1.0))
def test_averaging_the_later_ends_even_and_leaves_the_first(actions, rough):
    even, _ = even_out(actions, rough, "later")
    assert greatest_difference(even) <= rough
    np.testing.assert_array_equal(even[0], actions[0])


@settings(deadline=None, max_examples=20)
@given(action_arrays, st.floats(1e-320, 1e-12), st.sampled_from(["both", "later"]))
def test_thresholds_below_rounding_end_too(actions, rough, average):
    even, _ = even_out(actions, rough, average)
    assert np.isfinite(even).all()


@settings(deadline=None)
@given(arrays(float, st.tuples(st.integers(4, 30), st.just(6)), elements=step), st.floats(0.0, 0.5))
def test_refinement_preserves_the_total_motion(actions, still):
    actions[0, 0] = actions[-2, 0] = 2.0
    refined, report = refine_demonstration(demonstration(actions), still=still, rough=0.3)
    np.testing.assert_allclose(refined[list(ACTIONS)].sum(), actions.sum(axis=0), atol=1e-9)
    np.testing.assert_allclose(report.motion_change, 0.0, atol=1e-9)
    assert report.samples_after == len(refined) == len(report.merged)
    assert report.merged.sum() == report.samples_before == len(actions)


def test_dropped_motion_goes_to_the_next_sample_and_at_the_end_to_the_last():
    refined, report = refine_demonstration(along_x(0.1, 3.0, 0.2, 0.3, 4.0, 0.25), still=0.5, rough=np.inf)
    np.testing.assert_allclose(refined["ux"], [3.1, 4.75])
    np.testing.assert_array_equal(refined["time"], [0.02, 0.08])
    np.testing.assert_array_equal(report.merged, [2, 4])
    assert list(refined.index) == [0, 1]
    assert "4 idle ones dropped" in str(report)


def test_rotations_count_by_the_motion_of_the_surface():
    actions = np.zeros((3, 6))
    actions[:, 3] = [0.2, 0.05, 0.3]
    refined, _ = refine_demonstration(demonstration(actions), still=1e-3, rough=np.inf, rotation_scale=0.01)
    np.testing.assert_allclose(refined["rx"], [0.2, 0.35])


def test_the_input_is_left_alone():
    samples = along_x(1.0, 0.0, 2.0)
    before = samples.copy()
    refine_demonstration(samples, still=0.1, rough=0.2)
    pd.testing.assert_frame_equal(samples, before)


def test_the_rotation_step_spans_the_dropped_samples():
    samples = along_x(1.0, 0.0, 0.0, 1.0, 1.0)
    R = Rotation.from_rotvec(np.outer([0.0, 0.1, 0.3, 0.6, 1.0], [1.0, 0.0, 0.0]))
    samples[["ax", "ay", "az"]] = [1.0, 0.0, 0.0]
    samples["angle"] = R.magnitude()
    samples["dangle"] = [0.0, 0.1, 0.2, 0.3, 0.4]
    refined, _ = refine_demonstration(samples, still=0.5, rough=np.inf)
    np.testing.assert_allclose(refined["dangle"], [0.0, 0.6, 0.4])


@pytest.mark.parametrize(
    ("change", "remedy"),
    [
        ({"still": -1.0}, "zero or more"),
        ({"still": 5.0}, "lower `still`"),
        ({"rough": 0.0}, "infinity to skip"),
        ({"rough": np.nan}, "infinity to skip"),
        ({"average": "first"}, "'both' or 'later'"),
        ({"rotation_scale": 0.0}, "peg's radius"),
    ],
)
def test_bad_arguments_raise(change, remedy):
    with pytest.raises(ValueError, match=remedy):
        refine_demonstration(along_x(1.0, 2.0, 3.0), **({"still": 0.1, "rough": 0.5} | change))


def test_bad_samples_raise():
    with pytest.raises(ValueError, match="lack the action columns"):
        refine_demonstration(pd.DataFrame({"ux": [1.0]}), still=0.1, rough=0.5)
    with pytest.raises(ValueError, match="drop or repair"):
        refine_demonstration(along_x(1.0, np.nan, 3.0), still=0.1, rough=0.5)
