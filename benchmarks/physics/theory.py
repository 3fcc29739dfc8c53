"""Simulated contact against the laws of a rigid peg in a rigid hole.

    python -m benchmarks.physics.theory [--tilt-deg 0.5] [--tilt-deg 1] [--friction 0.2] [--points 200]
                                        [--depth-mm 20] [--seed 0] [--engine exact] [--prism square]
                                        [--json FILE]

Two-point depth and largest entry tilt are measured from Drake's meshes; the exact engine has none. Jamming, wedging and
the two-point force balance are measured by simulating a peg with planar freedoms under constant loads, in Drake with
softer contact and shorter steps than the default (`benchmarks.physics.contact_measurements.converged`). Depths are
vertical, from the mouth (the inner edge of the chamfer) to the tip's centre. At the default --depth-mm 20 the tilt of
two-point contact is small compared with the friction angle, as Whitney's laws assume.

A prism moves in a plane that halves two opposite sides or, on a diagonal, two opposite corners. Its theory is that of
the round peg, with half of its width in that plane for the radius.

Main results; those from jam_agreement on for each friction (key ``laws``). The file has the single measurements too:

- two_point_depth_error_max: largest relative error of the depth of two-point contact;
- two_point_depth_error_default: the same with the bore's polygon outside the true circle;
- entry_tilt_deg: largest tilt that enters, beside its exact value;
- jam_agreement: share of the loads further than 5 % from the edges of the jamming diagram that slid or stuck as
  predicted;
- wedge_angle_error: relative error of the smallest tilt that wedges, to the law c / mu; wedge_angle_error_exact: to the
  exact planar condition (None if a peg cannot wedge);
- force_balance_error: largest relative error of the axial force of a sliding peg.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Annotated, Any, Literal

import numpy as np
import typer

from benchmarks.command_line import JsonFile, finish, run
from benchmarks.physics.contact_measurements import (
    PRISMS,
    PegTheory,
    force_balance,
    jamming_trials,
    measured_entry_tilt,
    measured_two_point_depth,
    measured_wedging_tilt,
    prism_in,
)
from benchmarks.physics.contact_probe import ContactProbe, PlanarProbe
from benchmarks.physics.exact_probe import ExactProbe
from interfaces.terminal import progress
from models.contact_theory import (
    exact_wedging_tilt,
    largest_entry_tilt,
    two_point_depth,
    wedging_tilt,
)
from models.scenario import Scenario

TILTS = [0.25, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0]  # deg


def depths(scenario: Scenario, tilts_deg: list[float], *, diagonal: bool) -> dict[str, Any]:
    """Two-point depth and, but on a diagonal, entry tilt, from the meshes.

    Near the entry tilt of a diagonal the corners beside the plane touch first.

    Raises:
        ValueError: if a tilt has no two-point contact within the bore.
    """
    sizes = PegTheory.of(scenario)
    size = {"peg_radius": sizes.r, "hole_radius": sizes.R}
    angles = np.radians(tilts_deg)
    exact = two_point_depth(angles, **size)
    deepest = scenario.geometry.hole_depth - scenario.geometry.chamfer
    limit = np.degrees(largest_entry_tilt(**size))
    if (exact > deepest).any() or (angles >= np.radians(limit)).any():
        raise ValueError(
            f"tilts {tilts_deg} deg: two-point contact begins at {np.round(1e3 * exact, 1)} mm, expected within the"
            f" bore's {1e3 * deepest:.1f} mm and below {limit:.2f} deg"
        )
    matched, outside = ContactProbe(scenario), ContactProbe(scenario, matched=False)
    measured = np.array([measured_two_point_depth(matched, sizes, t) for t in angles])
    default = np.array([measured_two_point_depth(outside, sizes, t) for t in angles])
    entry = float("nan") if diagonal else np.degrees(measured_entry_tilt(matched, sizes))
    return {
        "tilts_deg": list(tilts_deg),
        "two_point_depth_exact_mm": (1e3 * exact).tolist(),
        "two_point_depth_mm": (1e3 * measured).tolist(),
        "two_point_depth_default_mm": (1e3 * default).tolist(),
        "two_point_depth_error_max": float(np.abs(measured / exact - 1.0).max()),
        "two_point_depth_error_default": float(np.abs(default / exact - 1.0).max()),
        "entry_tilt_deg": _or_none(entry),
        "entry_tilt_exact_deg": limit,
    }


def laws(
    scenario: Scenario,
    friction: float,
    depth: float,
    points: int,
    seed: int,
    engine: Callable[..., PlanarProbe],
    advance: Callable[[str], None],
) -> dict[str, Any]:
    """Jamming, wedging and the force balance at one friction.

    Args:
        scenario: geometry of the bodies.
        friction: coefficient mu.
        depth: depth of jamming and force balance, m.
        points: number of loads in the jamming diagram.
        seed: seed of the loads.
        engine: makes the probe.
        advance: is called with a note after each of the three measurements.
    """
    sizes = PegTheory.of(scenario)
    size = {"peg_radius": sizes.r, "hole_radius": sizes.R, "friction": friction}
    trials = jamming_trials(scenario, friction, depth=depth, count=points, seed=seed, engine=engine)
    advance("jamming")
    wedge, kept = measured_wedging_tilt(scenario, friction, engine=engine)
    advance("wedging")
    law, exact = wedging_tilt(**size), exact_wedging_tilt(**size)
    predicted, measured = force_balance(scenario, friction, depth=depth, engine=engine)
    advance("force balance")
    return {
        "friction": friction,
        "load_depth_mm": 1e3 * depth,
        "jam_points": len(trials.load),
        "jam_agreement": trials.agreement(),
        "jam_trials": np.column_stack([trials.force, trials.moment, trials.load, trials.slid]).tolist(),
        "wedge_angle_deg": _or_none(np.degrees(wedge)),
        "wedge_angle_law_deg": float(np.degrees(law)),
        "wedge_angle_exact_deg": _or_none(np.degrees(exact)),
        "wedge_angle_error": _or_none(abs(wedge / law - 1.0)),
        "wedge_angle_error_exact": _or_none(abs(wedge / exact - 1.0)),
        "wedge_trials": kept.tolist(),
        "axial_force_predicted": predicted.tolist(),
        "axial_force_measured": measured.tolist(),
        "force_balance_error": float(np.abs(measured / predicted - 1.0).max()),
    }


def _plane(value: str) -> str:
    """Checks the name of a plane."""
    if value and value not in PRISMS:
        raise typer.BadParameter(f"{value!r}, expected one of {list(PRISMS)}")
    return value


def _or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def main(
    tilt_deg: Annotated[
        list[float], typer.Option(min=1e-3, help="Tilt of two-point contact, deg; repeatable.")
    ] = TILTS,
    friction: Annotated[list[float], typer.Option(min=1e-3, help="Coefficient of friction; repeatable.")] = [0.2],  # noqa: B006
    points: Annotated[int, typer.Option(min=1, help="Loads in the jamming diagram.")] = 200,
    depth_mm: Annotated[float, typer.Option(help="Depth of jamming and force balance, mm.")] = 20.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the loads.")] = 0,
    engine: Annotated[Literal["drake", "exact"], typer.Option(help="Which contact to measure.")] = "drake",
    prism: Annotated[
        str, typer.Option(help=f"A peg that is not round, and its plane: one of {', '.join(PRISMS)}.", callback=_plane)
    ] = "",
    json: JsonFile = None,
) -> None:
    began, scenario = time.process_time(), prism_in(prism) if prism else Scenario()
    probe, found = (ContactProbe if engine == "drake" else ExactProbe), {}
    with progress("contact theory", 1 + 3 * len(friction)) as advance:
        if engine == "drake":
            found = depths(scenario, tilt_deg, diagonal="diagonal" in prism)
        advance("two-point depth and entry tilt")
        by_friction = [laws(scenario, mu, 1e-3 * depth_mm, points, seed, probe, advance) for mu in sorted(friction)]
    cpu = time.process_time() - began
    for result in (found, *by_friction, {"cpu_s": cpu}):
        for name, value in result.items():
            if not isinstance(value, list):
                print(f"{name:32}{value if value is None or isinstance(value, int) else round(value, 5)}")
    finish({**found, "laws": by_friction, "seed": seed, "cpu_s": cpu}, json)


if __name__ == "__main__":
    run(main)
