"""Runs a trained skill on the simulated 3-DOF rig."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scripts.command_line import command, make_app, run_app
from scripts.options import Jobs, OutFolder, ScenarioName, Seed, SkillFile, Trials
from scripts.replay import write_replay

if TYPE_CHECKING:
    from models.scenario import Scenario
    from systems.runs.trial_result import TrialResult

app = make_app()


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
    """Runs trials ``seed`` to ``seed + trials - 1`` and returns their results.

    Writes each run and a report into the folder ``out``, and all results into the file ``json``
    (None: results.json in ``out``). ``tilt_deg`` and ``friction`` replace values of the scenario unless they are None.

    Raises:
        ValueError: if the skill file, the scenario or a value that replaces one of it is not valid.
        OSError: if a file cannot be written.
    """
    from models.scenario import load_scenario, validate_scenario
    from skill.data.rig_run import write_rig_run
    from skill.manipulation_skill import ManipulationSkill
    from systems.reports.result_tables import result_table
    from systems.reports.terminal import console, progress, say, write_json
    from systems.runs.trial import run_trials

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
    say(f"report in {out / 'report.html'}")
    return results


def write_report(results: Sequence[TrialResult], out: Path, *, title: str, skill: str, scenario: Scenario) -> None:
    """Writes ``report.html`` beside the runs in ``out``, and the replay of the worst trial to which it links."""
    from models.scenario import dump_scenario
    from skill.data.rig_run import read_rig_run
    from skill.data.tables import write_atomically
    from systems.reports.batch_page import batch_report, worst_trial
    from systems.runs.provenance import versions

    worst = worst_trial(results)
    run_file = out / f"run_{worst.seed:04d}.parquet"
    replay = out / f"replay_{worst.seed:04d}.html"
    write_replay(run_file, replay, title=f"trial {worst.seed}")
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
@command
def main(
    skill: SkillFile = Path("out/skill.npz"),
    trials: Trials = 10,
    seed: Seed = 0,
    tilt_deg: Annotated[
        float | None,
        typer.Option(min=0.0, help="Largest starting tilt about each axis, degrees.", show_default="from the scenario"),
    ] = None,
    friction: Annotated[
        float | None,
        typer.Option(min=0.0, help="Coulomb friction coefficient of peg and hole.", show_default="from the scenario"),
    ] = None,
    scenario: ScenarioName = "nominal",
    out: OutFolder = Path("out/rig"),
    json: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="JSON file for the results, one object per trial.",
            show_default="results.json in the folder of --out",
        ),
    ] = None,
    jobs: Jobs = 2,
) -> None:
    """Inserts the peg on the simulated rig with a trained skill.

    The trials start from tilts that the skill has not seen, and share no random draw with the demonstrations. The
    controller measures the wrench and the depth, and nothing else.

    Reads a skill and a scenario. Writes into the folder of `--out` one run_NNNN.parquet per trial (NNNN = seed + k),
    results.json, and report.html, which links to a replay of the worst trial.

    For example:

        haptic-skill rig --trials 20 --seed 100 --tilt-deg 2 --friction 0.3 --json out/mine.json
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
    run_app(app)
