import math

import numpy as np
import pytest
from pydrake.math import RigidTransform
from scipy.spatial.transform import Rotation

from models.hardware import DEVICE_PRESETS, HapticDeviceParameters
from systems.haptics.haptic_device import HapticDevice
from systems.math.rotation import from_rotation_vector, rotation_vector
from tests.stepping import fixed_context, update

P = HapticDeviceParameters()
T = P.servo_period
START = RigidTransform(from_rotation_vector(np.array([0.03, -0.02, 0.0])), [0.001, 0.002, 0.003])


def device(*, hand=START, wrench=(0.0,) * 6, parameters=P, start=START):
    dut = HapticDevice(parameters=parameters, X_HD_start=start)
    return dut, fixed_context(dut, hand_pose=hand, virtual_wrench=list(wrench))


def rendered(dut, context):
    return dut.GetOutputPort("rendered_wrench").Eval(context)


def test_the_probe_is_at_its_start_before_the_first_reading():
    dut, context = device(hand=RigidTransform([0.05, 0.0, 0.0]))
    X = dut.GetOutputPort("probe_pose").Eval(context)
    np.testing.assert_allclose(X.GetAsMatrix34(), START.GetAsMatrix34(), atol=1e-15)
    np.testing.assert_array_equal(dut.GetOutputPort("probe_velocity").Eval(context), np.zeros(6))


def test_the_pose_is_quantised_to_the_resolution_of_the_encoders():
    turn, position = np.array([0.123456, -0.04321, 0.0101]), np.array([0.0123456, -0.0234567, 0.0301234])
    dut, context = device(hand=RigidTransform(from_rotation_vector(turn), position))
    update(dut, context, period=T)
    X = dut.GetOutputPort("probe_pose").Eval(context)
    for found, read, step in (
        (X.translation(), position, P.position_resolution),
        (rotation_vector(X.rotation()), turn, P.angle_resolution),
    ):
        np.testing.assert_allclose(found / step, np.round(read / step), atol=1e-6)


def test_a_hand_outside_the_workspace_is_measured_at_its_edge():
    direction = np.array([2.0, -1.0, 2.0]) / 3.0
    hand = RigidTransform(START.rotation(), START.translation() + 1.7 * P.workspace_radius * direction)
    dut, context = device(hand=hand)
    update(dut, context, period=T)
    offset = dut.GetOutputPort("probe_pose").Eval(context).translation() - START.translation()
    np.testing.assert_allclose(offset, P.workspace_radius * direction, atol=P.position_resolution)


def test_the_velocity_is_low_passed_by_a_first_order_filter_and_turns_about_axes_of_the_hole():
    # The default resolution would deflect the axis, so use a resolution ten thousand times finer.
    fine = HapticDeviceParameters(angle_resolution=1e-9, position_resolution=1e-9)
    rate, speed = np.array([0.0, 1.2, 1.6]), np.array([0.04, -0.08, 0.0])
    begin = Rotation.from_rotvec([0.3, -0.2, 0.1])
    start = RigidTransform(from_rotation_vector(begin.as_rotvec()), np.zeros(3))
    dut, context = device(start=start, hand=start, parameters=fine)
    blend = 1.0 - math.exp(-2.0 * math.pi * 60.0 * T)
    for k in range(1, 31):
        turn = (Rotation.from_rotvec(rate * T * k) * begin).as_rotvec()
        dut.GetInputPort("hand_pose").FixValue(context, RigidTransform(from_rotation_vector(turn), speed * T * k))
        update(dut, context, period=T)
        expected = (1.0 - (1.0 - blend) ** k) * np.concatenate([rate, speed])
        np.testing.assert_allclose(dut.GetOutputPort("probe_velocity").Eval(context), expected, atol=1e-5)


def test_the_load_is_the_larger_ratio_of_force_and_torque_to_their_limits_and_the_direction_is_kept():
    for torque, force, load in ((0.5, 0.25, 0.5), (0.25, 0.75, 0.75), (3.0, 2.0, 3.0), (0.0, 0.0, 0.0)):
        wrench = np.zeros(6)
        wrench[1], wrench[3:] = -torque * P.peak_torque, force * P.peak_force * np.array([2.0, -1.0, 2.0]) / 3.0
        dut, context = device(wrench=wrench)
        assert dut.load(context) == pytest.approx(load)
        np.testing.assert_allclose(rendered(dut, context), wrench / max(load, 1.0), rtol=1e-12)
    no_torque = DEVICE_PRESETS["inverse3"]
    dut, context = device(wrench=[1.0, 0, 0, 0, 0, 2.0 * no_torque.peak_force], parameters=no_torque)
    assert dut.load(context) == pytest.approx(2.0)


def test_the_mean_squares_limit_force_and_torque_separately():
    """Above the sustained square the limit is s."""
    torque, force = np.array([9.0, 0, 0, 0, 0, 0]), np.array([0, 0, 0, 0, 900.0, 0])
    s_t, s_f = P.sustained_torque, P.sustained_force
    device_ = device()[0]
    assert device_.limit(torque, np.array([2.0 * s_t**2, 0.0]))[0] == pytest.approx(s_t)
    assert device_.limit(torque, np.array([0.0, 2.0 * s_f**2]))[0] == pytest.approx(P.peak_torque)
    assert device_.limit(force, np.array([0.0, 2.0 * s_f**2]))[4] == pytest.approx(s_f)
    assert device_.limit(force, np.array([2.0 * s_t**2, 0.0]))[4] == pytest.approx(P.peak_force)


@pytest.mark.parametrize(
    ("axis", "peak", "sustained"), [(1, P.peak_torque, P.sustained_torque), (5, P.peak_force, P.sustained_force)]
)
def test_the_limit_follows_the_mean_square_of_what_was_rendered(axis, peak, sustained):
    """After a period under load the mean is a part of the square; it decays by that part in one without load."""
    wrench, share = np.eye(6)[axis] * 1000.0, T / P.thermal_time_constant
    dut, context = device(wrench=wrench)
    assert rendered(dut, context)[axis] == pytest.approx(peak)
    update(dut, context, period=T)
    mean = share * peak**2
    for left in (1.0, 1.0 - share):
        limit = math.sqrt(sustained**2 + (peak**2 - sustained**2) * (1 - left * mean / sustained**2))
        dut.GetInputPort("virtual_wrench").FixValue(context, wrench)
        assert rendered(dut, context)[axis] == pytest.approx(limit, rel=1e-12)
        dut.GetInputPort("virtual_wrench").FixValue(context, np.zeros(6))
        update(dut, context, period=T)
