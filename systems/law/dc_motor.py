"""The feed drive: a DC motor on a lead screw, with a PI speed controller and a current limit."""

from __future__ import annotations

import math
from operator import itemgetter
from typing import Any, NamedTuple, Self

import numpy as np

from compiled import compiled, numbers_class
from models.hardware import DcMotorParameters
from skill.arrays import Array
from systems.law.part import Part

FRICTION_SPEED = 2.0  # in units of rad/s; scale of the tanh that smooths Coulomb friction

CURRENT, INTEGRAL, SIZE = range(3)
"""Places in the state: current (A) and integral of the speed error (rad); and its size."""


MotorNumbers = numbers_class("MotorNumbers", DcMotorParameters, __name__)
"""`models.hardware.DcMotorParameters` for compiled functions."""


class Drive(NamedTuple):
    """A feed drive.

    Attributes:
        period: T of the speed controller, s.
        ratio: N of motor angle to carriage travel, rad/m.
        decay: e^{-RT/L}.
        gain: R / (1 - e^{-RT/L}), ohm.
        count_travel: travel of a count of the encoder on the shaft, m.
        motor: `models.hardware.DcMotorParameters`.
    """

    period: float
    ratio: float
    decay: float
    gain: float
    count_travel: float
    motor: Any

    @classmethod
    def of(cls, p: DcMotorParameters, *, period: float) -> Self:
        """Returns the drive with a period, s, of its speed controller."""
        decay = math.exp(-p.resistance * period / p.inductance)
        gain = p.resistance / (1.0 - decay)
        return cls(period, p.ratio, decay, gain, p.screw_lead / p.encoder_counts, MotorNumbers(*vars(p).values()))


@compiled
def dc_motor_step(p: Drive, state: Array, speed_command: float, speed: float, enabled: bool) -> Array:
    """Returns the next state (SIZE,).

    Let w = N v be the motor's speed and w* = N v* its command. In a period T,

        u = k_p (w* - w) + k_i integral(w* - w) + k_e w*,      |u| <= supply voltage,
        i+ = i e^{-RT/L} + (u - k_e w)/R (1 - e^{-RT/L}),      |i+| <= i_max  (u is limited to ensure this),

    which is the exact solution of L di/dt = u - R i - k_e w over one period. The integral is frozen while a limit is
    active and the error would drive the voltage further beyond it. Where the drive is not enabled, a relay disconnects
    the motor from its controller and joins its terminals: u = 0, the current -k_e w/R brakes the rotor, and the
    integral is cleared.

    Args:
        p: the drive.
        state: (SIZE,), after the last period.
        speed_command: v*, m/s.
        speed: v of the carriage, m/s.
        enabled: whether the drive is on.
    """
    found, m = np.empty(SIZE), p.motor
    current, integral, w = state[CURRENT], state[INTEGRAL], p.ratio * speed
    if not enabled:
        found[CURRENT] = current * p.decay - m.torque_constant * w / m.resistance * (1.0 - p.decay)
        found[INTEGRAL] = 0.0
        return found
    command = p.ratio * speed_command
    error = command - w
    voltage = m.speed_kp * error + m.speed_ki * integral + m.torque_constant * command
    back_emf = m.torque_constant * w
    # The voltages after which the current is at its limits.
    minimum = max(-m.supply_voltage, back_emf + p.gain * (-m.current_limit - current * p.decay))
    maximum = min(m.supply_voltage, back_emf + p.gain * (m.current_limit - current * p.decay))
    applied = min(max(voltage, minimum), maximum)
    saturated = applied != voltage and (voltage - applied) * error > 0
    found[INTEGRAL] = integral if saturated else integral + error * p.period
    found[CURRENT] = current * p.decay + (applied - back_emf) / p.gain
    return found


@compiled
def carriage_force(p: Drive, current: float, speed: float) -> float:
    """Returns the force (N) on the carriage at a current (A) and speed (m/s).

    F = N (eta k_t i - b w - tau_c tanh(w / w_0)).
    """
    w, m = p.ratio * speed, p.motor
    friction = m.viscous_friction * w + m.coulomb_friction * math.tanh(w / FRICTION_SPEED)
    return float(p.ratio * (m.screw_efficiency * m.torque_constant * current - friction))


@compiled
def counted_travel(p: Drive, position: float) -> float:
    """Returns the position (m) of the carriage as the encoder on the shaft counts it."""
    return round(position / p.count_travel) * p.count_travel


class DcMotor(Part):
    """
    .. pydrake_system::

        name: DcMotor
        input_ports:
        - speed_command
        - carriage_state
        - enabled
        output_ports:
        - carriage_force
        - current
        - travel

    The drive of `dc_motor_step`. The plant's joint actuator models the rotor's inertia. ``speed_command`` is in m/s,
    ``carriage_state`` is [position, velocity] in m, m/s, ``carriage_force`` is in N and ``current`` in A. While
    ``enabled`` is 0 a relay joins the motor's terminals, whatever the controller does. ``travel`` is the position of
    the carriage (m, upwards) as the encoder on the motor's shaft counts it.

    Args:
        parameters: Parameters of the motor.
        period: Period T of the speed controller, s.
    """

    def __init__(self, *, parameters: DcMotorParameters, period: float) -> None:
        drive = Drive.of(parameters, period=period)

        def step(state: Array, speed_command: float, carriage: Array, enabled: float) -> Array:
            return dc_motor_step(drive, state, speed_command, carriage[1], enabled != 0.0)

        inputs = {"speed_command": 1, "carriage_state": 2, "enabled": 1}
        super().__init__(inputs, state=np.zeros(SIZE), period=period, step=step)
        self.declare_output(
            "carriage_force",
            1,
            lambda state, carriage: carriage_force(drive, state[CURRENT], carriage[1]),
            "carriage_state",
        )
        self.declare_output("current", 1, itemgetter(CURRENT))
        self.declare_output("travel", 1, lambda state, carriage: counted_travel(drive, carriage[0]), "carriage_state")
