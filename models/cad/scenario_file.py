"""The scenario file of a part, from the fit of its peg and hole."""

from __future__ import annotations

import math
from typing import Any

import yaml

from models.cad.pair import Fit
from models.clearance import start_of_clearance
from models.scenario import Geometry, Scenario, validate_scenario
from models.section import ROUND

DIGITS = 8
"""Decimals of lengths in m: files in single precision have no more."""

CORNER_DIGITS = 7
"""Decimals of corners, in units of the size of the peg."""

EVEN = 1e-6
"""Largest range of a clearance that counts as constant, m."""

LEAST_FLOOR = 1e-3
"""Smallest thickness of the block below the hole, m; a hole that goes through has its floor at its far end."""

MARGIN = 1e-4
"""Distance from the floor that counts as inserted, beyond what a tilt in the play costs, m."""


def scenario_of(found: Fit) -> Scenario:
    """Returns the nominal scenario with the geometry of a part, and with starts and an end that its clearance permits.

    The hole of the scenario is wider than the peg by the smallest clearance everywhere.

    Raises:
        ValueError: naming the value that the simulation does not take.
    """
    guide, scenario = found.steps[0], Scenario()
    size = round(guide.section.inner_radius, DIGITS)
    steps = [
        [0.0, 0.0, *(round(v, DIGITS) + 0.0 for v in (step.section.inner_radius, step.tip, step.mouth))]
        for step in found.steps
    ]
    steps[0][3] = 0.0  # its own chamfer is left out
    depth, floor = round(found.depth, DIGITS), round(found.floor, DIGITS)
    rows = [[round(float(v) / size, CORNER_DIGITS) + 0.0 for v in row] for row in guide.corners]
    scenario.geometry = Geometry(
        section=ROUND,
        corners=[] if guide.is_round else rows,
        mates=steps if len(steps) > 1 else [],
        peg_radius=size,
        peg_length=round(found.length, DIGITS),
        hole_radius=round(size + found.clearance, DIGITS),
        hole_depth=depth,
        chamfer=round(found.chamfer + found.tip, 6),
        block_radius=round(found.block, DIGITS),
        floor=max(LEAST_FLOOR, floor),
    )
    if scenario.geometry.mates:
        scenario.contact.engine = "exact"
    tilted = guide.section.outer_radius * 2.0 * found.clearance / depth
    scenario.trial.full_depth_margin = max(scenario.trial.full_depth_margin, round(tilted + MARGIN, 6))
    validate_scenario(scenario, "the part")
    return start_of_clearance(scenario)


def remarks(found: Fit) -> list[str]:
    """Returns what was found, and what the scenario leaves out, one line each."""
    guide, um, mm = found.guide, 1e6, 1e3
    section, smallest, largest = guide.section, um * guide.clearance.min(), um * guide.clearance.max()
    shape = "round" if guide.is_round else f"{len(guide.corners)} corners"
    lines = [
        f"the hole opens along {found.axis}; {mm * found.depth:.3f} mm deep{', through' if found.through else ''}",
        f"section: {shape}, {mm * section.inner_radius:.4f} to {mm * section.outer_radius:.4f} mm from the axis",
        f"symmetry: {_group(found)}",
    ]
    if len(found.steps) > 1:
        radii = ", ".join(f"{mm * step.section.inner_radius:.4f}" for step in found.steps)
        lines.append(f"steps: {radii} mm from the axis, from the tip upwards; only the exact engine takes them")
    for mating in found.matings:
        low, high = um * mating.clearance.min(), um * mating.clearance.max()
        a, b = (mm * depth for depth in mating.depths)
        lines.append(f"clearance from {a:.2f} to {b:.2f} mm below the mouth: {low:.2f} to {high:.2f} um")
    if found.chamfer > 0.0:
        lines.append(f"lead-in: {mm * found.chamfer:.3f} mm wide, {mm * found.chamfer_height:.3f} mm high")
    if abs(complex(*found.moved)) > 0.0:
        x, y = (mm * value for value in found.moved)
        lines.append(f"the peg was moved by {x:.4f}, {y:.4f} mm across the axis, to where the clearance is most even")
    if largest - smallest > um * EVEN:
        lines.append(f"left out: the clearance varies; the simulated hole has {smallest:.2f} um everywhere")
    if found.tip > 0.0:
        lines.append(f"left out: the tip's chamfer of {mm * found.tip:.3f} mm; that of the hole is wider instead")
    if found.chamfer > 0.0 and not 0.8 < found.chamfer_height / found.chamfer < 1.25:
        lines.append("left out: the angle of the lead-in; the simulated one has 45 degrees")
    if found.through:
        lines.append("left out: the open end; the simulated hole has a floor there")
    return lines


def _group(found: Fit) -> str:
    section = found.guide.section
    if found.guide.is_round:
        return "all turns about the axis"
    turns = "none but a full turn" if section.order == 1 else f"{section.order} turns about the axis"
    return turns if section.mirror is None else f"{turns}, and a mirror plane at {math.degrees(section.mirror):.1f} deg"


HEADER = "A part that `haptic-skill part` has measured."
"""First line of the file, by which a file is known that may be replaced."""


def part_text(found: Fit) -> str:
    """Returns the text of the scenario file: remarks, and the keys that differ from the nominal scenario.

    Raises:
        ValueError: see `scenario_of`.
    """
    own, nominal = scenario_of(found), Scenario()
    g, start = own.geometry, own.start
    shapes = {"mates": g.mates, "corners": g.corners}
    geometry: dict[str, Any] = {name: rows for name, rows in shapes.items() if rows} or {"section": g.section}
    for name in ("peg_radius", "peg_length", "hole_radius", "hole_depth", "chamfer", "block_radius", "floor"):
        geometry[name] = getattr(g, name)
    document: dict[str, Any] = {"geometry": geometry}
    if own.contact.engine != nominal.contact.engine:
        document["contact"] = {"engine": own.contact.engine}
    ranges = {
        name: round(getattr(start, name), 6)
        for name in ("tilt_range", "demonstrated_tilt_range")
        if getattr(start, name) != getattr(nominal.start, name)
    }
    if ranges:
        document["start"] = ranges
    if own.trial.full_depth_margin != nominal.trial.full_depth_margin:
        document["trial"] = {"full_depth_margin": own.trial.full_depth_margin}
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=100)
    return "".join(f"# {line}\n" for line in (HEADER, *remarks(found))) + text
