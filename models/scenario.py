"""Defines the scenario, the configuration tree of a run, in SI units; reads, checks, writes and resolves it.

A scenario contains ranges. A seed *resolves* it into a concrete scenario, which is stored with every result, so that
any demonstration or rig trial can be repeated from its own record.
"""

import copy
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import yaml
from pydrake.common.yaml import yaml_dump_typed, yaml_load_typed

from models.bore import MAX_FACETS, minimum_clearance
from models.contact_checks import facet_violations, softness_violations
from models.contact_theory import largest_entry_tilt
from models.document import read_document, read_text
from models.hardware import (
    DEVICE_PRESETS,
    DcMotorParameters,
    RigParameters,
    StepperMotorParameters,
    WrenchSensorParameters,
)
from models.hardware_checks import guard_violations, is_multiple, sensor_violations, stall_violations
from models.operator import HABITS, OperatorParameters, draw_person
from models.validation import Violation, check_document, number_violations, raise_first

SCENARIO_FOLDER = Path(__file__).parent / "scenarios"
APPROXIMATIONS = ("lagged", "similar", "sap")
"""Drake's discrete contact approximations that a scenario may name; "tamsi" is deprecated."""

FREE_FIXTURE, RIG_FIXTURE, AXIAL_FIXTURE = FIXTURES = ("free", "rig", "axial")
"""Names of the virtual fixtures: six degrees of freedom, those of the rig, or one (see `virtual_fixture`)."""

FREE_FACETS = 64
"""Default number of facets of a scenario file with the fixture `free`, in which the peg may rotate about its axis."""


@dataclass
class Geometry:
    """Sizes of the peg and the hole, and the resolution of their meshes."""

    peg_radius: float = 0.010  # in units of m
    peg_length: float = 0.060  # in units of m
    hole_radius: float = 0.01005  # in units of m
    hole_depth: float = 0.025  # in units of m
    chamfer: float = 0.0005  # in units of m, at 45 degrees
    facets: int = 32  # of the bore and of the peg; a file with the fixture `free` has FREE_FACETS by default
    block_radius: float = 0.030  # in units of m
    floor: float = 0.010  # in units of m, below the bore

    @property
    def clearance(self) -> float:
        """Radial clearance R - r, in m."""
        return self.hole_radius - self.peg_radius


@dataclass
class ContactParameters:
    """The hydroelastic contact model."""

    time_step: float = 2e-3  # in units of s
    modulus: float = 5.5e11  # in units of Pa, of the compliant peg
    dissipation: float = 20.0  # in units of s/m, Hunt-Crossley; about 0.75 of the speed returns at 20 mm/s
    friction: float = 0.2
    friction_spread: float = 0.5  # relative half width of the uniform distribution of the friction
    approximation: str = "lagged"  # one of APPROXIMATIONS


@dataclass
class StartParameters:
    """Initial pose of the peg; tilt and offset are drawn from their ranges if they are None."""

    height: float = 0.003  # in units of m, of the tip above the mouth
    depth: float = 0.0  # in units of m, of the tip below the mouth; if positive, it replaces the height
    tilt_range: float = math.radians(3.4)  # in units of rad, uniform on each axis
    demonstrated_tilt_range: float = math.radians(4.0)  # in units of rad; wider than in a rig trial
    offset_range: float = 0.0  # in units of m, uniform on each axis; has an effect in the `free` fixture only
    tilt: list[float] | None = None  # in units of rad, about x and y of the hole
    offset: list[float] | None = None  # in units of m, along x and y of the hole

    @property
    def tip_height(self) -> float:
        """Initial height of the tip above the mouth, in m; negative inside the hole."""
        return -self.depth if self.depth > 0.0 else self.height


