"""Defines the hardware parameters in SI units, each with its source, and the presets of the haptic devices.

Sources: [paper] the source paper; [driver] defaults published for the device in open haptics frameworks; [sheet] a
manufacturer's data sheet; [maker] tutorials 05 and 06 of the Inverse Service 3.5 at docs.haply.co; [seller] the figures
of the Inverse3 that a seller of it publishes; [choice] chosen here for a plausible laboratory rig.
"""

import math
from dataclasses import dataclass

from models.validation import limited


@dataclass
class HapticDeviceParameters:
    """A six-degree-of-freedom force-feedback device (defaults: the paper's PHANToM Premium 1.5)."""

    name: str = "paper"
    workspace_radius: float = 0.10  # in units of m [driver]
    position_resolution: float = 0.03e-3  # in units of m [sheet]
    angle_resolution: float = 5.0e-5  # in units of rad [choice]
    peak_force: float = 22.0  # in units of N [paper]
    sustained_force: float = 3.0  # in units of N [paper]
    peak_torque: float = 0.670  # in units of N m; zero: the device has no motors that turn the hand [paper]
    sustained_torque: float = 0.104  # in units of N m [paper]
    thermal_time_constant: float = 10.0  # in units of s; averaging time of the sustained limit [choice]
    servo_period: float = 1e-3  # in units of s [sheet]
    delay: float = 0.0  # in units of s, of the force beyond the servo's tick, whole periods [choice]
    # Damping of the device and the gripping hand, and friction of the device; the stability margins depend on them.
    grip_damping: float = 10.0  # in units of N s/m [choice]
    grip_angular_damping: float = 0.02  # in units of N m s/rad [choice]
    friction_force: float = 0.04  # in units of N [choice]
    friction_torque: float = 1e-3  # in units of N m [choice]
    # Maximum gains that the device's driver accepts; infinite where no limit is published.
    max_stiffness: float = math.inf  # in units of N/m
    max_damping: float = math.inf  # in units of N s/m
    max_angular_stiffness: float = math.inf  # in units of N m/rad
    max_angular_damping: float = math.inf  # in units of N m s/rad


DEVICE_PRESETS: dict[str, HapticDeviceParameters] = {
    "paper": HapticDeviceParameters(),
    "premium_1_5_6dof": HapticDeviceParameters(
        name="premium_1_5_6dof",
        peak_force=4.0,  # [driver]
        sustained_force=3.0,  # [paper]
        peak_torque=0.188,  # [driver]
        sustained_torque=0.104,  # [paper]
        max_stiffness=800.0,  # [driver]
        max_damping=5.0,  # [driver]
        max_angular_stiffness=0.3,  # [driver]
        max_angular_damping=0.004,  # [driver]
    ),
    "inverse3": HapticDeviceParameters(
        name="inverse3",
        workspace_radius=0.10,  # a sphere within 510 x 460 x 230 mm [maker]
        position_resolution=0.01e-3,  # [seller]
        peak_force=10.0,  # [seller]
        sustained_force=4.0,  # the maximum within 80 % of the workspace [seller]
        peak_torque=0.0,
        sustained_torque=0.0,
        delay=1e-3,  # of the service and USB [choice]
        max_stiffness=1000.0,  # [seller]
    ),
}


STEEL = 7850.0  # in units of kg/m^3, of the peg
GRAVITY = 9.81  # in units of m/s^2


@dataclass
class StepperMotorParameters:
    """A hybrid stepper motor with a reduction gear, described at the gear's output; it holds like a magnetic spring."""

    step_angle: float = math.radians(0.18)  # in units of rad, of a full step [paper]
    microsteps: int = 8  # positions of the driver in a full step [choice]
    # The current of the driver sets it. A step against a jammed peg changes the load by up to (pi/2) T_h / microsteps
    # / peg radius, so that a motor stronger than its task makes a cap of the load impossible.
    # The pull-out torque at rest; at max_step_rate the rotor is pulled out by at least 0.8 of it.
    holding_torque: float = 0.5  # in units of N m, at the output [choice]
    damping: float = limited(0.75, low=0.0)  # in units of N m s/rad [choice]
    reflected_inertia: float = 1.0e-3  # in units of kg m^2 [choice]
    max_step_rate: float = 250.0  # in units of steps/s [choice]
    max_step_acceleration: float = 8.0e3  # in units of steps/s^2; needs a tenth of the holding torque [choice]
    # A closed-loop drive: 10,000 counts per turn of the motor, at the output of the gear of ten.
    encoder_resolution: float = 2.0 * math.pi / 1.0e5  # in units of rad, at the output [choice]

    @property
    def stiffness(self) -> float:
        """Stiffness (pi/2) T_h / step of the magnetic spring at small angles, N m/rad; a step is a quarter period."""
        return 0.5 * math.pi * self.holding_torque / self.step_angle


