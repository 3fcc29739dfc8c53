"""Serves a simulated arm by the protocol of the real one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from scripts.command_line import OptionalScenarioName, Seed, path_option, text_option

OFFSETS = {"usual": 0.5, "hard": 1.0}
"""Half width of the distributions of the place of the hole, mm, by the set of the trials."""


def main(
    robot: Annotated[Literal["fr3"], typer.Argument(help="Which arm.")] = "fr3",
    seed: Seed = 0,
    trials_of: Annotated[
        Literal["usual", "hard"],
        typer.Option(help="Which trials the holes are of: all that the scenario contains, or only the hard ones."),
    ] = "usual",
    offset_mm: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="Largest distance, along x and along y, of a hole from where one believes it to be, mm.",
            show_default="0.5, hard 1",
        ),
    ] = None,
    scenario: OptionalScenarioName = None,
    host: Annotated[str, text_option("ADDRESS", "Address of this machine at which the arm is served.")] = "127.0.0.1",
    speed: Annotated[
        float, typer.Option(min=0.01, max=1.0, help="Of the clock of the arm, in units of real time.")
    ] = 1.0,
    view: Annotated[bool, typer.Option("--view", help="Show the arm in the browser.")] = False,
    json: Annotated[
        Path | None, path_option("FILE", "JSON file for what has become of each hole.", shown="none")
    ] = None,
) -> None:
    """Serves a simulated arm, its force sensor and a hole, by libfranka's protocol and that of a Net F/T sensor.

    A program that moves a real Franka Research 3 moves this one; only the address differs. The hole is beside and
    askew of where one believes it to be, as in trial SEED of the scenario. Once the arm has been at the hole and is
    25 mm away again, the hole of the next trial is there.

    Reads a scenario. Writes what has become of each hole into the file of `--json`. On a slow machine the arm's clock
    is slower than real time; what is printed says how fast it was. Ends with Ctrl-C.

    For example:

        haptic-skill twin fr3 --seed 7 --trials-of hard
    """
    import time

    from experiments.outputs.output_checks import check_file
    from experiments.trial.trial_set import TrialSet
    from interfaces.robots.fr3_twin import SENSOR_PAGE_PORT, SENSOR_PORT, Fr3Twin, Insertion
    from interfaces.terminal import say, write_json
    from models.scenario import load_scenario, validate_scenario

    chosen = load_scenario(scenario or robot)
    chosen.arm.hole_offset_range = 1e-3 * (OFFSETS[trials_of] if offset_mm is None else offset_mm)
    validate_scenario(chosen, "command line")
    if json is not None:
        check_file(json, "trials.json", option="--json")
    rows: list[dict[str, Any]] = []
    clock = {"arm": 0.0, "wall": 0.0}  # at the end of the last hole, s

    def ended(found: Insertion) -> None:
        wall = time.perf_counter()
        pace = (found.time - clock["arm"]) / (wall - clock["wall"])
        clock.update(arm=found.time, wall=wall)
        reached = found.depth >= chosen.full_depth
        rows.append(
            {
                **{"seed": found.number, "inserted": reached, "depth_mm": round(1e3 * found.depth, 2)},
                **{"peak_normal_force_n": round(found.peak_force, 1), "clock": round(pace, 3)},
            }
        )
        say(
            f"hole {found.number}: {1e3 * found.depth:.1f} mm deep, {'inserted' if reached else 'not inserted'},"
            f" at most {found.peak_force:.0f} N of normal forces, {pace:.2f} times real time"
        )
        if json is not None:
            write_json(json, rows)

    meshcat = None
    if view:
        from pydrake.geometry import Meshcat

        meshcat = Meshcat()
        say(f"open {meshcat.web_url()}")
    twin = Fr3Twin(chosen, seed=seed, trials=TrialSet(trials_of), host=host, ended=ended, meshcat=meshcat)
    url = f"netft://{host}:{SENSOR_PORT}:{SENSOR_PAGE_PORT}"
    say(f"the arm is at {host}, its sensor at {url}; in another terminal:")
    say(f"    haptic-skill arm --address {host} --sensor {url}")
    clock["wall"] = time.perf_counter()
    try:
        twin.run(speed)
    finally:
        twin.close()
