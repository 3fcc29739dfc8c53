"""The tree of parameters of a scenario, in SI units, with their defaults and limits (see `models.scenario`)."""

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from models.arm import RIG, ArmParameters
from models.control import ControllerParameters
from models.hardware import DcMotorParameters, RigParameters, StepperMotorParameters, WrenchSensorParameters
from models.meshes import MAX_FACETS
from models.operator import OperatorParameters
from models.section import ROUND
from models.validation import PERIODS, TIME_LIMITS, limited

if TYPE_CHECKING:
    from models.assembly import Assembly

ENGINES = ("drake", "exact")
"""Engines of the contact: Drake's hydroelastic meshes, and rigid bodies in closed form."""

APPROXIMATIONS = ("lagged", "similar", "sap")
"""Drake's discrete contact approximations that a scenario may name; "tamsi" is deprecated."""

FREE_FIXTURE, RIG_FIXTURE, AXIAL_FIXTURE = FIXTURES = ("free", "rig", "axial")
"""Names of the virtual fixtures: six degrees of freedom, those of the rig, or one (see `virtual_fixture`)."""

MIN_TIME_STEP = 1e-5
"""Shortest step of the simulation, s; below it, hours of computing time pass within a second."""

MAX_OFFSET = 0.9
"""Largest offset of the start, m."""

FREE_FACETS = 64
"""Default number of facets of a scenario file with the fixture `free`, in which the peg may rotate about its axis."""


@dataclass
class Geometry:
    """Shape and sizes of the peg and the hole, and the resolution of their meshes."""

    section: str = ROUND  # one of models.section.NAMES
    # Of a polygon, which then replaces the name: rows (x, y, radius), counter-clockwise, in units of the peg's radius.
    corners: list[list[float]] = field(default_factory=list)
    # Sections that mate at once, which then replace the one on the axis: rows (x, y, radius, height of the tip above
    # the lowest one, depth of the mouth below the top of the block), in units of m; see models.assembly.
    mates: list[list[float]] = field(default_factory=list)
    # In units of m; of a circle, or half of the width between the sides that are nearest to the axis.
    peg_radius: float = limited(0.010, low=1e-4, high=1.0)
    peg_length: float = limited(0.060, low=1e-4, high=10.0)  # in units of m
    hole_radius: float = limited(0.01005, low=1e-4, high=1.0)  # in units of m; likewise
    hole_depth: float = limited(0.025, low=1e-4, high=10.0)  # in units of m
    chamfer: float = limited(0.0005, low=0.0)  # in units of m, at 45 degrees
    # Of the bore and of the peg; this and much else follows the geometry in a file (models.clearance).
    facets: int = limited(32, low=3, high=MAX_FACETS)
    block_radius: float = limited(0.030, low=1e-4, high=10.0)  # in units of m
    floor: float = limited(0.010, low=1e-4, high=10.0)  # in units of m, below the bore

    @property
    def is_round(self) -> bool:
        """Whether peg and hole are one circle each."""
        return self.section == ROUND and not self.corners and not self.mates

    @property
    def assembly(self) -> "Assembly":
        """Peg and hole; raises ValueError if the shape or the mates describe none."""
        from models.assembly import Assembly  # it imports numba, which takes long

        return Assembly.of(self)

    @property
    def reach(self) -> float:
        """Radius of the smallest circle about the axis that holds the peg, m: the lever of the moments in a load."""
        return self.assembly.reach

    @property
    def clearance(self) -> float:
        """Radial clearance R - r, in m."""
        return self.hole_radius - self.peg_radius


@dataclass
class ContactParameters:
    """The contact of peg and bore: the engine that computes it, its laws and its numerics."""

    engine: str = "drake"  # one of ENGINES
    # In units of s; the other engines take several steps of their own in each.
    time_step: float = limited(2e-3, low=MIN_TIME_STEP, high=0.1)
    modulus: float = limited(5.5e11, high=math.inf)  # in units of Pa, of the compliant peg in Drake
    # In units of s/m, Hunt-Crossley; about 0.75 of the speed returns at 20 mm/s.
    dissipation: float = limited(20.0, low=0.0)
    # In units of N/m, of one contact in the exact engine (docs/physics.md).
    stiffness: float = limited(1e8)
    friction: float = limited(0.2, low=0.0)
    # Relative half width of the uniform distribution of the friction.
    friction_spread: float = limited(0.5, low=0.0, high=1.0)
    approximation: str = "lagged"  # of Drake, one of APPROXIMATIONS


