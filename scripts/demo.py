"""Runs the whole chain: demonstrate, learn, correct, insert; with figures and replays."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from scripts import rig
from scripts.command_line import (
    SHIPPED,
    Bad,
    Engine,
    Jobs,
    OneOrMoreGood,
    OutFolder,
    ScenarioName,
    Seed,
    Trials,
    Verbose,
    read_scenario,
    trial_numbers,
)
from scripts.compilation import begin_trial
from scripts.correct import correct_simulated
from scripts.record import record
from scripts.train import train

if TYPE_CHECKING:
    from experiments.trial.trial_result import TrialResult

PRACTICE_TRIALS, CORRECTIONS = 16, 8
SKILL, UNFINISHED = "skill.npz", ".unfinished-demo.json"
PICTURES = (*("fig3_demonstration.png", "fig5_insertion.png", "rig_trials.png", "replay_demonstration.html"),)


def main(
    out: OutFolder = Path("out"),
    good: OneOrMoreGood = 24,
    bad: Bad = 6,
    trials: Trials = 10,
    seed: Seed = 0,
    scenario: ScenarioName = "nominal",
    engine: Engine = None,
    jobs: Jobs = 2,
    verbose: Verbose = False,
) -> None:
    """Demonstrates, learns and inserts: the whole chain, in a few minutes.

    Records demonstrations in the virtual environment, discovers the contact states, learns the action in each, collects
    corrections where the skill gets stuck in practice, and inserts on the rig from tilts that it has not seen. The rig
    uses seed x trials as its seed, so that another seed gives other trials. Without --engine the demonstrations are
    made in the contact of the scenario, and all that follows on rigid bodies, which take a tenth of the time.

    Reads a scenario. Writes into the folder of `--out` the recordings, the skill, the runs with their report and
    replays, three figures and a replay of one demonstration. Replaces what an earlier demo left there, once the new
    recordings and runs are complete; never other files, and never live recordings. Goes on after an interruption.

    For example:

        haptic-skill demo --trials 20 --seed 1 --out out/again
    """
    import json
    import os
    import time
    from contextlib import ExitStack
    from multiprocessing import get_context

    from experiments.corrections import CorrectionPlan
    from experiments.outputs.folder_lock import locked_file, locked_folder, remove_unfinished
    from experiments.outputs.output_checks import RECORDING_SIZE, REPORT_SIZE, check_file, check_folder, named_errors
    from experiments.outputs.output_set import DEMONSTRATIONS, RUNS, SetIndex, check_set
    from experiments.provenance import versions
    from interfaces.reports.result_tables import result_summary, result_table, state_table
    from interfaces.terminal import busy, only_progress, say, show
    from models.scenario import dump_scenario
    from skill.data.files import write_atomically
    from skill.manipulation_skill import ManipulationSkill

    start_time, performed_in, numbers = time.monotonic(), engine or "exact", trial_numbers(seed * trials, trials)
    recorded, inserted, skill_file, state_file = out / "demonstrations", out / "rig", out / SKILL, out / UNFINISHED
    text = dump_scenario(read_scenario(scenario, engine))
    request = {**{"good": good, "bad": bad, "trials": trials, "seed": seed}, "scenario": text, "versions": versions()}
    size = (good + bad) * RECORDING_SIZE + trials * REPORT_SIZE
    check_folder(out, size=len(PICTURES) * REPORT_SIZE + size)
    for name in (SKILL, *PICTURES):
        check_file(out / name, Path(name).suffix)
    with ExitStack() as stack:
        for folder, kind in ((out, None), (recorded, DEMONSTRATIONS), (inserted, RUNS)):
            stack.enter_context(locked_folder(folder))
            if kind is not None:
                check_set(folder, SetIndex(kind, {}), overwrite=True)
        stack.enter_context(locked_file(skill_file))
        remove_unfinished(out, (*PICTURES, UNFINISHED))
        state = json.loads(state_file.read_bytes()) if state_file.is_file() else {}
        finished = state["finished"] if state.get("request") == request else []

        def finish(step: str) -> None:
            """Notes that a step is complete; an interrupted demo does not repeat it."""
            finished.append(step)
            write_atomically(state_file, json.dumps({"request": request, "finished": finished}).encode())

        finish("start")
        beside = get_context("spawn").Process(target=compile_beside, args=(scenario, os.getpid()), daemon=True)
        if "skill" not in finished and performed_in == "exact":
            beside.start()
        with ExitStack() if verbose else only_progress():
            is_old = "record" not in finished
            recordings = record(
                recorded, good, bad, seed, scenario, jobs, engine=engine, overwrite=is_old, verbose=verbose
            )
            finish("record")
            if "skill" not in finished:
                train([recorded], out=skill_file, seed=seed)
                if performed_in == "exact":
                    with busy("compiling the loop of the trials, once on this machine"):
                        beside.join()
                plan = CorrectionPlan(rounds=1, trials=PRACTICE_TRIALS, most=CORRECTIONS, seed=seed)
                files = (skill_file, recorded, out / "corrections", skill_file)
                correct_simulated(*files, plan, scenario=scenario, engine=performed_in, jobs=jobs, overwrite=True)
                finish("skill")
            rig.main(
                skill_file,
                trials,
                numbers.start,
                scenario=scenario,
                engine=performed_in,
                out=inserted,
                jobs=jobs,
                overwrite="rig" not in finished,
            )
            finish("rig")
        skill, results = ManipulationSkill.load(skill_file), rig.read_results(inserted)
        # The largest starting tilt shows most.
        demonstration = max(recordings, key=starting_tilt)
        hardest = max(results, key=lambda r: (r.inserted, abs(r.tilt[0]) + abs(r.tilt[1])))
        with named_errors(out, "the recordings, the skill and the runs are complete"):
            write_pictures(demonstration, hardest, results, out)
        state_file.unlink()
    if not verbose:
        show(state_table(skill))
        show(result_table(results))
    for line in result_summary(results):
        say(line)
    say(f"{time.monotonic() - start_time:.0f} s; figures, recordings and the skill are in {out}. Open")
    say(f"  {inserted / rig.REPORT}: all trials, and a replay of each")
    say(f"  {inserted / rig.REPLAY.format(hardest.seed)}: the insertion from the largest tilt")
    say(f"  {out / 'replay_demonstration.html'}: a demonstration")


def compile_beside(scenario: str, parent: int) -> None:
    """Compiles the loop in a process of its own, while demonstrations are recorded, with the shipped skill."""
    from contextlib import suppress

    from experiments.worker_pool import watch_parent
    from skill.manipulation_skill import ManipulationSkill

    watch_parent(parent)
    with suppress(ValueError):  # the skill is for another part; the loop is compiled with the new one
        begin_trial(read_scenario(scenario, "exact"), ManipulationSkill.load(SHIPPED))


def starting_tilt(recording: Path) -> float:
    """Tilt at the first sample of a good demonstration, rad; 0 for a bad one."""
    from skill.data.demonstration import read_demonstration

    demonstration = read_demonstration(recording)
    return demonstration.good * float(demonstration.samples["angle"].iloc[0])


def write_pictures(demonstration: Path, hardest: TrialResult, results: Sequence[TrialResult], out: Path) -> None:
    """Writes figures (Fig. 3 and Fig. 5 of the paper, and all trials), and a replay.

    They show one demonstration and the hardest insertion.
    """
    import pandas as pd

    from interfaces.reports.replay_page import write_replay
    from interfaces.terminal import progress
    from skill.data.demonstration import read_demonstration
    from skill.data.rig_run import read_rig_run
    from skill.figures.paper_figures import plot_demonstration, plot_outcomes, plot_run, save_figure

    shown = read_demonstration(demonstration)
    run = read_rig_run(out / "rig" / rig.RUN.format(hardest.seed))
    with progress("figures and a replay", 2) as advance:
        save_figure(plot_demonstration(shown), out / "fig3_demonstration.png")
        save_figure(plot_run(run), out / "fig5_insertion.png")
        save_figure(plot_outcomes(pd.DataFrame([r.record() for r in results])), out / "rig_trials.png")
        advance("figures")
        write_replay(demonstration, out / "replay_demonstration.html", skill=out / SKILL)
        advance("replay of the demonstration")
