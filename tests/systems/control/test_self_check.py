import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.systems.analysis import Simulator

from models.hardware import GRAVITY, DcMotorParameters, StepperMotorParameters, WrenchSensorParameters
from models.scenario import Scenario
from skill.data.axes import AXES
from systems.control.self_check import SelfCheck
from systems.steps.faults import Fault
from systems.steps.self_check import PERIOD_STEPS, CheckLimits, MovingParts, axial_force
from tests.stepping import fixed_context

SENSOR, MOTOR, STEPPER = WrenchSensorParameters(), DcMotorParameters(), StepperMotorParameters()
DRIVE_PERIOD = 2e-3
PERIOD = PERIOD_STEPS * DRIVE_PERIOD
PARTS = MovingParts.of(Scenario(), mass=1.05, peg_weight=1.45)
SQUARE = Scenario()
SQUARE.geometry.section = "square"
SQUARE_PARTS = MovingParts.of(SQUARE, mass=1.05, peg_weight=1.45)
IN_AIR, AT_CHAMFER, IN_HOLE = -0.003, 0.001, 0.005
WEIGHT = 1.05 * GRAVITY


def holding_current(force=0.0):
    """Current (A) at which the drive carries the weight less an upward contact force (N), at rest."""
    return (WEIGHT - force) / MOTOR.force_constant


def limits(sensor=SENSOR, parts=PARTS):
    return CheckLimits.of(sensor=sensor, motor=MOTOR, stepper=STEPPER, parts=parts, drive_period=DRIVE_PERIOD)


class Rig:
    """A rig at rest with its self-check, one period at a time."""

    def __init__(self, seed=0, sensor=SENSOR, parts=PARTS, axes=AXES[:2]):
        self.dut, self.axes = SelfCheck(limits(sensor, parts), axes), axes
        self.rng = np.random.default_rng(seed)
        self.context = fixed_context(
            self.dut, wrench=np.zeros(6), depth=[IN_AIR], current=[holding_current()], travel=[0.083],
            **{f"{name}_shaft": [0.0, 0.0] for name in axes},
        )  # fmt: skip
        self.simulator = Simulator(self.dut, self.context)

    def run(self, wrench=(0.0,) * 6, *, times=20, depth=IN_AIR, force=None, torque=None, noise=1.0):
        """Reads a wrench with noise. The drives carry ``force`` (N) and ``torque`` (N m), by default those of it."""
        wrench = np.array(wrench)
        fx, fy, fz, mx, my, mz = wrench
        torque = (mx + depth * fy, my - depth * fx, mz)[: len(self.axes)] if torque is None else torque
        sigma = np.array([*SENSOR.force_noise, *SENSOR.torque_noise])
        inputs = {"depth": [depth], "current": [holding_current(fz if force is None else force)]}
        for name, value in zip(self.axes, torque, strict=True):
            inputs[f"{name}_shaft"] = [0.01, 0.01 - value / STEPPER.stiffness]
        for name, value in inputs.items():
            self.dut.GetInputPort(name).FixValue(self.context, value)
        for _ in range(times):
            reading = wrench + noise * sigma * self.rng.standard_normal(6)
            self.dut.GetInputPort("wrench").FixValue(self.context, reading)
            self.simulator.AdvanceTo(self.context.get_time() + PERIOD)
        return self.dut.GetOutputPort("fault").Eval(self.context)[0]


TOUCH = (-3.0, 0.0, 1.5, 0.0, -0.03, 0.0)  # one contact at c = (10, 0, 5) mm: m_y = 0.005 f_x - 0.010 f_z


@settings(max_examples=30, deadline=None)
@given(
    st.integers(0, 10**6),
    st.floats(0.0, 2.0 * math.pi),
    st.floats(0.0, 20.0),
    st.floats(0.0, 0.8),
    st.floats(0.0, IN_HOLE),
)
def test_a_sound_sensor_is_never_named(seed, angle, lateral, axial, height):
    """Any noise, and one contact of any direction, strength and height."""
    rig = Rig(seed)
    assert rig.run(times=30) == Fault.NONE
    place = np.array([0.010 * math.cos(angle), 0.010 * math.sin(angle), height])
    force = lateral * np.array([-math.cos(angle), -math.sin(angle), axial])
    wrench = np.concatenate([force, np.cross(place, force)])
    assert rig.run(wrench, times=30, depth=IN_HOLE) == Fault.NONE


