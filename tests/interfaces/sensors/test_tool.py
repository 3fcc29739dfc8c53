"""The identification of a tool, and the check of signs and axes, against made-up readings."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from interfaces.sensors.tool import GRAVITY, check_pushes, identify_tool

MASS, CENTRE = 0.42, np.array([0.003, -0.002, 0.045])
BIAS = np.array([1.5, -0.8, 2.2, 0.03, -0.02, 0.01])
POSES = Rotation.from_rotvec(
    np.radians([[180, 0, 0], [150, 0, 0], [180, 30, 0], [160, -30, 20], [180, 0, 60]])
).as_matrix()


def reading(R_WS, contact=(0.0,) * 6):
    weight = MASS * (R_WS.T @ GRAVITY)
    return BIAS + np.concatenate([weight, np.cross(CENTRE, weight)]) + contact


def test_mass_centre_and_bias_are_found():
    rng = np.random.default_rng(1)
    noise = np.array([0.005] * 3 + [1e-4] * 3)  # of means over a second
    found = identify_tool(POSES, [reading(R) + noise * rng.normal(size=6) for R in POSES])
    assert found.mass == pytest.approx(MASS, rel=0.01)
    np.testing.assert_allclose(found.centre, CENTRE, atol=1e-3)
    np.testing.assert_allclose(found.bias, BIAS, atol=0.02)
    assert found.force_error < 0.02
    assert found.moment_error < 1e-3


def test_the_contact_is_what_bias_and_weight_leave():
    found = identify_tool(POSES, [reading(R) for R in POSES])
    contact = np.array([2.0, -1.0, 5.0, 0.1, 0.05, -0.02])
    np.testing.assert_allclose(found.contact(reading(POSES[3], contact), POSES[3]), contact, atol=1e-9)


@pytest.mark.parametrize("poses", [POSES[:2], np.array([POSES[0], POSES[1], POSES[0]])], ids=["two", "about one axis"])
def test_orientations_that_are_too_much_alike_are_refused(poses):
    with pytest.raises(ValueError, match="expected three or more that are turned by 20 deg about two axes"):
        identify_tool(poses, [reading(R) for R in poses])


PUSHES = {"+x": [5.0, 0.2, -0.3], "+y": [0.1, 6.0, 0.0], "+z": [0.0, -0.4, 4.0]}


def test_right_pushes_pass():
    check_pushes(PUSHES)
    check_pushes({"-z": [0.0, 0.0, -3.0]})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: -f, r"\+x is measured as -x; expected the force of the world on the tool"),
        (lambda f: f * [1, -1, 1], r"\+y is measured as -y; expected"),
        (
            lambda f: f[[1, 0, 2]],
            r"\+x is measured as \+y; .* correct the signs of the sensor, or the rotation",
        ),
        (lambda f: 0.1 * f, r"pushed along \+x: the force changed by 0.50 N; push with at least 2 N"),
    ],
)
def test_wrong_signs_and_axes_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        check_pushes({name: change(np.array(force)) for name, force in PUSHES.items()})
