"""Defines the scenario, the configuration tree of a run, in SI units; reads, checks, writes and resolves it.

A scenario contains ranges. A seed *resolves* it into a concrete scenario, which is stored with every result, so that
any demonstration or rig trial can be repeated from its own record.
"""

import math
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.common.yaml import yaml_dump_typed

from models.arm import CARRIERS, RIG
from models.clearance import following
from models.contact_checks import facet_violations, softness_violations
from models.contact_theory import largest_entry_tilt
from models.control import SCALED, WRENCHES, wrench_factor
from models.document import read_document, read_text
from models.hardware import DEVICE_PRESETS
from models.meshes import MAX_FACETS, minimum_clearance
from models.operator import HABITS, draw_person
from models.scenario_tree import (
    APPROXIMATIONS,
    AXIAL_FIXTURE,
    ENGINES,
    FIXTURES,
    FREE_FACETS,
    FREE_FIXTURE,
    MAX_OFFSET,
    MIN_TIME_STEP,
    RIG_FIXTURE,
    ContactParameters,
    CouplingParameters,
    Geometry,
    RecorderParameters,
    Scenario,
    StartParameters,
    TrialParameters,
)
from models.validation import (
    Violation,
    check_document,
    copied,
    fill,
    is_multiple,
    number_violations,
    raise_first,
)

__all__ = [
    "APPROXIMATIONS",
    "AXIAL_FIXTURE",
    "ENGINES",
    "FIXTURES",
    "FREE_FACETS",
    "FREE_FIXTURE",
    "MAX_OFFSET",
    "MIN_TIME_STEP",
    "RIG_FIXTURE",
    "ContactParameters",
    "CouplingParameters",
    "Geometry",
    "RecorderParameters",
    "Scenario",
    "StartParameters",
    "TrialParameters",
]
"""Of `models.scenario_tree`; the functions of this module are public too."""

SCENARIO_FOLDER = Path(__file__).parent / "scenarios"
MIN_LEVELS = 10
"""Minimum ratio of range to quantum. A coarser sensor is at the end of its range at the first contact."""

MAX_DELAY = 1000
"""Maximum delay of a sensor, in its periods."""


def load_scenario(
    name: str | Path = "nominal", engine: str | None = None, *, defaults: Scenario | None = None
) -> Scenario:
    """Reads a scenario from a file.

    Args:
        name: Name of a scenario in ``models/scenarios``, or path of a YAML file, with its suffix.
        engine: One of `ENGINES`, in place of the scenario's; None keeps that.
        defaults: Values of the keys that are missing in the file, or what follows from them at another geometry (see
            `models.clearance`); it is not changed. None: those of `Scenario`.

    Raises:
        ValueError: Naming the file and the problem, e.g. an unknown key, a wrong type or an impossible geometry.
        OSError: If the file cannot be read.
    """
    path = Path(name)
    if not path.suffix:
        path = SCENARIO_FOLDER / f"{name}.yaml"
    if not path.is_file():
        known = sorted(p.stem for p in SCENARIO_FOLDER.glob("*.yaml"))
        raise ValueError(f"scenario {path}: no such file; expected a YAML file or one of {known}")
    where = f"scenario {path}"
    return parse_scenario(read_text(path, where), where, engine=engine, defaults=defaults)


def dump_scenario(scenario: Scenario) -> str:
    """Returns the whole tree as YAML text."""
    return str(yaml_dump_typed(scenario, schema=Scenario))


def parse_scenario(text: str, where: str, *, engine: str | None = None, defaults: Scenario | None = None) -> Scenario:
    """Reads a scenario from YAML text; keys that are missing keep their defaults.

    Args:
        text: YAML text.
        where: Name of the source in error messages.
        engine: See `load_scenario`.
        defaults: See `load_scenario`.

    Raises:
        ValueError: Naming ``where`` and the problem.
    """
    document = read_document(text, where)
    document = {} if document is None else document
    check_document(document, Scenario, where)
    if engine is not None:
        document.setdefault("contact", {})["engine"] = engine
    base = Scenario() if defaults is None else defaults
    known = _filled(base, document)
    raise_first(chain(number_violations(known), _shape_violations(known.geometry)), where)
    scenario = _filled(following(known, base), document)
    validate_scenario(scenario, where)
    return scenario


def _filled(defaults: Scenario, document: dict[str, Any]) -> Scenario:
    """Returns the defaults with the values of a checked document; the scenario may not be valid."""
    scenario: Scenario = copied(defaults)
    fill(scenario, document)
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
    yield from _sensor_violations(scenario)