@dataclass
class CouplingParameters:
    """The virtual coupling between probe and peg, and the guide of the virtual fixture."""

    stiffness: float = 4000.0  # in units of N/m
    damping: float = 180.0  # in units of N s/m
    angular_stiffness: float = 300.0  # in units of N m/rad
    angular_damping: float = 2.4  # in units of N m s/rad
    guide_stiffness: float = 2.0e5  # in units of N/m
    guide_damping: float = 600.0  # in units of N s/m
    peg_mass: float = 4.0  # in units of kg, of the virtual peg
    peg_inertia: float = 2.0e-2  # in units of kg m^2, about its tip
    force_scale: float = 0.2  # ratio of rendered to virtual force
    torque_scale: float = 0.02  # ratio of rendered to virtual torque


@dataclass
class RecorderParameters:
    """Sampling, time limit and quality limit of a demonstration."""

    period: float = 0.02  # in units of s
    time_limit: float = 8.0  # in units of s
    rough_force: float = 20.0  # in units of N; a demonstration with a larger contact force is bad


@dataclass
class PolicyControllerParameters:
    """Gain and limits of the policy controller."""

    period: float = 0.02  # in units of s
    gain: float = 1.0  # factor on the turns of the policy
    max_turn_rate: float = math.radians(12.0)  # in units of rad/s; impact loads limit it further (`ForceGuard`)
    max_turn: float = math.radians(8.0)  # in units of rad, on each axis, to either side of the start
    max_feed_speed: float = 0.030  # in units of m/s


@dataclass
class ForceGuardParameters:
    """Limits of the force guard. The load is the norm of force and moment / peg radius, in N."""

    # 90 % of the samples of the default good demonstrations stay below 13 N of load, 99 % below 28 N. A skill that
    # pushes harder measures loads that few demonstrations contain.
    soft_force: float = 10.0  # in units of N of load, above which it reduces the feed, to zero halfway to hold_force
    hold_force: float = 20.0  # in units of N of load, at which turns that do not lower it are zero; above, it yields
    force_limit: float = 40.0  # in units of N of load, which the guard is to keep; impact loads count too


@dataclass
class BackOffParameters:
    """When and how far the peg is drawn back to try again."""

    force_limit: float = ForceGuardParameters.force_limit  # in units of N of load, above which the peg is backed off
    retract_speed: float = 0.015  # in units of m/s
    back_off_distance: float = 1.0e-3  # in units of m
    back_off_time: float = 0.4  # in units of s, maximum duration of a back-off
    stall_time: float = 0.6  # in units of s; pushing this long without progress backs the peg off
    stall_depth: float = 0.2e-3  # in units of m; a smaller increase of the depth is no progress
    unknown_feed: float = 0.5  # factor on the feed while the contact state is unknown
    doubt_time: float = 1.0  # in units of s; the peg is backed off if nothing is recognised for this long
    # After a first attempt, turns make it worse if the lateral force grows so over such a turn and time without a gain.
    worse_force: float = 3.0  # in units of N
    worse_turn: float = math.radians(0.3)  # in units of rad
    worse_time: float = 0.2  # in units of s
    worse_depth: float = 0.05e-3  # in units of m; a smaller increase of the depth is no gain
    max_repeats: int = 4  # attempts that end like the one before, after which the policy has nothing new to try


@dataclass
class WatchdogParameters:
    """Detection of a stalled feed, and the retraction after a fault; most keys are shared with the back-off."""

    period: float = PolicyControllerParameters.period  # in units of s
    retract_speed: float = BackOffParameters.retract_speed  # in units of m/s
    back_off_time: float = BackOffParameters.back_off_time  # in units of s, duration of the retraction
    stall_depth: float = BackOffParameters.stall_depth  # in units of m; a smaller change of depth is no motion
    feed_stall_distance: float = 1.0e-3  # in units of m, commanded without motion before the feed counts as stalled
    # The speed loop stops from full feed within 0.3 mm.
    follow_error: float = 0.4e-3  # in units of m, of motion against the command before the feed counts as faulty
    travel_above: float = 0.010  # in units of m, from the start height to the upper limit of the travel
    travel_below: float = 1.0e-3  # in units of m, from the bottom of the hole to the lower limit of the travel


