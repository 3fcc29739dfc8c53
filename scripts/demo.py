"""Runs the whole chain: demonstrate, learn, insert; with figures and replays."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scripts.command_line import command, make_app, run_app
from scripts.options import Bad, Jobs, OneOrMoreGood, OutFolder, ScenarioName, Seed, Trials
from scripts.record_demonstrations import record
from scripts.replay import write_replay
from scripts.run_rig import run
from scripts.train_skill import train

if TYPE_CHECKING:
    from models.scenario import Scenario
    from skill.data.demonstration import Demonstration
    from skill.manipulation_skill import ManipulationSkill
    from systems.runs.trial_result import TrialResult

app = make_app()


def demo(*, out: Path, good: int, bad: int, trials: int, seed: int, scenario: str, jobs: int) -> None:
    """Runs the chain and writes everything into the folder ``out``.

    Raises:
        ValueError: if the scenario is not valid, or too few demonstrations come out as requested.
        OSError: if a file cannot be written.
    """
    from skill.data.demonstration import read_demonstration
    from systems.reports.terminal import say

    start_time = time.monotonic()
    recordings = record(
        out=out / "demonstrations", good=good, bad=bad, seed=seed, scenario=scenario, jobs=jobs, overwrite=True
    )
    skill = train(demonstrations=out / "demonstrations", out=out / "skill.npz", seed=seed)
    results = run(
        skill=out / "skill.npz",
        trials=trials,
        seed=seed * trials,
        tilt_deg=None,
        friction=None,
        scenario=scenario,
        out=out / "rig",
        json=None,
        jobs=jobs,
    )
    # The largest starting tilt shows most.
    demonstration = max(recordings, key=lambda path: starting_tilt(read_demonstration(path)))
    hardest = max(results, key=lambda r: (r.inserted, abs(r.tilt[0]) + abs(r.tilt[1])))
    write_pictures(demonstration, hardest, results, skill, out)
    say(f"{time.monotonic() - start_time:.0f} s; in {out}:")
    for path in sorted(out.iterdir()):
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

    from skill.data.demonstration import read_demonstration
    from skill.data.rig_run import read_rig_run
    from skill.figures.paper_figures import plot_demonstration, plot_outcomes, plot_run, save_figure
    from systems.reports.terminal import progress
    from systems.runs.demonstration_run import run_demonstration
    from systems.runs.trial import run_trial
    from systems.visualization.scene import recorded

    run_file = out / "rig" / f"run_{hardest.seed:04d}.parquet"
    with progress("figures and replays", 4) as advance:
        save_figure(plot_demonstration(read_demonstration(demonstration)), out / "fig3_demonstration.png")
        save_figure(plot_run(read_rig_run(run_file)), out / "fig5_insertion.png")
        save_figure(plot_outcomes(pd.DataFrame([r.record() for r in results])), out / "rig_trials.png")
        advance("figures")
        write_replay(demonstration, out / "replay_demonstration.html", skill=out / "skill.npz")
        write_replay(run_file, out / "replay_insertion.html")
        advance("replays")
        with recorded(out / "recording_demonstration.html") as meshcat:
            run_demonstration(scenario_of(read_demonstration(demonstration).metadata), meshcat=meshcat)
        advance("recording of the demonstration")
        with recorded(out / "recording_insertion.html") as meshcat:
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

    Records demonstrations in the virtual environment, discovers the contact states, learns the action in each, and
    inserts on the rig from tilts that the skill has not seen. The rig uses seed x trials as its seed, so that another
    seed gives other trials.

    Reads a scenario. Writes into the folder of `--out` the recordings, the skill, the runs with their report, three
    figures, and replays of one demonstration and one insertion. Replaces what an earlier demo left there.

    For example:

        haptic-skill demo --trials 20 --seed 1 --out out/again
    """
    demo(out=out, good=good, bad=bad, trials=trials, seed=seed, scenario=scenario, jobs=jobs)


if __name__ == "__main__":
    run_app(app)