def _shape_violations(g: Geometry) -> Iterator[Violation]:
    """Checks that peg and bore are shapes, and that the bore is the wider one."""
    name, found = "geometry clearance (hole_radius - peg_radius)", f"{1e3 * g.clearance:.4g} mm"
    if g.clearance <= 0:
        yield Violation(name, found, "> 0: the hole must be wider than the peg")
    elif g.clearance < minimum_clearance(g.hole_radius):
        smallest = f"{1e3 * minimum_clearance(g.hole_radius):.4g} mm"
        yield Violation(name, found, f"at least {smallest}, which {MAX_FACETS} facets can resolve")
    if not 0 <= g.chamfer < g.hole_depth:
        yield Violation("geometry.chamfer", f"{g.chamfer} m", "at least 0 and below hole_depth")
    try:
        _ = g.assembly.mouth_reach
    except (TypeError, ValueError) as error:
        field = "mates" if g.mates else "corners" if g.corners else "section"
        yield Violation(f"geometry.{field}", getattr(g, field), f"another shape: {error}")


def _geometry_violations(g: Geometry) -> Iterator[Violation]:
    """Checks that the peg fits into a closed bore."""
    yield from _shape_violations(g)
    if g.peg_length <= g.hole_depth:
        yield Violation("geometry.peg_length", f"{g.peg_length} m", f"> hole_depth {g.hole_depth}")
    mouth_reach = g.assembly.mouth_reach
    if g.block_radius <= mouth_reach:
        expected = f"> {mouth_reach:.6g} m, the outer radius of the mouth"
        yield Violation("geometry.block_radius", f"{g.block_radius} m", expected)


def _name_violations(scenario: Scenario) -> Iterator[Violation]:
    """Checks the fields that hold the name of a choice."""
    contact, wrench = scenario.contact, scenario.controller.wrench
    for name, chosen, known in (
        ("contact.engine", contact.engine, ENGINES),
        ("contact.approximation", contact.approximation, APPROXIMATIONS),
        ("device", scenario.device, sorted(DEVICE_PRESETS)),
        ("fixture", scenario.fixture, FIXTURES),
        ("carrier", scenario.carrier, CARRIERS),
        ("operator.habit", scenario.operator.habit, sorted(HABITS)),
    ):
        if chosen not in known:
            yield Violation(name, repr(chosen), f"one of {known}")
    if wrench not in WRENCHES and not math.isfinite(wrench_factor(wrench)):
        yield Violation("controller.wrench", repr(wrench), f"one of {WRENCHES} or {SCALED}FACTOR, such as {SCALED}0.5")
    if scenario.rig.clocking_stage and scenario.geometry.is_round:
        yield Violation("rig.clocking_stage", "true", "false: a round part has no angle about its axis")
    if contact.engine == "drake" and scenario.geometry.mates:
        yield Violation("contact.engine", "drake", "exact: the mesh of the hole has one section only")
    if scenario.carrier != RIG and contact.engine != "exact":
        yield Violation("contact.engine", repr(contact.engine), "exact, for an arm")


def _limit_violations(scenario: Scenario) -> Iterator[Violation]:
    """Checks the values that bound each other."""
    g, guard, drive = scenario.geometry, scenario.controller.guard, scenario.controller.drive_monitor
    margin, operator = scenario.trial.full_depth_margin, scenario.operator
    if margin > 0.5 * g.hole_depth:
        bound = f"at most half of geometry.hole_depth {g.hole_depth} m"
        yield Violation("trial.full_depth_margin", f"{margin} m", bound)
    reach = DEVICE_PRESETS[scenario.device].workspace_radius
    if scenario.start.tip_height + scenario.full_depth >= reach:
        start, most = f"from {1e3 * scenario.start.tip_height:.3g} mm above the mouth", f"{1e3 * reach:.3g} mm"
        bound = f"a bottom within the {most} that device {scenario.device!r} moves {start}; start.depth begins lower"
        yield Violation("geometry.hole_depth", f"{g.hole_depth} m", bound)
    yield from softness_violations(modulus=scenario.contact.modulus, clearance=g.clearance, peg_radius=g.peg_radius)
    if not guard.soft_force < guard.hold_force < guard.force_limit:
        bound = f"above soft_force {guard.soft_force} N and below force_limit {guard.force_limit} N"
        yield Violation("controller.guard.hold_force", f"{guard.hold_force} N", bound)
    if scenario.coupling.torque_scale > 0.0 and DEVICE_PRESETS[scenario.device].peak_torque == 0.0:
        bound = f"0: the device '{scenario.device}' renders no torque"
        yield Violation("coupling.torque_scale", scenario.coupling.torque_scale, bound)
    if operator.correction_time > operator.correction_period:
        bound = f"above 0 and at most operator.correction_period {operator.correction_period} s"
        yield Violation("operator.correction_time", f"{operator.correction_time} s", bound)
    # A feed that moves must be seen to move.
    for name, value in (
        ("rig.encoder_resolution", scenario.rig.encoder_resolution),
        ("controller.drive_monitor.stall_depth", drive.stall_depth),
    ):
        if 2.0 * value > drive.stall_distance:
            bound = f"at most half of controller.drive_monitor.stall_distance {drive.stall_distance} m"
            yield Violation(name, f"{value} m", f"{bound}, or a moving feed counts as stalled")