@dataclass
class ControllerParameters(WatchdogParameters, BackOffParameters, ForceGuardParameters, PolicyControllerParameters):
    """All parameters of the control loop, as the flat keys of ``controller:`` in a scenario."""


@dataclass
class TrialParameters:
    """End of a rig trial."""

    time_limit: float = 10.0  # in units of s
    full_depth_margin: float = 0.3e-3  # in units of m; largest distance from the bottom that counts as inserted


@dataclass
class Scenario:
    """All parameters of a run."""

    seed: int = 0
    geometry: Geometry = field(default_factory=Geometry)
    contact: ContactParameters = field(default_factory=ContactParameters)
    start: StartParameters = field(default_factory=StartParameters)
    device: str = "paper"  # a key of DEVICE_PRESETS
    coupling: CouplingParameters = field(default_factory=CouplingParameters)
    fixture: str = RIG_FIXTURE  # one of FIXTURES
    operator: OperatorParameters = field(default_factory=OperatorParameters)
    recorder: RecorderParameters = field(default_factory=RecorderParameters)
    rig: RigParameters = field(default_factory=RigParameters)
    stepper: StepperMotorParameters = field(default_factory=StepperMotorParameters)
    feed: DcMotorParameters = field(default_factory=DcMotorParameters)
    sensor: WrenchSensorParameters = field(default_factory=WrenchSensorParameters)
    controller: ControllerParameters = field(default_factory=ControllerParameters)
    trial: TrialParameters = field(default_factory=TrialParameters)

    @property
    def full_depth(self) -> float:
        """Depth at which the peg counts as inserted, m."""
        return self.geometry.hole_depth - self.trial.full_depth_margin


def load_scenario(name: str | Path = "nominal", *, defaults: Scenario | None = None) -> Scenario:
    """Reads a scenario from a file.

    Args:
        name: Name of a scenario in ``models/scenarios``, or path of a YAML file.
        defaults: Values of the keys that are missing in the file; it is not changed. None: those of `Scenario`.

    Raises:
        ValueError: Naming the file and the problem, e.g. an unknown key, a wrong type or an impossible geometry.
        OSError: If the file cannot be read.
    """
    path = Path(name)
    if path.suffix != ".yaml":
        path = SCENARIO_FOLDER / f"{name}.yaml"
    if not path.is_file():
        known = sorted(p.stem for p in SCENARIO_FOLDER.glob("*.yaml"))
        raise ValueError(f"scenario {path}: no such file; expected a YAML file or one of {known}")
    where = f"scenario {path}"
    return parse_scenario(read_text(path, where), where, defaults=defaults)


def dump_scenario(scenario: Scenario) -> str:
    """Returns the whole tree as YAML text."""
    return str(yaml_dump_typed(scenario, schema=Scenario))


def parse_scenario(text: str, where: str, *, defaults: Scenario | None = None) -> Scenario:
    """Reads a scenario from YAML text; keys that are missing keep their defaults.

    Args:
        text: YAML text.
        where: Name of the source in error messages.
        defaults: See `load_scenario`.

    Raises:
        ValueError: Naming ``where`` and the problem.
    """
    document = read_document(text, where)
    document = {} if document is None else document
    check_document(document, Scenario, where)
    # Drake gets the values as they were read, not the text: it takes 1e10 for a string.
    facets = FREE_FACETS if document.get("fixture") == FREE_FIXTURE else Geometry.facets
    defaults = defaults or Scenario(geometry=Geometry(facets=facets))
    scenario: Scenario = yaml_load_typed(schema=Scenario, data=yaml.safe_dump(document), defaults=defaults)
    validate_scenario(scenario, where)
    return scenario


def validate_scenario(scenario: Scenario, where: str = "scenario") -> None:
    """Checks every value of a scenario.

    Raises:
        ValueError: Naming ``where``, the field, the value found and the values expected.
    """
    raise_first(_violations(scenario), where)


