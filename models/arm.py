"""Defines the parameters of an arm that carries the peg, in SI units."""

from dataclasses import dataclass

from models.validation import limited

RIG, FR3, UR5E = CARRIERS = ("rig", "fr3", "ur5e")
"""What carries peg and hole: the rig, which turns the hole, or an arm, which turns the peg over a fixed hole."""


@dataclass
class ArmParameters:
    """An arm under position control, with a remote centre compliance between its sensor and the peg.

    The centre of the compliance is at the tip of the peg. Stiffnesses are of the order of the devices of Whitney
    (1982), 20 to 100 N/mm across and much stiffer along the axis [choice].
    """

    # In units of m, of the centre of the mouth in the frame of the arm's base; the hole opens upwards.
    hole: list[float] = limited([0.5, 0.0, 0.1], signed=True, high=2.0)
    # In units of m; half width of the uniform distributions along x and y of where the hole is beside where one
    # believes it to be.
    hole_offset_range: float = limited(0.0, low=0.0, high=0.01)
    hole_offset: list[float] | None = limited(None, signed=True, count=2, high=0.01)  # in units of m; None: drawn
    lateral_stiffness: float = 5.0e4  # in units of N/m
    axial_stiffness: float = 5.0e5  # in units of N/m
    cocking_stiffness: float = 400.0  # in units of N m/rad, about x and y
    torsional_stiffness: float = 400.0  # in units of N m/rad, about the axis
    damping_ratio: float = limited(0.3, low=0.0, high=2.0)
    held_mass: float = 0.15  # in units of kg, below the sensor besides the peg
    held_inertia: float = 1.2e-3  # in units of kg m^2, of peg and holder about the tip
    joint_stiffness: float = 14250.0  # in units of N m/rad, the largest joint impedance of libfranka
    # Of a Cartesian impedance of the flange instead of held joints, in units of N/m and N m/rad; through a protocol.
    impedance: list[float] | None = limited(None, count=2)
    joint_damping: float = limited(1.0, low=0.0)  # damping ratio of a joint with the arm beyond it
    gravity_error: float = limited(0.01, low=0.0, high=1.0)  # relative error of the compensation of gravity
    max_speed: float = 0.25  # in units of m/s, of the tip
    max_acceleration: float = 5.0  # in units of m/s^2, of the tip, with which a command stops
    delay: float = limited(2.0e-3, low=0.0, high=0.1)  # in units of s, from a command to the motors
    # How the tip yields to a lateral force at the mouth; see `systems.arm.tip`.
    yield_softness: float = limited(1.0e-3, low=0.0)  # in units of m/s/N
    yield_threshold: float = limited(0.5, low=0.0)  # in units of N
    yield_speed: float = limited(0.01, low=0.0)  # in units of m/s
    yield_reach: float = limited(2.0e-3, low=0.0, high=0.01)  # in units of m
    yield_depth: float = limited(1.0e-3, low=0.0)  # in units of m
    yield_feed: float = limited(1.0e-3, low=0.0)  # in units of m/s, at most, where the tip yields in the hole
    depth_resolution: float = 1.0e-6  # in units of m, of the depth by forward kinematics