@dataclass
class StartParameters:
    """Initial pose of the peg; tilt and offset are drawn from their ranges if they are None."""

    height: float = limited(0.003, high=0.45)  # in units of m, of the tip above the mouth
    # In units of m, of the tip below the mouth; if positive, it replaces the height.
    depth: float = limited(0.0, low=0.0)
    tilt_range: float = limited(math.radians(3.4), low=0.0, high=0.5 * math.pi)  # in units of rad, uniform on each axis
    # In units of rad; wider than in a rig trial.
    demonstrated_tilt_range: float = limited(math.radians(4.0), high=0.5 * math.pi)
    # In units of m, uniform on each axis; has an effect in the `free` fixture only.
    offset_range: float = limited(0.0, low=0.0, high=MAX_OFFSET)
    tilt: list[float] | None = limited(None, signed=True, count=2)  # in units of rad, about x and y of the hole
    # In units of m, along x and y of the hole.
    offset: list[float] | None = limited(None, high=MAX_OFFSET, signed=True, count=2)
    # In units of rad, uniform, of the peg about its axis; has an effect with `rig.clocking_stage` only.
    clocking_range: float = limited(math.radians(3.0), low=0.0, high=0.5)
    clocking: float | None = limited(None, signed=True, high=0.5)  # in units of rad; None: drawn

    @property
    def tip_height(self) -> float:
        """Initial height of the tip above the mouth, in m; negative inside the hole."""
        return -self.depth if self.depth > 0.0 else self.height


@dataclass
class CouplingParameters:
    """The virtual coupling between probe and peg, and the guide of the virtual fixture."""

    stiffness: float = 4000.0  # in units of N/m
    damping: float = limited(180.0, low=0.0)  # in units of N s/m
    angular_stiffness: float = 300.0  # in units of N m/rad
    angular_damping: float = limited(2.4, low=0.0)  # in units of N m s/rad
    guide_stiffness: float = limited(2.0e5, low=0.0)  # in units of N/m
    guide_damping: float = limited(600.0, low=0.0)  # in units of N s/m
    peg_mass: float = 4.0  # in units of kg, of the virtual peg
    peg_inertia: float = 2.0e-2  # in units of kg m^2, about its tip
    force_scale: float = limited(0.2, low=0.0)  # ratio of rendered to virtual force
    torque_scale: float = limited(0.02, low=0.0)  # ratio of rendered to virtual torque


@dataclass
class RecorderParameters:
    """Sampling, time limit and quality limit of a demonstration."""

    period: float = limited(0.02, **PERIODS)  # in units of s
    time_limit: float = limited(8.0, **TIME_LIMITS)  # in units of s
    rough_force: float = 20.0  # in units of N; a demonstration with a larger contact force is bad


@dataclass
class TrialParameters:
    """End of a rig trial."""

    time_limit: float = limited(10.0, **TIME_LIMITS)  # in units of s
    # In units of m; largest distance from the bottom that counts as inserted.
    full_depth_margin: float = limited(0.3e-3, low=0.0)


@dataclass
class Scenario:
    """All parameters of a run."""

    seed: int = limited(0, low=0, high=2**63 - 1)
    geometry: Geometry = field(default_factory=Geometry)
    contact: ContactParameters = field(default_factory=ContactParameters)
    start: StartParameters = field(default_factory=StartParameters)
    device: str = "paper"  # a key of DEVICE_PRESETS
    coupling: CouplingParameters = field(default_factory=CouplingParameters)
    fixture: str = RIG_FIXTURE  # one of FIXTURES
    carrier: str = RIG  # one of models.arm.CARRIERS: what performs the skill
    operator: OperatorParameters = field(default_factory=OperatorParameters)
    recorder: RecorderParameters = field(default_factory=RecorderParameters)
    rig: RigParameters = field(default_factory=RigParameters)
    arm: ArmParameters = field(default_factory=ArmParameters)
    stepper: StepperMotorParameters = field(default_factory=StepperMotorParameters)
    feed: DcMotorParameters = field(default_factory=DcMotorParameters)
    sensor: WrenchSensorParameters = field(default_factory=WrenchSensorParameters)
    controller: ControllerParameters = field(default_factory=ControllerParameters)
    trial: TrialParameters = field(default_factory=TrialParameters)

    @property
    def full_depth(self) -> float:
        """Depth at which the peg counts as inserted, m."""
        return self.geometry.hole_depth - self.trial.full_depth_margin
