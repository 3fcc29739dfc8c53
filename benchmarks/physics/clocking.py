"""How far a peg that is not round may be turned about its axis: simulated bodies against plane geometry.

    python -m benchmarks.physics.clocking [--json FILE]

An upright peg on the axis of the hole, 10 mm below the mouth, is turned until it touches. The law is
`models.contact_theory.largest_clocking` for rounded corners and sides, and 2 arcsin(C / 2a) for two pins at a distance
a from the axis. The exact engine searches its contacts; Drake's meshes are posed and asked whether they overlap.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from benchmarks.command_line import JsonFile, finish, run
from benchmarks.physics.contact_probe import PosedMeshes
from models.contact_bodies import Bodies
from models.contact_theory import largest_clocking
from models.exact_geometry import deepest_overlap
from models.scenario import Geometry, Scenario, load_scenario
from models.section import KIND, NAMES, SIZE, C, S, Section, X, Y, point_on

DEPTH = 0.010
"""Depth of the tip, m."""

TURNS = (0.0, 0.2)
"""Angles between which the largest one is sought, rad."""

NEAR = 1e-9
"""Distance of a corner's end from the end of a side, m, that counts as none."""


def corners_of(section: Section) -> Iterator[tuple[list[float], list[float], float]]:
    """Yields each rounded corner beside a side: its centre, the vector from the axis to the side, and its radius, m."""
    for arc in section.pieces[(section.pieces[:, KIND] == 1.0)]:
        ends = point_on(arc, np.array([0.0, 1.0]))
        for side in section.pieces[section.pieces[:, KIND] == 0.0]:
            if np.abs(ends[:, None] - point_on(side, np.array([0.0, 1.0]))).max(axis=2).min() < NEAR:
                away = side[X] * side[S] - side[Y] * side[C]
                yield [arc[X], arc[Y]], [away * side[S], -away * side[C]], arc[SIZE]


def law(g: Geometry) -> float:
    """Returns the largest angle by the law, rad."""
    if g.mates:
        return min(2.0 * math.asin(0.5 * g.clearance / math.hypot(*row[:2])) for row in g.mates)
    return largest_clocking(*zip(*corners_of(g.assembly.fits[0].peg), strict=True), clearance=g.clearance)


def largest(touches: Callable[[float], bool]) -> float:
    """Returns the largest angle at which bodies do not touch, rad, by bisection."""
    low, high = TURNS
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if touches(middle) else (middle, high)
    return low


def in_exact_engine(scenario: Scenario) -> float:
    """Returns the largest angle in the exact engine, rad."""
    bodies, p = Bodies.of(scenario), np.array([0.0, 0.0, -DEPTH])

    def touches(turn: float) -> bool:
        c, s = math.cos(turn), math.sin(turn)
        return deepest_overlap(bodies, p, np.array([c, s, 0.0]), np.array([-s, c, 0.0])) > 0.0

    return largest(touches)


def in_drake(scenario: Scenario) -> float:
    """Returns the largest angle of Drake's meshes, rad."""
    meshes = PosedMeshes(scenario)
    return largest(lambda turn: meshes.touch(RigidTransform(RotationMatrix.MakeZRotation(turn), [0.0, 0.0, -DEPTH])))


def main(json: JsonFile = None) -> None:
    rows: list[dict[str, Any]] = []
    print("part           law, deg   exact engine, error   Drake, error")
    for name in (*NAMES[1:], "two_pin_plug"):
        scenario = load_scenario(name) if name not in NAMES else Scenario()
        if name in NAMES:
            scenario.geometry.section = name
        expected, exact = law(scenario.geometry), in_exact_engine(scenario)
        drake = None if scenario.geometry.mates else in_drake(scenario) / expected - 1.0
        rows.append({"part": name, "law_deg": math.degrees(expected), "exact": exact / expected - 1.0, "drake": drake})
        shown = "" if drake is None else f"{100 * drake:12.3f} %"
        print(f"{name:14} {math.degrees(expected):8.4f} {100 * (exact / expected - 1.0):18.5f} % {shown}", flush=True)
    finish({"clocking": rows}, json)


if __name__ == "__main__":
    run(main)
