import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from skill.features.contact_features import ContactFeatures
from skill.features.wrench_features import CanonicalFeatures


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
def test_the_hidden_offsets_are_in_units_of_the_play(turned):
    dut = ContactFeatures(play=5e-5)
    assert dut.hidden_names == ("tip_offset", "mouth_offset")
    edge = np.tanh(0.5)
    # A straight peg that touches the wall with its whole length.
    straight = dut.transform_demonstration(posed(-5e-5, 0.0, 0.01, turned))[0, 3:]
    np.testing.assert_allclose(straight, [-edge, -edge], atol=1e-12)
    # Two-point contact: the tip is offset by the play to one side, the axis at the mouth to the other side.
    wedged = dut.transform_demonstration(posed(-5e-5, 1e-4 / 0.01, 0.01, turned))[0, 3:]
    np.testing.assert_allclose(wedged, [-edge, edge], atol=1e-12)
    # Above the hole both offsets are that of the tip.
    above = dut.transform_demonstration(posed(2e-5, 0.03, -0.002, turned))[0, 3:]
    np.testing.assert_allclose(above, np.tanh([0.2, 0.2]), atol=1e-12)


def test_the_contact_forces_follow_from_force_and_moment_balance():
    """f_tip + f_mouth = f_lateral, l f_mouth = my - r fz, each over its size, noise and friction error."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(300, 7)) * [20, 20, 20, 0.3, 0.3, 0.3, 0.01]
    r, floor, share = 0.02, 0.8, 0.2
    dut = ContactFeatures(peg_radius=r, force_floor=floor, force_share=share)
    canonical = CanonicalFeatures(peg_radius=r, force_floor=floor).rotation_angle(X)
    found, angles = dut.transform(X), dut.rotation_angle(X)
    half_turns = 0
    for x, phi, features, angle in zip(X, canonical, found, angles, strict=True):
        back = Rotation.from_euler("z", -phi)
        (fx, _, fz), (_, my, _) = back.apply(x[:3]), back.apply(x[3:6])
        lever = max(-x[6], 0.1 * r)
        f_mouth = (my - r * fz) / lever
        f_tip = fx - f_mouth
        sign = -1.0 if f_tip < f_mouth else 1.0
        half_turns += sign < 0
        noise = floor**2 + (floor * r / lever) ** 2 + share**2 * (f_tip**2 + f_mouth**2)
        size = np.sqrt((x[:3] ** 2).sum() + (x[3:6] ** 2).sum() / r**2)
        expected = [sign * f / np.sqrt(f**2 + noise) for f in (f_tip, f_mouth)]
        np.testing.assert_allclose(features, [*expected, np.log(1.0 + size / floor)], rtol=1e-9)
        np.testing.assert_allclose(np.exp(1j * angle), sign * np.exp(1j * phi), atol=1e-12)
    assert 50 < half_turns < 250
    assert (np.abs(angles) <= np.pi).all()
    assert dut.names == ("tip_force", "mouth_force", "log_magnitude")