@dataclass
class DcMotorParameters:
    """A small DC motor on a lead screw, with a speed controller and a current limit."""

    resistance: float = 2.3  # in units of ohm [choice]
    inductance: float = 0.24e-3  # in units of H [choice]
    torque_constant: float = 0.0235  # in units of N m/A, and V s/rad [choice]
    rotor_inertia: float = 1.0e-6  # in units of kg m^2 [choice]
    viscous_friction: float = limited(2.0e-6, low=0.0)  # in units of N m s/rad [choice]
    coulomb_friction: float = limited(1.0e-3, low=0.0)  # in units of N m [choice]
    screw_lead: float = 5.0e-3  # in units of m/turn [choice]
    screw_efficiency: float = 0.85  # forward, ball screw [choice]
    supply_voltage: float = 12.0  # in units of V [choice]
    current_limit: float = 1.0  # in units of A [choice]
    speed_kp: float = 0.05  # in units of V s/rad [choice]
    speed_ki: float = limited(2.0, low=0.0)  # in units of V/rad [choice]
    encoder_counts: int = 2000  # counts per turn of the encoder on the shaft, which measures the speed [choice]

    @property
    def ratio(self) -> float:
        """Ratio of motor angle to carriage travel, rad/m."""
        return 2.0 * math.pi / self.screw_lead

    @property
    def force_constant(self) -> float:
        """Ratio of force on the carriage to current, without friction, N/A."""
        return self.ratio * self.screw_efficiency * self.torque_constant

    @property
    def reflected_mass(self) -> float:
        """Mass J N^2 by which the rotor adds to that of the carriage, kg."""
        return self.rotor_inertia * self.ratio**2

    def acceleration(self, mass: float) -> float:
        """Acceleration of a ``mass`` (kg) at the current limit, without friction and weight, m/s^2."""
        return self.force_constant * self.current_limit / (mass + self.reflected_mass)

    @property
    def no_load_speed(self) -> float:
        """Speed of the carriage at full voltage without friction, m/s; the motor cannot drive it faster."""
        return self.supply_voltage / (self.torque_constant * self.ratio)


@dataclass
class WrenchSensorParameters:
    """A six-axis force/torque sensor of the Mini45 class."""

    force_range: list[float] = limited([145.0, 145.0, 290.0], count=3)  # N [sheet]
    torque_range: list[float] = limited([5.0, 5.0, 5.0], count=3)  # N m [sheet]
    force_noise: list[float] = limited([0.02, 0.02, 0.05], count=3, low=0.0, high=1e3)  # N, standard deviation [sheet]
    torque_noise: list[float] = limited([5e-4, 5e-4, 5e-4], count=3, low=0.0, high=0.2)  # N m [sheet]
    # In units of N; standard deviation of the bias after taring [choice].
    force_bias: float = limited(0.05, low=0.0, high=1e3)
    # In units of N m; standard deviation of the bias after taring [choice].
    torque_bias: float = limited(1e-3, low=0.0, high=0.2)
    # The bias drifts, mostly with temperature, as a random walk: 0.06 N and 1.3 mN m within 10 s.
    # In units of N/sqrt(s); standard deviation of the walk after 1 s [choice].
    force_drift: float = limited(0.02, low=0.0, high=10.0)
    torque_drift: float = limited(4e-4, low=0.0, high=5e-3)  # in units of N m/sqrt(s) [choice]
    force_quantum: float = 1.0 / 16.0  # in units of N [sheet]
    torque_quantum: float = 1.0 / 752.0  # in units of N m [sheet]
    bandwidth: float = 100.0  # in units of Hz; first-order low-pass [choice]
    period: float = limited(1e-3, low=1e-5, high=1.0)  # in units of s [choice]
    # In units of s, whole periods; of conversion and network, without the low-pass [choice].
    delay: float = limited(2e-3, low=0.0, high=10.0)
    height: float = limited(0.080, high=1.0)  # in units of m, of the sensor above the peg's tip [choice]

    @property
    def time_constant(self) -> float:
        """Time constant of the low-pass, s."""
        return 1.0 / (2.0 * math.pi * self.bandwidth)

    @property
    def blend(self) -> float:
        """Part of a step that the low-pass passes within a period."""
        return 1.0 - math.exp(-2.0 * math.pi * self.bandwidth * self.period)


@dataclass
class RigParameters:
    """Mechanics of the 3-DOF rig."""

    # Whether a third stepper under the block turns it about the hole's axis, for parts that are not round [choice].
    clocking_stage: bool = False
    # In units of m, of the gimbal's axes above the mouth; None: drawn [choice].
    pivot_height: float | None = limited(None, signed=True)
    # In units of m; half width of the uniform distribution of the pivot height [choice].
    pivot_range: float = limited(0.003, low=0.0)
    # In units of m; the same in demonstrations, a wider one [choice].
    demonstrated_pivot_range: float = limited(0.005, low=0.0)
    carriage_friction: float = limited(5.0, low=0.0)  # in units of N s/m, viscous [choice]
    mount_stiffness: float = 2.0e5  # in units of N/m, lateral, of the compliant mount that carries the peg [choice]
    mount_damping: float = limited(100.0, low=0.0)  # in units of N s/m, lateral [choice]
    encoder_resolution: float = 5.0e-6  # in units of m [choice]
