"""Simulated contact against the laws of a rigid peg in a rigid hole.

    python -m benchmarks.physics.theory [--friction 0.2] [--points 200] [--engine exact] [--prism square] [--json FILE]

Two-point depth is measured from Drake's meshes; the exact engine has none. Jamming, wedging and the two-point force
balance are measured by simulating a peg with planar freedoms under constant loads, in Drake with softer contact and
shorter steps than the default (`benchmarks.physics.contact_measurements.converged`). Depths are vertical, from the
mouth (the inner edge of the chamfer) to the tip's centre. At the 20 mm of jamming and force balance the tilt of
two-point contact is small compared with the friction angle, as Whitney's laws assume.

A prism moves in a plane that halves two opposite sides or, on a diagonal, two opposite corners. Its theory is that of
the round peg, with half of its width in that plane for the radius.

Results: two_point_depth_error, the largest relative error of the depth of two-point contact, and for each friction:

- jam_agreement: share of the loads further than 5 % from the edges of the jamming diagram that slid or stuck as
  predicted;
- wedging_deg: smallest tilt that wedges; wedging_error: relative to the exact planar condition, wedging_law_error: to
  the law c / mu (NaN if a peg cannot wedge);
- force_balance_error: largest relative error of the axial force of a sliding peg.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Literal

import numpy as np
import pandas as pd
import typer

from benchmarks.command_line import JsonFile, finish, run
from benchmarks.physics.contact_measurements import (
    PRISMS,
    PegTheory,
    force_balance,
    jamming_agreement,
    measured_two_point_depth,
    measured_wedging_tilt,
    prism_in,
)
from benchmarks.physics.contact_probe import ContactProbe, PlanarProbe
from benchmarks.physics.exact_probe import ExactProbe
from interfaces.terminal import progress
from models.contact_theory import exact_wedging_tilt, two_point_depth, wedging_tilt
from models.scenario import Scenario

TILTS = np.radians([0.25, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0])
DEPTH = 0.020
"""Depth of jamming and force balance, m."""


def depth_error(scenario: Scenario) -> float:
    """The largest relative error of the depth of two-point contact of Drake's meshes, over `TILTS`."""
    sizes, probe = PegTheory.of(scenario), ContactProbe(scenario)
    measured = np.array([measured_two_point_depth(probe, sizes, tilt) for tilt in TILTS])
    return float(np.abs(measured / two_point_depth(TILTS, peg_radius=sizes.r, hole_radius=sizes.R) - 1.0).max())


def laws(scenario: Scenario, friction: float, points: int, engine: Callable[..., PlanarProbe]) -> dict[str, float]:
    """Jamming, wedging and the force balance at one friction.

    Args:
        scenario: geometry of the bodies.
        friction: coefficient mu.
        points: number of loads in the jamming diagram.
        engine: makes the probe.
    """
    sizes = PegTheory.of(scenario)
    size = {"peg_radius": sizes.r, "hole_radius": sizes.R, "friction": friction}
    wedge = measured_wedging_tilt(scenario, friction, engine=engine)
    predicted, measured = force_balance(scenario, friction, depth=DEPTH, engine=engine)
    return {
        "friction": friction,
        "jam_agreement": jamming_agreement(scenario, friction, depth=DEPTH, count=points, seed=0, engine=engine),
        "wedging_deg": float(np.degrees(wedge)),
        "wedging_error": wedge / exact_wedging_tilt(**size) - 1.0,
        "wedging_law_error": wedge / wedging_tilt(**size) - 1.0,
        "force_balance_error": float(np.abs(measured / predicted - 1.0).max()),
    }


def main(
    friction: Annotated[list[float], typer.Option(min=1e-3, help="Coefficient of friction; repeatable.")] = [0.2],  # noqa: B006
    points: Annotated[int, typer.Option(min=1, help="Loads in the jamming diagram.")] = 200,
    engine: Annotated[Literal["drake", "exact"], typer.Option(help="Which contact to measure.")] = "drake",
    prism: Annotated[str, typer.Option(help=f"A peg that is not round, and its plane: {', '.join(PRISMS)}.")] = "",
    json: JsonFile = None,
) -> None:
    if prism and prism not in PRISMS:
        raise typer.BadParameter(f"--prism {prism!r}, expected one of {list(PRISMS)}")
    scenario, rows = prism_in(prism) if prism else Scenario(), []
    error = depth_error(scenario) if engine == "drake" else None
    with progress("contact theory", len(friction)) as advance:
        for mu in friction:
            rows.append(laws(scenario, mu, points, ContactProbe if engine == "drake" else ExactProbe))
            advance(f"friction {mu}")
    print(f"two_point_depth_error {error}")
    print(pd.DataFrame(rows).to_string(index=False, float_format="{:.4f}".format))
    finish({"two_point_depth_error": error, "laws": rows}, json)


if __name__ == "__main__":
    run(main)