def _violations(scenario: Scenario) -> Iterator[Violation]:
    """Yields the violations in a scenario; a later check may assume that all earlier ones have passed."""
    yield from number_violations(scenario)
    yield from _geometry_violations(scenario.geometry)
    yield from _name_violations(scenario)
    g, spins = scenario.geometry, scenario.fixture == FREE_FIXTURE
    if not scenario.start.depth < g.hole_depth:
        yield Violation("start.depth", f"{scenario.start.depth} m", f"below geometry.hole_depth {g.hole_depth} m")
    yield from facet_violations(facets=g.facets, radius=g.hole_radius, clearance=g.clearance, spins=spins)
    yield from _limit_violations(scenario)
    yield from _tilt_violations(scenario.start, scenario.geometry)
    yield from _timing_violations(scenario)


def _geometry_violations(g: Geometry) -> Iterator[Violation]:
    """Checks that the sizes describe a peg that fits into a closed bore."""
    name, found = "geometry clearance (hole_radius - peg_radius)", f"{1e3 * g.clearance:.4g} mm"
    if g.clearance <= 0:
        yield Violation(name, found, "> 0: the hole must be wider than the peg")
    elif g.clearance < minimum_clearance(g.hole_radius):
        smallest = f"{1e3 * minimum_clearance(g.hole_radius):.4g} mm"
        yield Violation(name, found, f"at least {smallest}, which {MAX_FACETS} facets can resolve")
    if not 0 <= g.chamfer < g.hole_depth:
        yield Violation("geometry.chamfer", f"{g.chamfer} m", "at least 0 and below hole_depth")
    if g.peg_length <= g.hole_depth:
        yield Violation("geometry.peg_length", f"{g.peg_length} m", f"> hole_depth {g.hole_depth}")
    if g.block_radius <= g.hole_radius + g.chamfer:
        yield Violation("geometry.block_radius", f"{g.block_radius} m", "> hole_radius + chamfer")


def _name_violations(scenario: Scenario) -> Iterator[Violation]:
    """Checks the fields that hold the name of a choice."""
    approximation, habit = scenario.contact.approximation, scenario.operator.habit
    if approximation not in APPROXIMATIONS:
        yield Violation("contact.approximation", repr(approximation), f"one of {APPROXIMATIONS}")
    if scenario.device not in DEVICE_PRESETS:
        yield Violation("device", repr(scenario.device), f"one of {sorted(DEVICE_PRESETS)}")
    if scenario.fixture not in FIXTURES:
        yield Violation("fixture", repr(scenario.fixture), f"one of {FIXTURES}")
    if habit not in HABITS:
        yield Violation("operator.habit", repr(habit), f"one of {sorted(HABITS)}")


def _limit_violations(scenario: Scenario) -> Iterator[Violation]:
    """Checks the upper limits of single values, and the order of the force limits."""
    margin, hole_depth = scenario.trial.full_depth_margin, scenario.geometry.hole_depth
    if margin > 0.5 * hole_depth:
        bound = f"at most half of geometry.hole_depth {hole_depth} m"
        yield Violation("trial.full_depth_margin", f"{margin} m", bound)
    if scenario.contact.friction_spread > 1:
        yield Violation("contact.friction_spread", scenario.contact.friction_spread, "at most 1")
    g = scenario.geometry
    yield from softness_violations(modulus=scenario.contact.modulus, clearance=g.clearance, peg_radius=g.peg_radius)
    guard = scenario.controller
    if not guard.soft_force < guard.hold_force < guard.force_limit:
        yield Violation(
            "controller.hold_force",
            f"{guard.hold_force} N",
            f"above controller.soft_force {guard.soft_force} N and below controller.force_limit {guard.force_limit} N",
        )


