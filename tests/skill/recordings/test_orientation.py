"""The same orientation is the same numbers, whatever signs its quaternion has, or beyond half a turn."""

import re

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from skill.recordings.orientation import with_common_orientation
from skill.recordings.reading import read_recordings

POSES = {  # rotation vectors, rad
    "upright": [0, 0, 0],
    "tool down": [np.pi, 0, 0],
    "tool down, turned": [0, np.pi, 0],
    "tool down, between": [np.pi * np.cos(1.3), np.pi * np.sin(1.3), 0],
    "turned round": [0, 0, np.pi],
    "a third": [2 * np.pi / 3 / np.sqrt(3)] * 3,
    "any": [1.2, -0.9, 2.0],
}


def around(pose, seed=0, n=300, spread=0.1):
    return Rotation.from_rotvec(spread * np.random.default_rng(seed).normal(size=(n, 3))) * Rotation.from_rotvec(pose)


def signs(rotations, how):
    q = rotations.as_quat(canonical=True)
    rng = np.random.default_rng(9)
    return q * {"as they are": 1, "negative": -1, "changing": rng.choice([-1, 1], (len(q), 1))}[how]


def as_quaternions(rotations, how):
    return dict(zip(("qx", "qy", "qz", "qw"), signs(rotations, how).T, strict=True))


def as_vectors(rotations, how):
    """Rotation vectors of up to a turn, as one gets of quaternions without a care for their sign."""
    q = signs(rotations, how)
    length = np.maximum(np.linalg.norm(q[:, :3], axis=1), 1e-12)
    vectors = q[:, :3] * (2 * np.arctan2(length, q[:, 3]) / length)[:, None]
    return dict(zip(("rx", "ry", "rz"), vectors.T, strict=True))


def write(path, orientation, **columns):
    n = len(next(iter(orientation.values())))
    table = pd.DataFrame(
        {"time": np.arange(n) / 100, "fx": 1.0, "fy": np.arange(n), "fz": 2.0, **orientation, **columns}
    )
    table.to_csv(path, index=False)
    return path


@pytest.mark.parametrize("pose", POSES)
def test_an_orientation_is_the_same_numbers_in_every_file(tmp_path, pose):
    rotations = around(POSES[pose])
    found = []
    for form in (as_quaternions, as_vectors):
        for how in ("as they are", "negative", "changing"):
            [recording] = read_recordings(write(tmp_path / "a.csv", form(rotations, how)))
            assert recording.channels == ("fx", "fy", "fz", "rx", "ry", "rz")
            found.append(recording.values)
    for values in found:
        np.testing.assert_allclose(values, found[0], rtol=0, atol=1e-6)
    vectors = found[0][:, 3:]
    assert (Rotation.from_rotvec(vectors).inv() * rotations).magnitude().max() < 1e-6
    np.testing.assert_array_equal(found[0][:, 1], np.arange(300))
    # As plain numbers they lie together as the orientations do.
    turned = (rotations.mean().inv() * rotations).magnitude()
    assert np.linalg.norm(vectors - vectors.mean(axis=0), axis=1).max() < 3 * turned.max()


def test_recordings_whose_own_reference_differs_follow_the_first_one(tmp_path):
    w = 0.245  # where the sign of the next component decides
    poses = [Rotation.from_quat([-0.9, 0.3, 0.0, w + d]).as_rotvec() for d in (0.03, -0.03, 0.02, -0.02)]
    for order in ((0, 1, 2, 3), (1, 0, 2, 3)):
        read = [
            read_recordings(write(tmp_path / "a.csv", as_quaternions(around(poses[k], k, spread=0.01), "changing")))[0]
            for k in order
        ]
        assert np.ptp([r.values[:, 3].mean() for r in read]) > 1
        found = with_common_orientation(read)
        np.testing.assert_allclose(found[0].values, read[0].values, rtol=0, atol=1e-12)
        assert np.ptp([r.values[:, 3:].mean(axis=0) for r in found], axis=0).max() < 0.2
        [_, later] = with_common_orientation([found[0], read[2]])
        np.testing.assert_allclose(later.values, found[2].values, rtol=0, atol=1e-12)


def test_recordings_without_orientation_stay_as_they_are(tmp_path):
    read = read_recordings(write(tmp_path / "a.csv", {"px": np.arange(5.0)}))
    assert with_common_orientation(read) == read


@pytest.mark.parametrize("axis", ["rx", "rz"])
def test_a_single_axis_is_not_wrapped(tmp_path, axis):
    angle = np.pi + 0.2 * np.sin(np.arange(100) / 10)
    wrapped = (angle + np.pi) % (2 * np.pi) - np.pi
    assert np.ptp(wrapped) > 6
    [found] = read_recordings(write(tmp_path / "a.csv", {axis: wrapped}))
    assert found.channels[-1] == axis
    np.testing.assert_allclose(np.abs(found.values[:, 3]), angle, rtol=0, atol=1e-9)


def refused(path, message):
    with pytest.raises(ValueError, match=rf"{re.escape(str(path))}: .*{re.escape(message)}") as error:
        read_recordings(path)
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(("scale", "norm"), [(0, "0"), (0.5, "0.5"), (16384, "1.638e+04")])
def test_what_is_no_unit_quaternion_is_refused(tmp_path, scale, norm):
    columns = as_quaternions(around(POSES["any"]), "as they are")
    factor = np.where(np.arange(300) < 7, scale, 1)
    path = write(tmp_path / "a.csv", {name: factor * numbers for name, numbers in columns.items()})
    refused(path, f"a quaternion of norm {norm} in line 2 (7 such rows), expected 1")


def test_a_rotation_beyond_a_turn_is_refused_and_the_remedies_work(tmp_path):
    degrees = np.degrees(np.stack([*as_vectors(around(POSES["tool down"]), "as they are").values()]))
    path = write(tmp_path / "a.csv", dict(zip(("rx", "rot_y", "rz"), degrees, strict=True)))
    remedy = refused(path, "expected at most a turn; say the unit, e.g. rx=rx:deg")
    choices = ["rx=rx:deg", "ry=rot_y:deg", "rz=rz:deg"]
    assert np.abs(read_recordings(path, columns=choices)[0].values[:, 3:]).max() < 2 * np.pi
    path = write(tmp_path / "b.csv", {"rz": np.arange(50.0)})  # of a screw
    remedy = re.search(r"e\.g\. (turn=rz:rad)$", refused(path, "a rotation by 7 rad in line 9 (43 such rows)"))[1]
    np.testing.assert_array_equal(read_recordings(path, columns=[remedy])[0].values[:, 3], np.arange(50))


def test_two_orientations_are_refused_and_the_remedy_works(tmp_path):
    rotations = around(POSES["any"])
    path = write(tmp_path / "a.csv", as_quaternions(rotations, "negative") | as_vectors(rotations, "as they are"))
    text = refused(path, "qw qx qy qz and rx ry rz are two orientations, expected one")
    remedy = re.findall(r"turn_\w=\w+", text)
    [found] = read_recordings(path, columns=remedy)
    assert found.channels == ("fx", "fy", "fz", "rx", "ry", "rz", "turn_x", "turn_y", "turn_z")