@pytest.mark.parametrize(("channel", "sign"), [(channel, (-1.0) ** channel) for channel in range(6)])
def test_a_bias_in_free_air_is_named(channel, sign):
    """The bias of a force is 0.05 N; of a moment about the tip, 80 mm below, hypot(1e-3, 0.08 * 0.05) = 4.1e-3 N m."""
    unit = np.zeros(6)
    unit[channel] = sign * (0.05 if channel < 3 else 4.12e-3)
    assert Rig().run(4.0 * unit, force=0.0, torque=(0.0, 0.0)) == Fault.NONE
    assert Rig().run(20.0 * unit, force=0.0, torque=(0.0, 0.0)) == Fault.SENSOR_BIASED


def test_noise_is_named_in_free_air():
    assert Rig().run(noise=3.0) == Fault.NONE
    assert Rig().run(noise=50.0) == Fault.SENSOR_NOISY
    assert Rig().run(noise=50.0, depth=IN_HOLE) == Fault.NONE  # a contact may chatter


def test_a_sensor_is_not_judged_by_the_zeros_of_its_delay():
    late = WrenchSensorParameters(delay=0.2)
    biased = (2.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    rig = Rig(sensor=late)
    assert rig.run(biased, times=25) == Fault.NONE
    assert rig.run(biased, times=15) == Fault.SENSOR_BIASED


@pytest.mark.parametrize(
    ("gain", "force", "fault"),
    [
        (1.0, 15.0, Fault.NONE),
        (1.25, 15.0, Fault.NONE),
        (0.8, 15.0, Fault.NONE),
        (0.3, 12.0, Fault.SENSOR_LOW),
        (0.1, 8.0, Fault.SENSOR_LOW),
        (0.0, 8.0, Fault.SENSOR_LOW),  # frozen, or late
        (3.0, 8.0, Fault.SENSOR_HIGH),
        (-1.0, 8.0, Fault.SENSOR_REVERSED),
        (-1.0, -8.0, Fault.SENSOR_REVERSED),
        (0.1, 3.0, Fault.NONE),  # within the dry friction of the screw, 2.5 N
    ],
)
def test_the_feed_drive_measures_gain_and_sign_of_the_axial_force(gain, force, fault):
    rig = Rig()
    assert rig.run(times=30) == Fault.NONE
    assert rig.run((0.0, 0.0, gain * force, 0.0, 0.0, 0.0), times=60, depth=IN_HOLE, force=force) == fault


def test_a_force_of_the_drive_in_free_air_is_a_blocked_feed():
    assert Rig().run(force=8.0, times=60) == Fault.MOTOR_STALLED


def test_the_axial_force_follows_from_the_momentum():
    """(m + J N^2) a + m g + c v - N (eta k_t i - b w - tau_c) at 10 mm/s, 1 m/s^2 and 0.5 A."""
    N = 2.0 * math.pi / 5e-3
    inertia = 1.05 + 1e-6 * N**2
    friction = 2e-6 * N * 0.010 + 1e-3 * math.tanh(0.5 * N * 0.010)
    expected = inertia + 1.05 * 9.81 + 5.0 * 0.010 - N * (0.85 * 0.0235 * 0.5 - friction)
    assert axial_force(limits(), 0.5, 0.010, 1.0) == pytest.approx(expected)
    assert axial_force(limits(), holding_current(7.0), 0.0, 0.0) == pytest.approx(7.0)


SIGNS = {
    "fx and fy": ([-1, -1, 1, 1, 1, 1], None),
    "mx and my": ([1, 1, 1, -1, -1, 1], None),
    "x and y swapped": ([1] * 6, [1, 0, 2, 4, 3, 5]),
}


@pytest.mark.parametrize(("signs", "order"), SIGNS.values(), ids=SIGNS)
def test_the_first_touch_shows_wrong_signs_and_swapped_axes(signs, order):
    rig = Rig()
    assert rig.run(times=20) == Fault.NONE
    reading = np.array(TOUCH)[order or range(6)] * np.array(signs)
    torque = (0.0, TOUCH[4] - AT_CHAMFER * TOUCH[0])
    assert rig.run(reading, times=8, depth=AT_CHAMFER, torque=torque) == Fault.SENSOR_CROSSED


def test_only_the_first_touch_is_one_contact():
    rig = Rig()
    assert rig.run(times=20) == Fault.NONE
    assert rig.run(TOUCH, times=20, depth=AT_CHAMFER) == Fault.NONE
    crossed = np.array(TOUCH) * [1, 1, 1, -1, -1, 1]
    assert rig.run(crossed, times=20, depth=AT_CHAMFER) == Fault.NONE
    deeper = Rig()  # two contacts at once may give this wrench
    assert deeper.run(times=20) == Fault.NONE
    assert deeper.run(crossed, times=20, depth=IN_HOLE) == Fault.NONE


def test_a_peg_that_is_not_round_may_touch_with_two_contacts_at_once():
    rig = Rig(parts=SQUARE_PARTS)
    assert rig.run(times=20) == Fault.NONE
    crossed = np.array(TOUCH) * [1, 1, 1, -1, -1, 1]
    assert rig.run(crossed, times=20, depth=AT_CHAMFER) == Fault.NONE


def test_free_air_begins_above_the_corners_of_a_tilted_mouth():
    corner = math.sqrt(2.0) * 0.0095 + 0.00105  # corners keep their centres; clearance and chamfer add 0.55 mm
    assert SQUARE_PARTS.rim == pytest.approx(corner * PARTS.turn)
    assert SQUARE_PARTS.rim > 1.3 * PARTS.rim


@pytest.mark.parametrize(("axis", "fault"), [(0, Fault.SENSOR_MOMENT), (1, Fault.NONE)])
def test_a_moment_along_the_peg_turns_the_axis_of_yaw_only(axis, fault):
    """Pitch turns the axis of yaw out of the plane across the peg, by up to the largest turn."""
    rig = Rig(parts=SQUARE_PARTS)
    torque = [0.0, 0.0]
    torque[axis] = 0.9 * PARTS.turn * 1.5
    wrench = (0.0, 0.0, 5.0, 0.0, 0.0, 1.5)
    assert rig.run(wrench, times=20, depth=IN_HOLE, torque=tuple(torque)) == fault


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(("gain", "fault"), [(1.0, Fault.NONE), (1.2, Fault.NONE), (-1.0, Fault.SENSOR_MOMENT)])
def test_a_resting_stepper_measures_the_moment_about_its_axis(axis, gain, fault):
    rig = Rig(axes=AXES)
    moments = np.zeros(3)
    moments[axis] = 0.4
    wrench = (0.0, 0.0, 5.0, *(gain * moments))
    assert rig.run(wrench, times=8, depth=IN_HOLE, torque=tuple(moments)) == Fault.NONE  # it may ring
    assert rig.run(wrench, times=12, depth=IN_HOLE, torque=tuple(moments)) == fault


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_lag_below_half_a_step_does_not_name_the_stepper(axis):
    """Half a step is a torque of K step/2 = 0.39 N m; at 0.3 N m the sensor or the stepper may be wrong."""
    rig = Rig(axes=AXES)
    torque = [0.0, 0.0, 0.0]
    torque[axis] = 0.3
    assert rig.run(times=20, depth=IN_HOLE, torque=tuple(torque)) == Fault.SENSOR_MOMENT


@pytest.mark.parametrize(
    ("axis", "fault"), [(0, Fault.PITCH_STICKS), (1, Fault.YAW_STICKS), (2, Fault.CLOCKING_STICKS)]
)
def test_a_stepper_that_does_not_reach_its_angle_without_a_load_sticks(axis, fault):
    torque = [0.0, 0.0, 0.0]
    torque[axis] = 0.9 * STEPPER.holding_torque
    assert Rig(axes=AXES).run(times=30, torque=torque) == fault
    torque[axis] = 0.05
    assert Rig(axes=AXES).run(times=30, torque=torque) == Fault.NONE
