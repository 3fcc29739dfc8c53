"""The whole chain: demonstrate, learn, insert; with figures and replays."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import typer

from models.scenario import Scenario, parse_scenario
from scripts.record_demonstrations import record
from scripts.run_rig import run
from scripts.train_skill import train
from skill.data.demonstration import Demonstration, read_demonstration
from skill.data.rig_run import read_rig_run
from skill.data.tables import write_atomically
from skill.figures.paper_figures import plot_demonstration, plot_outcomes, plot_run, save_figure
from systems.reports.motion import read_motion
from systems.reports.replay_page import replay_page
from systems.reports.terminal import console, progress, report_errors
from systems.runs.demonstration_run import run_demonstration
from systems.runs.trial import run_trial
from systems.runs.trial_result import TrialResult
from systems.visualization.scene import recorded

app = typer.Typer(add_completion=False)


@report_errors
def demo(*, out: Path, good: int, bad: int, trials: int, seed: int, scenario: str, jobs: int) -> None:
    """Runs the chain into the folder ``out``."""
    began = time.monotonic()
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
    # The picture is worth most where the start was worst.
    shown = max(recordings, key=lambda path: starting_tilt(read_demonstration(path)))
    hardest = max(results, key=lambda r: (r.inserted, abs(r.tilt[0]) + abs(r.tilt[1])))
    run_file = out / "rig" / f"run_{hardest.seed:04d}.parquet"
    with progress("figures and replays", 4) as advance:
        draw(shown, run_file, results, out)
        advance("figures")
        write_replays(shown, run_file, out)
        advance("replays")
        with recorded(out / "recording_demonstration.html") as meshcat:
            run_demonstration(scenario_of(read_demonstration(shown).metadata), meshcat=meshcat)
        advance("recording of the demonstration")
        with recorded(out / "recording_insertion.html") as meshcat:
            run_trial(scenario_of(read_rig_run(run_file).metadata), skill, seed=hardest.seed, meshcat=meshcat)
        advance("recording of the insertion")
    console.print(f"{time.monotonic() - began:.0f} s; in {out}:")
    for path in sorted(out.iterdir()):
        console.print(f"  {path.name}{'/' if path.is_dir() else ''}")


def starting_tilt(demonstration: Demonstration) -> float:
    """Radians at the first sample of a good demonstration; 0 for a bad one."""
    return demonstration.good * float(demonstration.samples["angle"].iloc[0])


def scenario_of(metadata: dict[str, Any]) -> Scenario:
    """The resolved scenario that is stored beside a demonstration or a run: what made it can make it again."""
    return parse_scenario(metadata["scenario"], "stored scenario")


def draw(demonstration: Path, run_file: Path, results: list[TrialResult], out: Path) -> None:
    """The paper's Fig. 3 and Fig. 5, and all trials."""
    save_figure(plot_demonstration(read_demonstration(demonstration)), out / "fig3_demonstration.png")
    save_figure(plot_run(read_rig_run(run_file)), out / "fig5_insertion.png")
    save_figure(plot_outcomes(pd.DataFrame([r.record() for r in results])), out / "rig_trials.png")


def write_replays(demonstration: Path, run_file: Path, out: Path) -> None:
    """One page each, from the stored files alone."""
    for path, skill, name in (
        (demonstration, out / "skill.npz", "replay_demonstration"),
        (run_file, None, "replay_insertion"),
    ):
        page = replay_page(read_motion(path, skill), title=path.stem)
        write_atomically(out / f"{name}.html", page.encode())


@app.command()
def main(
    out: Annotated[Path, typer.Option(help="Folder for everything that the demo makes.")] = Path("out"),
    good: Annotated[int, typer.Option(min=1, help="Good demonstrations.")] = 24,
    bad: Annotated[int, typer.Option(min=0, help="Bad demonstrations.")] = 6,
    trials: Annotated[int, typer.Option(min=1, help="Insertions on the rig.")] = 10,
    seed: Annotated[int, typer.Option(min=0, help="Another seed: other operators, starts and trials.")] = 0,
    scenario: Annotated[
        str, typer.Option(help="Name of a scenario in models/scenarios, or the path of your own YAML file.")
    ] = "nominal",
    jobs: Annotated[int, typer.Option(min=1, help="Processes to use.")] = 2,
) -> None:
    """Demonstrate, learn, insert: the whole chain, in a few minutes.

    Records demonstrations in the virtual environment, discovers the contact states, learns what to do in each, and
    inserts on the rig from tilts it has never seen. Leaves recordings, skill, runs, two figures and two replays.

    Example: python -m scripts.demo --trials 20 --seed 1 --out out/again
    """
    demo(out=out, good=good, bad=bad, trials=trials, seed=seed, scenario=scenario, jobs=jobs)


if __name__ == "__main__":
    app()
