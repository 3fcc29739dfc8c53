import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from skill.data.demonstration import CHANNELS
from skill.data.geometry import PegHoleGeometry
from skill.features.contact_features import ContactFeatures
from skill.features.measurement import MEASURED
from skill.features.wrench_features import HIDDEN, CanonicalFeatures, NormalisedFeatures, RawFeatures

ALL = [RawFeatures, NormalisedFeatures, CanonicalFeatures, ContactFeatures]


def turned_about_z(measured, angle):
    R = Rotation.from_euler("z", angle)
    wrench = measured[:, :6].reshape(-1, 3)
    return np.hstack([R.apply(wrench).reshape(-1, 6), measured[:, 6:]])


def random_measurements(n=200, seed=0):
    rng = np.random.default_rng(seed)
    scale = [20, 20, 20, 0.3, 0.3, 0.3, 0.01]
    return rng.normal(size=(n, 7)) * scale


def random_demonstration(n=40, seed=0):
    rng = np.random.default_rng(seed)
    frame = pd.DataFrame(random_measurements(n, seed), columns=list(MEASURED))
    frame["x"], frame["y"] = rng.normal(size=(2, n)) * 1e-3
    axis = rng.normal(size=(n, 3))
    frame[["ax", "ay", "az"]] = axis / np.linalg.norm(axis, axis=1, keepdims=True)
    frame["angle"], frame["dangle"] = rng.uniform(0, 0.06, n), rng.uniform(0, 3e-3, n)
    return frame[list(CHANNELS)]


def test_the_features_of_a_part_have_its_radius():
    sizes = {"peg_length": 0.05, "hole_depth": 0.02, "chamfer": 0.0, "facets": 32, "block_radius": 0.03, "floor": 0.01}
    small = PegHoleGeometry(peg_radius=0.004, hole_radius=0.00401, **sizes)
    assert CanonicalFeatures.of(small).peg_radius == 0.004
    assert CanonicalFeatures.of(None).peg_radius == 0.01


def test_features_and_actions_turn_with_a_wrench_below_the_floor():
    rng = np.random.default_rng(0)
    X = random_measurements(500)
    X[:, :2] *= 0.2 / np.hypot(X[:, 0], X[:, 1])[:, None]
    A = rng.normal(size=(500, 3))
    dut = CanonicalFeatures(force_floor=0.5)
    turned = turned_about_z(X, 2.5)
    np.testing.assert_allclose(dut.transform(turned), dut.transform(X), atol=1e-10)
    expected = Rotation.from_euler("z", 2.5).apply(dut.actions_from_frame(X, A))
    np.testing.assert_allclose(dut.actions_from_frame(turned, A), expected, atol=1e-9)


@pytest.mark.parametrize("features", ALL)
def test_turning_actions_to_the_frame_and_back_changes_nothing(features):
    X = random_measurements()
    A = np.random.default_rng(1).normal(size=(len(X), 4))
    dut = features()
    np.testing.assert_allclose(dut.actions_from_frame(X, dut.actions_to_frame(X, A)), A, atol=1e-15)
    np.testing.assert_array_equal(dut.actions_to_frame(X, A)[:, 2:], A[:, 2:])
    np.testing.assert_array_equal(dut.actions_to_frame(X, A[:, :3]), dut.actions_to_frame(X, A)[:, :3])


@pytest.mark.parametrize("features", ALL)
def test_hidden_features_follow_the_measured_ones(features):
    samples, dut = random_demonstration(), features()
    both = dut.transform_demonstration(samples)
    k = len(dut.names)
    assert both.shape == (len(samples), k + len(dut.hidden_names))
    np.testing.assert_array_equal(both[:, :k], dut.transform(samples))


@pytest.mark.parametrize("features", ALL)
@pytest.mark.parametrize(
    ("X", "remedy"),
    [
        (np.zeros(7), "reshape"),
        (np.zeros((3, 6)), "expected \\(n, 7\\)"),
        (np.full((2, 7), np.nan), "drop or repair"),
        (np.full((2, 7), np.inf), "drop or repair"),
        (pd.DataFrame(np.zeros((2, 2)), columns=["fx", "fy"]), "lack the columns"),
    ],
)
def test_bad_measurements_raise_errors_that_name_the_remedy(features, X, remedy):
    with pytest.raises(ValueError, match=remedy):
        features().transform(X)


@pytest.mark.parametrize("features", ALL)
def test_bad_actions_raise(features):
    X = random_measurements(4)
    with pytest.raises(ValueError, match="one row \\(omega_x"):
        features().actions_to_frame(X, np.zeros((3, 3)))


def test_raw_features_are_the_measurements_over_their_scales():
    X = random_measurements()
    dut = RawFeatures(peg_radius=0.02, force_scale=5.0, depth_scale=0.03)
    np.testing.assert_allclose(dut.transform(X), X / [5, 5, 5, 0.1, 0.1, 0.1, 0.03], rtol=1e-12)
    np.testing.assert_array_equal(dut.rotation_angle(X), np.zeros(len(X)))
    assert dut.names == MEASURED


