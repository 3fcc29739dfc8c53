"""Runs a trained skill on the simulated 3-DOF rig."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.box import SIMPLE
from rich.table import Table

from models.scenario import Scenario, dump_scenario, load_scenario, validate_scenario
from skill.data.rig_run import read_rig_run, write_rig_run
from skill.data.tables import write_atomically
from skill.manipulation_skill import ManipulationSkill
from systems.reports.batch_page import batch_report, worst_trial
from systems.reports.motion import read_motion
from systems.reports.replay_page import replay_page
from systems.reports.terminal import console, progress, report_errors, write_json
from systems.runs.provenance import versions
from systems.runs.trial import run_trials
from systems.runs.trial_result import TrialResult

app = typer.Typer(add_completion=False)


def result_table(results: list[TrialResult]) -> Table:
    """One row a trial, and a summary."""
    table = Table(title="insertions on the rig", box=SIMPLE, padding=(0, 1, 0, 0))
    table.add_column("trial", justify="right")
    table.add_column("tilt\n(deg)", no_wrap=True, justify="right")
    table.add_column("outcome", min_width=len("inserted"))
    for name, unit in (
        *(("time", "s"), ("depth", "mm"), ("axial", "N"), ("across", "N")),
        ("steps", ""),
    ):
        table.add_column(f"{name}\n({unit})" if unit else name, justify="right")
    table.add_column("states (visits)", min_width=14)
    for r in results:
        colour = "green" if r.inserted else "red"
        table.add_row(
            *(str(r.seed), "{:+.1f} {:+.1f}".format(*np.degrees(r.tilt)), f"[{colour}]{r.reason}[/]"),
            *(f"{r.time:.2f}", f"{1e3 * r.depth:.1f}", f"{r.peak_axial_force:.1f}", f"{r.peak_lateral_force:.1f}"),
            *(str(r.steps), f"{' '.join(map(str, dict.fromkeys(r.states)))} ({len(r.states)})"),
        )
    table.caption = (
        f"{sum(r.inserted for r in results)} of {len(results)} inserted;"
        f" medians: {np.median([r.time for r in results]):.2f} s,"
        f" peak force across {np.median([r.peak_lateral_force for r in results]):.0f} N,"
        f" overlap {1e6 * np.median([r.penetration for r in results]):.0f} um"
    )
    return table


@report_errors
def run(
    *,
    skill: Path,
    trials: int,
    seed: int,
    tilt_deg: float | None,
    friction: float | None,
    scenario: str,
    out: Path,
    json: Path | None,
    jobs: int,
) -> list[TrialResult]:
    """Runs the trials, writes each run and a report into ``out`` and all results into ``json``."""
    learnt = ManipulationSkill.load(skill)
    chosen = load_scenario(scenario)
    if tilt_deg is not None:
        chosen.start.tilt_range = math.radians(tilt_deg)
    if friction is not None:
        chosen.contact.friction, chosen.contact.friction_spread = friction, 0.0
    validate_scenario(chosen, "command line")
    results: list[TrialResult] = []
    with progress("rig trials", trials) as advance:
        for result, record in run_trials(chosen, learnt, list(range(seed, seed + trials)), jobs=jobs):
            write_rig_run(record, out / f"run_{result.seed:04d}.parquet")
            results.append(result)
            advance(f"trial {result.seed}: {result.reason}, {result.time:.1f} s")
    write_json(json if json is not None else out / "results.json", [r.record() for r in results])
    write_report(results, out, title=f"{trials} insertions on the rig", skill=str(skill), scenario=chosen)
    console.print(result_table(results))
    console.print(f"report in {out / 'report.html'}")
    return results


def write_report(results: list[TrialResult], out: Path, *, title: str, skill: str, scenario: Scenario) -> None:
    """Writes ``report.html`` beside the runs in ``out``, and the replay of the worst trial that it links."""
    worst = worst_trial(results)
    run_file = out / f"run_{worst.seed:04d}.parquet"
    replay = out / f"replay_{worst.seed:04d}.html"
    write_atomically(replay, replay_page(read_motion(run_file), title=f"trial {worst.seed}").encode())
    page = batch_report(
        results,
        title=title,
        state_names=read_rig_run(run_file).metadata["state_names"],
        replay=replay.name,
        made_by={"skill": skill, **versions()},
        scenario=dump_scenario(scenario),
    )
    write_atomically(out / "report.html", page.encode())


@app.command()
def main(
    skill: Annotated[Path, typer.Option(help="A skill file of train_skill.")] = Path("out/skill.npz"),
    trials: Annotated[int, typer.Option(min=1, help="How many insertions.")] = 10,
    seed: Annotated[int, typer.Option(min=0, help="Number of the first trial; every trial has its own.")] = 0,
    tilt_deg: Annotated[
        float | None,
        typer.Option(min=0.0, help="Largest starting tilt on each axis, degrees [default: scenario's]"),
    ] = None,
    friction: Annotated[
        float | None, typer.Option(min=0.0, help="Coulomb friction of peg on hole [default: scenario's]")
    ] = None,
    scenario: Annotated[
        str, typer.Option(help="Name of a scenario in models/scenarios, or the path of your own YAML file.")
    ] = "nominal",
    out: Annotated[Path, typer.Option(help="Folder for the runs, one .parquet file each, and report.html.")] = Path(
        "out/rig"
    ),
    json: Annotated[
        Path | None, typer.Option(help="All results, one object a trial [default: OUT/results.json]")
    ] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Processes to use.")] = 2,
) -> None:
    """Insert the peg on the rig, from tilts the skill has never seen.

    The controller feels a wrench and a depth and nothing else. Trials never share a random draw with demonstrations.
    Leaves a report of the batch, report.html in OUT, which links a replay of the worst trial.

    Example: python -m scripts.run_rig --trials 20 --seed 100 --tilt-deg 2 --friction 0.3 --json out/mine.json
    """
    run(
        skill=skill,
        trials=trials,
        seed=seed,
        tilt_deg=tilt_deg,
        friction=friction,
        scenario=scenario,
        out=out,
        json=json,
        jobs=jobs,
    )


if __name__ == "__main__":
    app()
