"""The whole chain: demonstrate, learn, insert; with figures and replays."""

from __future__ import annotations

import copy
import time
from pathlib import Path
from typing import Annotated

import typer
from skill.figures import plot_demonstration, plot_run, save_figure

from models.scenario import DEMONSTRATION_STREAM, load_scenario, resolve_scenario
from scripts.console import console, says_what_is_wrong
from scripts.record_demonstrations import record
from scripts.run_rig import run
from scripts.train_skill import train
from skill.rig_run import read_rig_run
from systems.demonstrate import run_demonstration
from systems.trial import run_trial, trial_scenario
from systems.visualization import recorded

app = typer.Typer(add_completion=False)


@says_what_is_wrong
def demo(*, out: Path, good: int, bad: int, trials: int, seed: int, scenario: str, jobs: int) -> None:
    """Runs the chain into the folder ``out``."""
    began = time.monotonic()
    folder = out / "demonstrations"
    made = record(out=folder, good=good, bad=bad, seed=seed, scenario=scenario, jobs=jobs, overwrite=True)
    skill = train(demonstrations=folder, out=out / "skill.npz", seed=seed)
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
    shown = max(made, key=lambda d: d.good * float(d.samples["angle"].iloc[0]))
    hardest = max(results, key=lambda r: (r.inserted, abs(r.tilt_deg[0]) + abs(r.tilt_deg[1])))
    with console.status("figures and replays"):
        save_figure(plot_demonstration(shown), out / "fig3_demonstration.png")
        record_of_run = read_rig_run(out / "rig" / f"run_{hardest.seed:04d}.parquet")
        save_figure(plot_run(record_of_run, skill.state_names()), out / "fig5_insertion.png")
        chosen = load_scenario(scenario)
        person = copy.deepcopy(chosen)
        person.operator.habit = shown.metadata["habit"]
        start = resolve_scenario(person, seed=shown.metadata["number"], stream=DEMONSTRATION_STREAM)
        with recorded(out / "replay_demonstration.html") as meshcat:
            run_demonstration(start, meshcat=meshcat)
        with recorded(out / "replay_insertion.html") as meshcat:
            run_trial(trial_scenario(chosen, number=hardest.seed), skill, seed=hardest.seed, meshcat=meshcat)
    console.print(
        f"in {out}: demonstrations/, skill.npz, rig/, fig3_demonstration.png, fig5_insertion.png,"
        f" replay_demonstration.html, replay_insertion.html ({time.monotonic() - began:.0f} s)"
    )


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
