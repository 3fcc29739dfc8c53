"""The self-check of the sensor: its readings in free air, and in contact against what the drives carry."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.hardware import DcMotorParameters, StepperMotorParameters, WrenchSensorParameters
from models.scenario import Scenario
from systems.control.faults import Fault, reading_deviation
from systems.hardware.dc_motor import FRICTION_SPEED

GRAVITY = 9.81  # in units of m/s^2
SIGMAS = 6.0  # a bias or drift beyond so many standard deviations of the data sheet is a fault
NOISE_FACTOR = 5.0  # noise beyond so many times that of the data sheet is a fault
TARE_SAMPLES = 5  # of one tare
SETTLING = 5.0  # time constants of the sensor's low-pass before its reading counts as settled
AVERAGING = 0.050  # in units of s; time constant of the averages that are compared
GAIN_ERROR = 0.3  # largest relative error between sensor and drives: efficiency of the screw, holding torque
TOUCH_FORCE = 2.0  # in units of N, lateral, from which a touch is judged
TOUCH_MOMENT = 0.010  # in units of N m, wrong moment at the first touch; drift and noise after the tare are 2e-3
TOUCH_TIME = 0.1  # in units of s, of contact, before a second contact joins the first
CROSSED_TIME = 0.030  # in units of s, for which force and moment must contradict each other
FLAT = 0.8  # axial over lateral force; beyond it the tip may stand on an edge and carry a moment of either sign
RESTING = 0.030  # in units of s; the ringing of a stepper (61 Hz, damping 0.58) is over after this time
PATIENCE = 0.040  # in units of s, for which the steppers must contradict the sensor, beyond the sensor's delay

AXES = ("pitch", "yaw")


@dataclass(frozen=True)
class MovingParts:
    """What the drives move.

    Attributes:
        mass: of carriage, mount and peg, kg.
        peg_mass: of the peg below the sensor, kg.
        friction: viscous friction of the carriage, N s/m.
        pivot_error: largest distance of the gimbal's axes from the plane of the mouth, m.
        rim: largest height of the hole's rim above the mouth's centre when the hole is tilted, m.
        touch_depth: largest depth at which the tip's edge is at the chamfer of a tilted hole, m.
        top_speed: largest speed command, m/s.
    """

    mass: float
    peg_mass: float
    friction: float
    pivot_error: float
    rim: float
    touch_depth: float
    top_speed: float

    @classmethod
    def of(cls, scenario: Scenario, *, mass: float, peg_weight: float) -> Self:
        """Returns the moving parts of a resolved scenario.

        Args:
            scenario: resolved.
            mass: of carriage, mount and peg, kg.
            peg_weight: N.
        """
        g, p = scenario.geometry, scenario.controller
        rim = (g.hole_radius + g.chamfer) * math.sin(p.max_turn)
        return cls(
            mass=mass,
            peg_mass=peg_weight / GRAVITY,
            friction=scenario.rig.carriage_friction,
            pivot_error=max(scenario.rig.pivot_range, scenario.rig.demonstrated_pivot_range),
            rim=rim,
            touch_depth=rim + g.chamfer,
            top_speed=p.max_feed_speed,
        )


# Places in the discrete state; READING, SUM and SQUARES are the first of six.
FAULT = 0  # first fault found
FREE = 1  # time in free air, s
COUNT = 2  # samples of the present tare
TOUCHED = 3  # time in contact, s
CROSSED = 4  # time for which force and moment have contradicted each other, s
COMMANDED = 5  # last commanded angles of pitch and yaw, rad
REST = 7  # times since they changed, s
CONTRADICTED = 9  # times for which the axes have contradicted the sensor, s
READING = 11  # last wrench of the tare
SUM = 17  # sum of the wrenches of the present tare
SQUARES = 23  # sum of their squared differences
TARED = 29  # whether there has been a tare
TARE = 30  # mean moments about x and y of the last tare, N m
SIZE = 32

# Places in the discrete state of the feed drive, after its FAULT.
STARTED = 1  # whether there has been a sample
TRAVEL = 2  # last position of the carriage, m
SPEED = 3  # last speed of the carriage, m/s
LAGGED = 4  # axial contact force by the drive, delayed like the sensor, N
CARRIED = 5  # its average, N
READ = 6  # average of the axial force by the sensor, N
FEED_SIZE = 7

PERIOD_STEPS = 4  # periods of the drive in a period of the checks that do not need its current


class SelfCheck(LeafSystem):
    """
    .. pydrake_system::

        name: SelfCheck
        input_ports:
        - wrench
        - depth
        - current
        - travel
        - pitch_shaft
        - yaw_shaft
        output_ports:
        - fault

    *Tare.* While the tip is above the rim of the hole, the mean of `TARE_SAMPLES` readings must be within `SIGMAS` of
    the bias and drift of the data sheet, else the sensor is biased; the differences of successive readings must have
    at most `NOISE_FACTOR` times its noise, else it is too noisy.

    *First touch.* One contact with the chamfer at the place c carries the force f and the moment m = c x f. It pushes
    the peg inward, so that the lateral parts satisfy m_y f_x - m_x f_y > 0. If the opposite holds for `CROSSED_TIME` of
    the first `TOUCH_TIME` of contact, axes are swapped or have a wrong sign. A peg that first touches deeper in the
    hole may have two contacts at once, and is not judged.

    *Feed drive.* The drive gives a second measurement of the axial contact force. From the moving parts' momentum,

        f = (m + J N^2) dv/dt + m g + c v - N (eta k_t i - b w - tau_c tanh(w/w_0)),

    with the speed v of the shaft's encoder and w = N v. Both forces are averaged over `AVERAGING`, f with the sensor's
    delay. The current changes within a period of the drive, so that this check follows each. They must agree within
    twice the dry friction N tau_c, the bias and `GAIN_ERROR`. Else the sign of the sensor is wrong, it reads too little
    (or too late), or too much. A blocked feed also shows a force that the sensor does not read; only in free air is it
    told from the sensor, as a stalled motor.

    *Steppers.* A stepper that rests is a magnetic spring: its encoder shows the torque K (commanded - measured angle),
    which holds the moment of the contact about the axis, m_x + d f_y about pitch and m_y - d f_x about yaw, at the
    depth d. They must agree within the unknown height of the axes, the resolution and `GAIN_ERROR`. Else the sensor is
    wrong; or, if the stepper lags by half a step and the sensor shows half of that torque or less, the stepper sticks.

    ``fault`` (`Fault`) is the first fault and stays. ``wrench`` (N, N m) is about the tip in P, ``travel`` and
    ``depth`` in m, a ``shaft`` is [commanded, measured] angle, rad.
    """

    def __init__(
        self,
        *,
        sensor: WrenchSensorParameters,
        motor: DcMotorParameters,
        stepper: StepperMotorParameters,
        parts: MovingParts,
        drive_period: float,
    ) -> None:
        super().__init__()
        self._motor, self._parts = motor, parts
        self._drive_period, self._period = drive_period, PERIOD_STEPS * drive_period
        self._delay = sensor.delay
        self._inertia = parts.mass + motor.reflected_mass
        self._dry_friction = motor.ratio * motor.coulomb_friction
        self._stiffness = stepper.stiffness
        # A smaller lag than half a step may be that of a small load.
        self._sticking_torque = 0.45 * stepper.stiffness * stepper.step_angle
        # A reading is half a sample old on average.
        lag = sensor.delay + 0.5 * sensor.period + sensor.time_constant
        self._settling = sensor.delay + SETTLING * sensor.time_constant
        self._follow_lag = 1.0 - math.exp(-drive_period / lag)
        self._average = 1.0 - math.exp(-drive_period / AVERAGING)
        force, moment = reading_deviation(sensor)
        lever = sensor.height
        self._max_square = 2.0 * np.repeat([NOISE_FACTOR * force, NOISE_FACTOR * moment], 3) ** 2
        # The drive accelerates the peg below the sensor, at most from one direction to the other.
        self._max_square[2] += (2.0 * parts.peg_mass * motor.acceleration(parts.mass)) ** 2
        self._bias = SIGMAS * np.repeat(
            [sensor.force_bias, math.hypot(sensor.torque_bias, lever * sensor.force_bias)], 3
        )
        self._bias += np.repeat([force, moment], 3)
        # A tare lasts for TARE_SAMPLES periods, in which the speed of the peg may change from full to reverse.
        self._bias[2] += 2.0 * parts.peg_mass * parts.top_speed / (TARE_SAMPLES * self._period)
        self._drift = SIGMAS * np.repeat(
            [sensor.force_drift, math.hypot(sensor.torque_drift, lever * sensor.force_drift)], 3
        )
        self._axial_bias = 2.0 * self._dry_friction + float(self._bias[2])
        self._axial_drift = float(self._drift[2])
        self._torque_bias = stepper.stiffness * stepper.encoder_resolution + float(self._bias[3])
        self._touch_moment = max(TOUCH_MOMENT, sensor.torque_quantum + lever * sensor.force_quantum)
        self._untared_moment = self._touch_moment + float(self._bias[3])
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._depth = self.DeclareVectorInputPort("depth", 1)
        self._current = self.DeclareVectorInputPort("current", 1)
        self._travel = self.DeclareVectorInputPort("travel", 1)
        self._shafts = [self.DeclareVectorInputPort(f"{name}_shaft", 2) for name in AXES]
        self._state = self.DeclareDiscreteState(np.zeros(SIZE))
        self._feed_state = self.DeclareDiscreteState(np.zeros(FEED_SIZE))
        self.DeclarePeriodicDiscreteUpdateEvent(self._period, 0.0, self._update)
        self.DeclarePeriodicDiscreteUpdateEvent(drive_period, 0.0, self._update_feed)
        states = {self.discrete_state_ticket(state) for state in (self._state, self._feed_state)}
        self.DeclareVectorOutputPort("fault", 1, self._calc_fault, states)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        state = context.get_discrete_state(self._state).value().tolist()
        if state[FAULT] != Fault.NONE:
            return
        wrench, depth = self._wrench.Eval(context).tolist(), self._depth.Eval(context).item()
        fault = (
            self._tare(state, wrench, depth, context.get_time())
            or self._one_contact(state, wrench, depth)
            or self._against_stepper(context, state, wrench, depth, 0)
            or self._against_stepper(context, state, wrench, depth, 1)
        )
        state[FAULT] = float(fault)
        discrete_state.set_value(self._state, state)

    def _update_feed(self, context: Context, discrete_state: DiscreteValues) -> None:
        state = context.get_discrete_state(self._feed_state).value().tolist()
        if state[FAULT] != Fault.NONE:
            return
        state[FAULT] = float(self._against_feed(context, state, float(self._wrench.Eval(context)[2])))
        discrete_state.set_value(self._feed_state, state)

    def _tare(self, state: list[float], wrench: list[float], depth: float, time: float) -> Fault:
        """Judges the readings in free air."""
        if depth > -self._parts.rim:
            state[FREE] = state[COUNT] = 0.0
            return Fault.NONE
        state[FREE] += self._period
        if state[FREE] <= self._settling:
            return Fault.NONE
        reading = np.array(wrench)
        total, squares = np.array(state[SUM : SUM + 6]), np.array(state[SQUARES : SQUARES + 6])
        if state[COUNT] == 0.0:
            total, squares = reading, np.zeros(6)
        else:
            total, squares = total + reading, squares + (reading - np.array(state[READING : READING + 6])) ** 2
        state[COUNT] += 1.0
        state[READING:TARED] = [*wrench, *total, *squares]
        if state[COUNT] < TARE_SAMPLES:
            return Fault.NONE
        state[COUNT] = 0.0
        state[TARED:] = [1.0, total[3] / TARE_SAMPLES, total[4] / TARE_SAMPLES]
        if (squares > (TARE_SAMPLES - 1) * self._max_square).any():
            return Fault.SENSOR_NOISY
        if (np.abs(total) > TARE_SAMPLES * (self._bias + self._drift * math.sqrt(time))).any():
            return Fault.SENSOR_BIASED
        return Fault.NONE

    def _one_contact(self, state: list[float], wrench: list[float], depth: float) -> Fault:
        """Compares lateral force and moment at the first touch, where one contact carries both."""
        fx, fy, fz, mx, my, _ = wrench
        force = math.hypot(fx, fy)
        if force < TOUCH_FORCE or state[TOUCHED] > TOUCH_TIME:
            return Fault.NONE
        state[TOUCHED] += self._period
        if depth > self._parts.touch_depth:
            return Fault.NONE
        outward = (mx - state[TARE]) * fy - (my - state[TARE + 1]) * fx
        crossed = abs(fz) < FLAT * force and outward > force * (
            self._touch_moment if state[TARED] else self._untared_moment
        )
        state[CROSSED] = state[CROSSED] + self._period if crossed else 0.0
        return Fault.SENSOR_CROSSED if state[CROSSED] > CROSSED_TIME else Fault.NONE

    def _against_feed(self, context: Context, state: list[float], reading: float) -> Fault:
        """Compares the axial force with that of the feed drive."""
        travel, current = self._travel.Eval(context).item(), self._current.Eval(context).item()
        if not state[STARTED]:
            state[STARTED], state[TRAVEL] = 1.0, travel
            return Fault.NONE
        speed = (travel - state[TRAVEL]) / self._drive_period
        force = self.axial_force(current, speed, (speed - state[SPEED]) / self._drive_period)
        state[TRAVEL], state[SPEED] = travel, speed
        state[LAGGED] += self._follow_lag * (force - state[LAGGED])
        state[CARRIED] = carried = state[CARRIED] + self._average * (state[LAGGED] - state[CARRIED])
        state[READ] = read = state[READ] + self._average * (reading - state[READ])
        time = context.get_time()
        if time < self._settling + 2.0 * AVERAGING:  # the drive takes up the weight
            return Fault.NONE
        bound = self._axial_bias + self._axial_drift * math.sqrt(time) + GAIN_ERROR * max(abs(read), abs(carried))
        if abs(read - carried) <= bound:
            return Fault.NONE
        if read * carried < 0.0 and min(abs(read), abs(carried)) > self._dry_friction:
            return Fault.SENSOR_REVERSED
        if abs(read) > abs(carried):
            return Fault.SENSOR_HIGH
        in_free_air = context.get_discrete_state(self._state).value()[FREE] > 0.0
        return Fault.MOTOR_STALLED if in_free_air else Fault.SENSOR_LOW

    def axial_force(self, current: float, speed: float, acceleration: float) -> float:
        """Returns the axial contact force (N) that the feed drive carries; speed in m/s, acceleration in m/s^2."""
        p, w = self._motor, self._motor.ratio * speed
        friction = p.viscous_friction * w + p.coulomb_friction * math.tanh(w / FRICTION_SPEED)
        drive = p.ratio * (p.screw_efficiency * p.torque_constant * current - friction)
        return self._inertia * acceleration + self._parts.mass * GRAVITY + self._parts.friction * speed - drive

    def _against_stepper(
        self, context: Context, state: list[float], wrench: list[float], depth: float, axis: int
    ) -> Fault:
        """Compares the moment about an axis with the torque of its stepper."""
        commanded, measured = self._shafts[axis].Eval(context).tolist()
        changed = commanded != state[COMMANDED + axis]
        state[COMMANDED + axis] = commanded
        state[REST + axis] = 0.0 if changed else state[REST + axis] + self._period
        if state[REST + axis] < RESTING + self._delay:
            state[CONTRADICTED + axis] = 0.0
            return Fault.NONE
        torque = self._stiffness * (commanded - measured)
        fx, fy, _, mx, my, _ = wrench
        moment = my - depth * fx if axis else mx + depth * fy
        bound = self._torque_bias + self._parts.pivot_error * math.hypot(fx, fy)
        bound += GAIN_ERROR * max(abs(torque), abs(moment))
        contradicted = abs(torque - moment) > bound
        state[CONTRADICTED + axis] = state[CONTRADICTED + axis] + self._period if contradicted else 0.0
        if state[CONTRADICTED + axis] <= PATIENCE + self._delay:
            return Fault.NONE
        if abs(torque) > self._sticking_torque and abs(moment) < 0.5 * abs(torque):
            return Fault.YAW_STICKS if axis else Fault.PITCH_STICKS
        return Fault.SENSOR_MOMENT

    def _calc_fault(self, context: Context, output: BasicVector) -> None:
        own, feed = (context.get_discrete_state(state).value()[FAULT] for state in (self._state, self._feed_state))
        output[0] = own or feed
