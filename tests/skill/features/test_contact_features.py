import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from skill.features.contact_features import ContactFeatures
from skill.features.wrench_features import MEASURED

angles = st.floats(-3.0, 3.0)
depths = st.floats(0.005, 0.03)
frictions = st.floats(0.0, 0.3)

DUT = ContactFeatures(force_floor=0.01)


def seen(*contacts, depth, dut=DUT):
    """Features of walls that push the peg by ``size`` N towards ``angle``, ``height`` above the tip, with friction."""
    wrench = np.zeros(6)
    for size, angle, height, friction in contacts:
        outward = np.array([np.cos(angle), np.sin(angle), 0.0])
        force = size * (outward + friction * np.array([0.0, 0.0, 1.0]))
        wrench += [*force, *np.cross([0.0, 0.0, height] - dut.peg_radius * outward, force)]
    return dict(zip(dut.get_feature_names_out(), dut.transform(np.array([[*wrench, -depth]]))[0], strict=True))


@given(st.floats(2.0, 200.0), angles, depths, frictions)
def test_one_point_at_the_tip_bears_no_force_at_the_mouth_however_deep_hard_or_rough(size, angle, depth, friction):
    features = seen((size, angle, 0.0, friction), depth=depth)
    assert features["tip_force"] == pytest.approx(0.995, abs=2e-3)  # 1 / sqrt(1 + share^2)
    assert features["mouth_force"] == pytest.approx(0.0, abs=1e-9)


@given(st.floats(2.0, 200.0), angles, depths, frictions)
def test_one_point_at_the_mouth_bears_none_at_the_tip(size, angle, depth, friction):
    features = seen((size, angle, depth, friction), depth=depth)
    assert features["tip_force"] == pytest.approx(0.0, abs=1e-9)
    assert features["mouth_force"] == pytest.approx(-0.995, abs=2e-3)


@given(st.floats(2.0, 50.0), st.sampled_from([0.1, 0.5, 0.9, 1.1, 2.0, 10.0]), angles, depths)
def test_two_opposite_contacts_have_opposite_signs_and_two_alike_the_same(size, ratio, angle, depth):
    against = seen((size, angle, 0.0, 0.0), (ratio * size, angle + np.pi, depth, 0.0), depth=depth)
    assert against["mouth_force"] < 0.0 < against["tip_force"]  # whichever is the greater
    along = seen((size, angle, 0.0, 0.0), (ratio * size, angle, depth, 0.0), depth=depth)
    assert along["tip_force"] * along["mouth_force"] > 0.0


def test_a_wedge_looks_the_same_at_every_depth_and_force():
    """Nearly a couple: the direction of its wrench would follow the depth, that of its net force is fortuitous."""
    wedges = [
        seen((size, 0.3, 0.0, 0.0), (share * size, 0.3 + np.pi, depth, 0.0), depth=depth)
        for size in (20.0, 200.0)
        for share in (0.9, 1.1)
        for depth in (0.005, 0.01, 0.02)
    ]
    found = np.array([[w["tip_force"], w["mouth_force"]] for w in wedges])
    np.testing.assert_allclose(found, [[0.99, -0.99]] * len(wedges), atol=4e-3)


def test_what_the_sensor_cannot_tell_from_noise_is_no_force():
    rng = np.random.default_rng(0)
    noise = np.hstack([rng.normal(size=(500, 3)) * 0.02, rng.normal(size=(500, 3)) * 2e-4, np.full((500, 1), -0.01)])
    assert np.abs(ContactFeatures().transform(noise)).max() < 0.3


def posed(x, tilt, depth, turned=0.0):
    """One sample of a peg whose tip is at x, tilted about y, pushed along x; all turned about z."""
    R = Rotation.from_euler("z", turned)
    sample = dict.fromkeys(("fx", "fy", "fz", "mx", "my", "mz", "x", "y", "z", "ax", "ay", "az"), 0.0)
    for names, vector in (
        (("fx", "fy", "fz"), (5.0, 0.0, 0.0)),
        (("x", "y", "z"), (x, 0.0, -depth)),
        (("ax", "ay", "az"), (0.0, 1.0, 0.0)),
    ):
        sample.update(zip(names, R.apply(vector), strict=True))
    return pd.DataFrame([{**sample, "angle": tilt, "dangle": 0.0}])


@pytest.mark.parametrize("turned", [0.0, 2.1])
def test_the_hidden_offsets_say_how_much_of_the_play_is_used_up(turned):
    dut = ContactFeatures(play=5e-5)
    assert list(dut.hidden_names()) == ["tip_offset", "mouth_offset"]
    edge = np.tanh(0.5)
    # A straight peg at the wall: all of it is at the wall.
    straight = dut.transform_demonstration(posed(-5e-5, 0.0, 0.01, turned))[0, 3:]
    np.testing.assert_allclose(straight, [-edge, -edge], atol=1e-12)
    # Two-point contact: the tip at one wall, the axis at the mouth a play to the other side, over the depth.
    wedged = dut.transform_demonstration(posed(-5e-5, 1e-4 / 0.01, 0.01, turned))[0, 3:]
    np.testing.assert_allclose(wedged, [-edge, edge], atol=1e-12)
    # Above the hole there is no mouth to be offset from but the tip.
    above = dut.transform_demonstration(posed(2e-5, 0.03, -0.002, turned))[0, 3:]
    np.testing.assert_allclose(above, np.tanh([0.2, 0.2]), atol=1e-12)


def test_measured_features_come_first_and_the_peg_may_be_of_another_size():
    samples = pd.concat([posed(1e-5, 0.002, 0.01), posed(-1e-5, 0.0, 0.02)])
    both = DUT.transform_demonstration(samples)
    np.testing.assert_array_equal(both[:, :3], DUT.transform(samples[list(MEASURED)]))
    large = ContactFeatures(peg_radius=0.02, force_floor=0.01)
    features = seen((10.0, 0.5, 0.0, 0.2), depth=0.02, dut=large)
    assert features["mouth_force"] == pytest.approx(0.0, abs=1e-9)