def _tilt_violations(start: StartParameters, g: Geometry) -> Iterator[Violation]:
    """Checks that the peg can enter the hole from the initial tilt, if that is given."""
    largest = largest_entry_tilt(peg_radius=g.peg_radius, hole_radius=g.hole_radius)
    for name, value in zip("xy", start.tilt or [], strict=False):
        if abs(value) >= largest:
            bound = f"below {math.degrees(largest):.3g} deg, the largest tilt at which this peg enters this hole"
            yield Violation(f"start.tilt about {name}", f"{math.degrees(value):.3g} deg", bound)


def _timing_violations(scenario: Scenario) -> Iterator[Violation]:
    """Checks that periods are multiples of the steps that they are counted in."""
    sensor, step = scenario.sensor, scenario.contact.time_step
    for name, period in (
        ("recorder.period", scenario.recorder.period),
        ("controller.period", scenario.controller.period),
    ):
        if not is_multiple(period, step):
            yield Violation(name, f"{period} s", f"a multiple of contact.time_step {step} s")
    if not is_multiple(sensor.delay, sensor.period):
        yield Violation("sensor.delay", f"{sensor.delay} s", f"a multiple of sensor.period {sensor.period} s")
    if sensor.delay > MAX_DELAY * sensor.period:
        bound = f"at most {MAX_DELAY} times sensor.period {sensor.period} s"
        yield Violation("sensor.delay", f"{sensor.delay} s", bound)


def _sensor_violations(scenario: Scenario) -> Iterator[Violation]:
    """Checks that the force/torque sensor shows the load finely enough, for itself and for the force guard."""
    sensor, guard = scenario.sensor, scenario.controller.guard
    for kind, unit, quantum, ranges in (
        ("force", "N", sensor.force_quantum, sensor.force_range),
        ("torque", "N m", sensor.torque_quantum, sensor.torque_range),
    ):
        if quantum * MIN_LEVELS > min(ranges):
            bound = f"at most a tenth of sensor.{kind}_range, {min(ranges) / MIN_LEVELS:.4g} {unit}"
            yield Violation(f"sensor.{kind}_quantum", f"{quantum} {unit}", bound)
    # A force at the sensor has the lever `height` about the tip, so that its quantum is a large one of the load.
    load_quantum = (sensor.torque_quantum + sensor.height * sensor.force_quantum) / scenario.geometry.peg_radius
    ramp = guard.hold_force - guard.soft_force
    if load_quantum > ramp:
        bound = f"at most {ramp:.4g} N of load, hold_force less soft_force of controller.guard"
        yield Violation("sensor.force_quantum and sensor.torque_quantum", f"{load_quantum:.4g} N of load", bound)


DEMONSTRATION_STREAM, TRIAL_STREAM, PERSON_STREAM, PRACTICE_STREAM, CHECK_STREAM, LIVE_STREAM = 1, 2, 3, 4, 5, 6
CORRECTION_STREAM, QUESTION_STREAM, HARD_STREAM = 7, 8, 9
"""Random streams; equal seeds in different streams give independent draws."""

CLOCKING_DRAW, HOLE_DRAW = 1, 2
"""Third numbers of the seeds of the clocking angle at the start, and of the place of the hole under an arm."""


def resolve_scenario(scenario: Scenario, *, seed: int, stream: int, person: int | None = None) -> Scenario:
    """Returns a copy of ``scenario`` in which every range is drawn: start, pivot, friction, hole, operator.

    Args:
        scenario: Scenario with ranges; not modified.
        seed: Non-negative integer.
        stream: one of the streams but those of persons and hard trials; demonstrations have wider ranges than trials.
        person: Number of the person, which is one operator for every seed and stream; None draws one with ``seed``.

    Raises:
        ValueError: If the resolved scenario is invalid; the message names ``seed``.
    """
    rng = np.random.default_rng([stream, seed])
    resolved: Scenario = copied(scenario)
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
    if start.clocking is None:  # from a stream of its own, so that the other draws do not depend on the stage
        share = float(np.random.default_rng([stream, seed, CLOCKING_DRAW]).uniform(-1.0, 1.0))
        start.clocking = share * start.clocking_range if rig.clocking_stage else 0.0
    if resolved.arm.hole_offset is None:
        shares = np.random.default_rng([stream, seed, HOLE_DRAW]).uniform(-1.0, 1.0, 2)
        resolved.arm.hole_offset = [float(share) * resolved.arm.hole_offset_range for share in shares]
    validate_scenario(resolved, f"scenario resolved with seed {seed}")
    return resolved
