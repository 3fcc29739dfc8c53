"""Runs the whole chain: demonstrate, learn, correct, insert; with figures and replays."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scripts.command_line import command, make_app
from scripts.options import Bad, Jobs, OneOrMoreGood, OutFolder, ScenarioName, Seed, Trials

if TYPE_CHECKING:
    from experiments.trial_result import TrialResult
    from models.scenario import Scenario
    from skill.data.demonstration import Demonstration
    from skill.manipulation_skill import ManipulationSkill

app = make_app()

PRACTICE_TRIALS, CORRECTIONS = 16, 8
SKILL, UNFINISHED = "skill.npz", ".unfinished-demo.json"
PICTURES = (
    *("fig3_demonstration.png", "fig5_insertion.png", "rig_trials.png"),
    *("replay_demonstration.html", "replay_insertion.html"),
    *("recording_demonstration.html", "recording_insertion.html"),
)
PICTURE_SIZE = 3_000_000  # bytes, about


def demo(*, out: Path, good: int, bad: int, trials: int, seed: int, scenario: str, jobs: int) -> None:
    """Runs the chain and writes everything into the folder ``out``.

    Raises:
        ValueError: if the scenario is not valid, or too few demonstrations come out as requested.
        OSError: if a file cannot be written.
    """
    from experiments.outputs.folder_lock import locked_file, locked_folder
    from experiments.outputs.output_checks import RECORDING_SIZE, check_file, check_folder, named_errors
    from experiments.outputs.output_set import check_set, is_begun
    from experiments.outputs.own_folder import remove_unfinished
    from experiments.trial import Arm
    from interfaces.terminal import say
    from scripts.correction_session import CorrectionPlan, correct
    from scripts.record_session import plan_recording, record
    from scripts.rig_session import rig_index, run
    from scripts.train_session import train
    from skill.data.demonstration import read_demonstration
    from skill.data.tables import write_atomically

    start_time = time.monotonic()
    recorded, corrected, inserted, first = out / "demonstrations", out / "corrections", out / "rig", seed * trials
    plan = plan_recording(out=recorded, good=good, bad=bad, seed=seed, scenario=scenario)
    runs = rig_index(plan.scenario, trials=trials, seed=first, skill=b"")
    check_folder(out, size=len(PICTURES) * PICTURE_SIZE + (good + bad + trials) * RECORDING_SIZE)
    for name in (SKILL, *PICTURES):
        check_file(out / name, Path(name).suffix)
    with ExitStack() as locks:
        for folder in (out, recorded, inserted):
            locks.enter_context(locked_folder(folder))
        locks.enter_context(locked_file(out / SKILL))
        check_set(recorded, plan.index, overwrite=True)
        check_set(inserted, runs, overwrite=True)
        remove_unfinished(out, (*PICTURES, UNFINISHED))
        request = json.dumps({**(plan.index.request or {}), "trials": trials}).encode()
        goes_on = (out / UNFINISHED).is_file() and (out / UNFINISHED).read_bytes() == request
        write_atomically(out / UNFINISHED, request)
        recordings = record(
            out=recorded,
            good=good,
            bad=bad,
            seed=seed,
            scenario=scenario,
            jobs=jobs,
            overwrite=not (goes_on and is_begun(recorded, plan.index)),
        )
        train(demonstrations=[recorded], out=out / SKILL, seed=seed)
        skill = correct(
            skill=out / SKILL,
            demonstrations=recorded,
            corrections=corrected,
            out=out / SKILL,
            plan=CorrectionPlan(rounds=1, trials=PRACTICE_TRIALS, most=CORRECTIONS, seed=seed),
            scenario=scenario,
            jobs=jobs,
            overwrite=not goes_on,
        )
        runs = rig_index(plan.scenario, trials=trials, seed=first, skill=(out / SKILL).read_bytes())
        results = run(
            skill=out / SKILL,
            trials=trials,
            seed=first,
            tilt_deg=None,
            friction=None,
            arm=Arm.DEFAULT,
            scenario=scenario,
            out=inserted,
            json=None,
            jobs=jobs,
            overwrite=not (goes_on and is_begun(inserted, runs)),
        )
        # The largest starting tilt shows most.
        demonstration = max(recordings, key=lambda path: starting_tilt(read_demonstration(path)))
        hardest = max(results, key=lambda r: (r.inserted, abs(r.tilt[0]) + abs(r.tilt[1])))
        with named_errors(out, "the recordings, the skill and the runs are complete"):
            write_pictures(demonstration, hardest, results, skill, out)
        (out / UNFINISHED).unlink()
        say(f"{time.monotonic() - start_time:.0f} s; in {out}:")
        for path in sorted(out.glob("[!.]*")):
            say(f"  {path.name}{'/' if path.is_dir() else ''}")


def starting_tilt(demonstration: Demonstration) -> float:
    """Tilt at the first sample of a good demonstration, rad; 0 for a bad one."""
    return demonstration.good * float(demonstration.samples["angle"].iloc[0])


def scenario_of(metadata: Mapping[str, Any]) -> Scenario:
    """The resolved scenario that is stored with a demonstration or a run, which reproduces it."""
    from models.scenario import parse_scenario

    return parse_scenario(metadata["scenario"], "stored scenario")


def write_pictures(
    demonstration: Path, hardest: TrialResult, results: Sequence[TrialResult], skill: ManipulationSkill, out: Path
) -> None:
    """Writes figures (Fig. 3 and Fig. 5 of the paper, and all trials), replays and Meshcat recordings.

    They show one demonstration and the hardest insertion.
    """
    import pandas as pd

    from experiments.demonstration_run import run_demonstration
    from experiments.trial import run_trial
    from interfaces.reports.replay_page import write_replay
    from interfaces.terminal import progress
    from skill.data.demonstration import read_demonstration
    from skill.data.rig_run import read_rig_run
    from skill.figures.paper_figures import plot_demonstration, plot_outcomes, plot_run, save_figure
    from systems.visualization.meshcat_scene import recorded

    run_file = out / "rig" / f"run_{hardest.seed:04d}.parquet"
    with progress("figures and replays", 4) as advance:
        save_figure(plot_demonstration(read_demonstration(demonstration)), out / "fig3_demonstration.png")
        save_figure(plot_run(read_rig_run(run_file)), out / "fig5_insertion.png")
        save_figure(plot_outcomes(pd.DataFrame([r.record() for r in results])), out / "rig_trials.png")
        advance("figures")
        write_replay(demonstration, out / "replay_demonstration.html", skill=out / SKILL)
        write_replay(run_file, out / "replay_insertion.html")
        advance("replays")
        with recorded(out / "recording_demonstration.html") as meshcat:
            run_demonstration(scenario_of(read_demonstration(demonstration).metadata), meshcat=meshcat)
        advance("recording of the demonstration")
        with recorded(out / "recording_insertion.html", states=skill.state_names()) as meshcat:
            run_trial(scenario_of(read_rig_run(run_file).metadata), skill, seed=hardest.seed, meshcat=meshcat)
        advance("recording of the insertion")


@app.command()
@command
def main(
    out: OutFolder = Path("out"),
    good: OneOrMoreGood = 24,
    bad: Bad = 6,
    trials: Trials = 10,
    seed: Seed = 0,
    scenario: ScenarioName = "nominal",
    jobs: Jobs = 2,
) -> None:
    """Demonstrates, learns and inserts: the whole chain, in a few minutes.

    Records demonstrations in the virtual environment, discovers the contact states, learns the action in each, has
    shown what the skill could not do in practice, and inserts on the rig from tilts that it has not seen. The rig uses
    seed x trials as its seed, so that another seed gives other trials.

    Reads a scenario. Writes into the folder of `--out` the recordings, the skill, the runs with their report, three
    figures, and replays of one demonstration and one insertion. Replaces what an earlier demo left there, once the new
    recordings and runs are complete; never other files, and never live recordings. Goes on after an interruption.

    For example:

        haptic-skill demo --trials 20 --seed 1 --out out/again
    """
    demo(out=out, good=good, bad=bad, trials=trials, seed=seed, scenario=scenario, jobs=jobs)


if __name__ == "__main__":
    app()
