"""Runs a trained skill on the simulated 3-DOF rig."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from scripts.command_line import (
    DefaultSkillFile,
    Engine,
    Jobs,
    OutFolder,
    Overwrite,
    ScenarioName,
    Seed,
    Trials,
    find_skill,
    path_option,
    read_scenario,
    trial_numbers,
)
from scripts.compilation import compile_loop

if TYPE_CHECKING:
    from experiments.outputs.output_set import OutputSet, SetIndex
    from experiments.trial.trial_result import TrialResult

RESULTS, REPORT = "results.json", "report.html"
RUN, REPLAY = "run_{:04d}.parquet", "replay_{:04d}.html"
"""Names of the files of a trial, by its number."""


def main(
    skill: DefaultSkillFile = None,
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
    wrench: Annotated[
        str | None,
        typer.Option(
            metavar="[true|zero|frozen|shuffled|scaled:FACTOR]",
            help="What the policy receives of the measured wrench; monitors, back-off and force guard have all of it.",
            show_default="from the scenario",
        ),
    ] = None,
    trials_of: Annotated[
        Literal["usual", "hard"],
        typer.Option(help="Which trials: all that the scenario contains, or only the hard ones."),
    ] = "usual",
    scenario: ScenarioName = "nominal",
    engine: Engine = None,
    out: OutFolder = Path("out/rig"),
    json: Annotated[
        Path | None, path_option("FILE", "JSON file for a copy of results.json, one object per trial.", shown="no copy")
    ] = None,
    jobs: Jobs = 2,
    overwrite: Overwrite = False,
) -> None:
    """Inserts the peg on the simulated rig with a trained skill.

    The trials start from tilts that the skill has not seen, and share no random draw with the demonstrations. The
    controller measures the wrench and the depth, and nothing else. Hard trials have steep tilts, a pivot well off
    the mouth, and much friction.

    Reads a skill and a scenario. Writes into the folder of `--out` one run_NNNN.parquet per trial (NNNN = seed + k)
    and results.json as the trials end, then a replay_NNNN.html of each trial, and report.html, which links them. Given
    again after an interruption, it goes on where it stopped. It does not mix its runs with those of another request.

    For example:

        haptic-skill rig --trials 20 --seed 100 --tilt-deg 2 --friction 0.3 --out out/mine
    """
    import hashlib
    from functools import partial

    from experiments.outputs.output_checks import RECORDING_SIZE, REPORT_SIZE, check_folder
    from experiments.outputs.output_set import RUNS, SetIndex, open_set
    from experiments.provenance import versions
    from experiments.trial.run_trial import run_trials
    from experiments.trial.trial_set import TrialSet, trial_scenario
    from interfaces.terminal import progress, say
    from models.scenario import dump_scenario, validate_scenario
    from skill.data.rig_run import write_rig_run
    from skill.manipulation_skill import ManipulationSkill

    skill = find_skill(skill)
    policy, numbers = ManipulationSkill.load(skill), trial_numbers(seed, trials)
    chosen = read_scenario(scenario, engine)
    if tilt_deg is not None:
        chosen.start.tilt_range = math.radians(tilt_deg)
    if friction is not None:
        chosen.contact.friction, chosen.contact.friction_spread = friction, 0.0
    if wrench is not None:
        chosen.controller.wrench = wrench
    validate_scenario(chosen, "command line")
    request = {
        **{"trials": trials, "seed": seed, "scenario": dump_scenario(chosen), "versions": versions()},
        **{"skill": hashlib.sha256(skill.read_bytes()).hexdigest(), "trials_of": trials_of},
    }
    files = (*map(RUN.format, numbers), RESULTS)
    index = SetIndex(RUNS, request, files, reports=(REPORT, *map(REPLAY.format, numbers)))
    check_folder(out, size=trials * (RECORDING_SIZE + REPORT_SIZE))
    copy = copy_of_results(json, out, skill, index) if json is not None else None
    with open_set(out, index, overwrite=overwrite) as runs:
        done: dict[int, TrialResult] = {result.seed: result for result in runs.finished.values()}
        if runs.damaged:
            say(f"cannot be read and are run again: {', '.join(runs.damaged)}")
        if done:
            say(f"{len(done)} of {trials} trials are there already")
            write_results(runs, done)
        missing = [number for number in numbers if number not in done]
        for number in missing:  # all are checked before the first is performed
            trial_scenario(chosen, number=number, trial_set=TrialSet(trials_of))
        if missing:
            compile_loop(chosen, policy)
        with progress("rig trials", len(missing)) as advance:
            for result, record in run_trials(chosen, policy, missing, jobs=jobs, trial_set=TrialSet(trials_of)):
                runs.write(RUN.format(result.seed), partial(write_rig_run, record))
                done[result.seed] = result
                write_results(runs, done)  # after each, so that they agree with the runs
                advance(f"trial {result.seed}: {result.reason}, {result.time:.1f} s")
        made_by = {"skill": str(skill), **versions()}
        results = finish(runs, done, out, copy, made_by=made_by, scenario=dump_scenario(chosen))
    show_results(results, out)


def copy_of_results(json: Path, out: Path, skill: Path, index: SetIndex) -> Path | None:
    """Returns the checked file of a copy of the results; None where it is the results themselves."""
    from experiments.outputs.output_checks import check_file, require_distinct

    if json.resolve() == (out / RESULTS).resolve():
        return None
    require_distinct({"--skill": skill, **{name: out / name for name in index.names}, "--json": json})
    check_file(json, "trials.json", option="--json")
    return json


def finish(
    runs: OutputSet,
    done: dict[int, TrialResult],
    out: Path,
    copy: Path | None,
    *,
    made_by: dict[str, str],
    scenario: str,
) -> list[TrialResult]:
    """Completes the set of a folder, writes the copy of its results and its report, and returns them in order."""
    from experiments.outputs.output_checks import named_errors
    from interfaces.terminal import write_json

    runs.complete()
    results = [done[number] for number in sorted(done)]
    if copy is not None:
        with named_errors(copy, f"the results are in {out / RESULTS}"):
            write_json(copy, [result.record() for result in results])
    write_report(runs, results, made_by=made_by, scenario=scenario)
    return results


def show_results(results: list[TrialResult], out: Path) -> None:
    """Prints the results, and says where their report is."""
    from interfaces.reports.result_tables import result_summary, result_table
    from interfaces.terminal import say, show

    show(result_table(results))
    for line in result_summary(results):
        say(line)
    say(f"open {out / REPORT}: all trials, and a replay of each")


def read_results(folder: Path) -> list[TrialResult]:
    """Reads the results of the trials in a folder."""
    from json import loads

    from experiments.trial.trial_result import TrialResult

    return [TrialResult.from_record(row) for row in loads((folder / RESULTS).read_bytes())]


def write_results(runs: OutputSet, done: dict[int, TrialResult]) -> None:
    """Writes the results of the trials that are done into their folder."""
    from interfaces.terminal import write_json

    runs.write(RESULTS, lambda path: write_json(path, [done[number].record() for number in sorted(done)]))


def write_report(runs: OutputSet, results: list[TrialResult], *, made_by: dict[str, str], scenario: str) -> None:
    """Writes a replay of each run in a folder, and the report that links them.

    Raises:
        OSError: if one cannot be written. The message names it, and says what is on disk.
    """
    from functools import partial

    from interfaces.reports.replay_page import write_replay
    from interfaces.reports.trials_page import trials_page
    from interfaces.terminal import progress
    from skill.data.files import write_atomically

    replays = {result.seed: REPLAY.format(result.seed) for result in results}
    missing = [number for number, name in replays.items() if not runs.path(name).is_file()]
    with progress("replays", len(missing)) as advance:
        for number in missing:
            run = runs.path(RUN.format(number))
            runs.write(replays[number], partial(write_replay, run, title=f"trial {number}"))
            advance(run.name)
    page = trials_page(
        results,
        title=f"{len(results)} insertions on the rig",
        replays=replays,
        made_by=made_by,
        scenario=scenario,
    )
    runs.write(REPORT, lambda path: write_atomically(path, page.encode()))