def _tilt_violations(start: StartParameters, g: Geometry) -> Iterator[Violation]:
    """Checks that the peg can enter the hole from the initial tilt, if that is given."""
    largest = largest_entry_tilt(peg_radius=g.peg_radius, hole_radius=g.hole_radius)
    for name, value in zip("xy", start.tilt or [], strict=False):
        if abs(value) >= largest:
            bound = f"below {math.degrees(largest):.3g} deg, the largest tilt at which this peg enters this hole"
            yield Violation(f"start.tilt about {name}", f"{math.degrees(value):.3g} deg", bound)


def _timing_violations(scenario: Scenario) -> Iterator[Violation]:
    """Checks that periods are multiples of the steps that they are counted in, and the timing of the sensors."""
    operator, step = scenario.operator, scenario.contact.time_step
    if operator.correction_time > operator.correction_period:
        bound = f"above 0 and at most operator.correction_period {operator.correction_period} s"
        yield Violation("operator.correction_time", f"{operator.correction_time} s", bound)
    for name, period in (
        ("recorder.period", scenario.recorder.period),
        ("controller.period", scenario.controller.period),
    ):
        if not is_multiple(period, step):
            yield Violation(name, f"{period} s", f"a multiple of contact.time_step {step} s")
    yield from sensor_violations(scenario.sensor)
    guard = scenario.controller
    ramp = guard.hold_force - guard.soft_force
    yield from guard_violations(scenario.sensor, peg_radius=scenario.geometry.peg_radius, ramp=ramp)
    yield from stall_violations(
        resolution=scenario.rig.encoder_resolution,
        stall_depth=scenario.controller.stall_depth,
        feed_stall_distance=scenario.controller.feed_stall_distance,
    )


DEMONSTRATION_STREAM, TRIAL_STREAM, PERSON_STREAM, PRACTICE_STREAM, CHECK_STREAM, LIVE_STREAM = 1, 2, 3, 4, 5, 6
CORRECTION_STREAM, QUESTION_STREAM, STRESS_STREAM = 7, 8, 9
"""Random streams; equal seeds in different streams give independent draws."""


def resolve_scenario(scenario: Scenario, *, seed: int, stream: int, person: int | None = None) -> Scenario:
    """Returns a copy of ``scenario`` in which every range is drawn: the start, the pivot, the friction, the operator.

    Args:
        scenario: Scenario with ranges; not modified.
        seed: Non-negative integer.
        stream: one of the streams but those of persons and stress; demonstrations have wider ranges than trials.
        person: Number of the person, which is one operator for every seed and stream; None draws one with ``seed``.

    Raises:
        ValueError: If the resolved scenario is invalid; the message names ``seed``.
    """
    rng = np.random.default_rng([stream, seed])
    resolved = copy.deepcopy(scenario)
    resolved.seed = int(np.random.SeedSequence([stream, seed]).generate_state(1)[0] >> 1)
    start = resolved.start
    demonstrated = stream in (DEMONSTRATION_STREAM, LIVE_STREAM, CORRECTION_STREAM)
    tilt = rng.uniform(-1.0, 1.0, 2) * (start.demonstrated_tilt_range if demonstrated else start.tilt_range)
    offset = rng.uniform(-1.0, 1.0, 2) * start.offset_range
    # A gimbal is not mounted exactly. Demonstrations vary more than the rig does, so that they cover its range.
    rig = resolved.rig
    pivot = float(rng.uniform(-1.0, 1.0)) * (rig.demonstrated_pivot_range if demonstrated else rig.pivot_range)
    rig.pivot_height = pivot if rig.pivot_height is None else rig.pivot_height
    resolved.contact.friction *= 1.0 + float(rng.uniform(-1.0, 1.0)) * resolved.contact.friction_spread
    resolved.contact.friction_spread = 0.0
    start.tilt = [float(v) for v in tilt] if start.tilt is None else start.tilt
    start.offset = [float(v) for v in offset] if start.offset is None else start.offset
    personal = rng if person is None else np.random.default_rng([PERSON_STREAM, person])
    resolved.operator = draw_person(resolved.operator, personal)
    validate_scenario(resolved, f"scenario resolved with seed {seed}")
    return resolved