def test_normalised_features_are_direction_depth_and_magnitude():
    X = random_measurements()
    dut = NormalisedFeatures(peg_radius=0.02, force_floor=3.0)
    wrench = X[:, :6] / [1, 1, 1, 0.02, 0.02, 0.02]
    s = np.sqrt((wrench**2).sum(axis=1))
    np.testing.assert_allclose(dut.transform(X)[:, :6], wrench / np.sqrt(s**2 + 9.0)[:, None], rtol=1e-12)
    np.testing.assert_allclose(dut.transform(X)[:, 7], np.log(1.0 + s / 3.0), rtol=1e-12)
    assert dut.names == (*MEASURED, "log_magnitude")


def test_canonical_features_are_the_normalised_ones_in_the_canonical_frame():
    X = random_measurements()
    dut = CanonicalFeatures(peg_radius=0.02, force_floor=3.0)
    turned = np.vstack([turned_about_z(x[None], -phi) for x, phi in zip(X, dut.rotation_angle(X), strict=True)])
    expected = NormalisedFeatures(peg_radius=0.02, force_floor=3.0).transform(turned)
    expected[:, 4] -= expected[:, 2]
    np.testing.assert_allclose(dut.transform(X), expected[:, [0, 2, 3, 4, 5, 6, 7]], atol=1e-12)


def test_the_frame_below_the_floor_follows_the_blend_of_force_and_moment():
    """f + max(0, floor - |f|) e,  e = -z x m / sqrt(|m|^2 + (r floor)^2)."""
    X = random_measurements(100)
    X[:, :2] *= 0.04
    X[:, 3:5] *= 0.04
    dut = CanonicalFeatures(force_floor=0.5, peg_radius=0.02)
    below = np.hypot(X[:, 0], X[:, 1]) < 0.5
    assert 10 < below.sum() < 90
    for x, phi in zip(X, dut.rotation_angle(X), strict=True):
        f, m = np.array([x[0], x[1], 0.0]), np.array([x[3], x[4], 0.0])
        e = -np.cross([0.0, 0.0, 1.0], m) / np.sqrt(m @ m + (0.02 * 0.5) ** 2)
        blend = f + max(0.0, 0.5 - np.linalg.norm(f)) * e
        np.testing.assert_allclose(np.exp(1j * phi), complex(*blend[:2]) / np.linalg.norm(blend), atol=1e-12)


@pytest.mark.parametrize("features", [RawFeatures, NormalisedFeatures, CanonicalFeatures])
def test_hidden_features_are_the_pose_over_its_scales(features):
    samples, dut = random_demonstration(), features(depth_scale=0.03, tilt_scale=0.2)
    hidden = dut.transform_demonstration(samples)[:, -6:]
    back = Rotation.from_euler("z", -dut.rotation_angle(samples)[:, None])
    lateral = back.apply(np.column_stack([samples[["x", "y"]], np.zeros(len(samples))]))[:, :2]
    rotation = back.apply(samples[["ax", "ay", "az"]].to_numpy() * samples[["angle"]].to_numpy())
    np.testing.assert_allclose(hidden[:, :2], lateral / (0.03 * 0.2), atol=1e-12)
    np.testing.assert_allclose(hidden[:, 2:5], rotation / 0.2, atol=1e-12)
    np.testing.assert_allclose(hidden[:, 5], np.degrees(samples["dangle"]) / 0.18, rtol=1e-12)
    assert dut.hidden_names == HIDDEN


def test_the_first_value_that_is_not_finite_is_named():
    X, A = random_measurements(5), np.zeros((5, 3))
    X[3, 5] = np.nan
    A[2, 1] = np.inf
    with pytest.raises(ValueError, match="RawFeatures: 'mz' is nan in row 3"):
        RawFeatures().transform(X)
    with pytest.raises(ValueError, match="RawFeatures: 'omega_y' is inf in row 2"):
        RawFeatures().actions_to_frame(random_measurements(5), A)
    with pytest.raises(ValueError, match="'angle' is nan in row 1"):
        RawFeatures().transform_demonstration(random_demonstration(3).assign(angle=[0.0, np.nan, 0.0]))


def test_depth_is_logarithmic_and_heights_above_the_floor_are_equal():
    dut = NormalisedFeatures(depth_floor=1e-3)
    column = dut.names.index("z")
    z = np.array([0.02, 0.005, 0.001, 0.0, -0.001, -0.003, -0.007, -0.015])
    found = dut.transform(np.column_stack([np.zeros((len(z), 6)), z]))[:, column]
    np.testing.assert_allclose(found, np.log(2.0) * np.array([1, 1, 1, 0, -1, -2, -3, -4]), atol=1e-12)
