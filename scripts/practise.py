"""Improves a skill by practice on the rig, and compares it with the first skill on held-out trials."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scripts.command_line import command, make_app, run_app
from scripts.options import Jobs, OutFile, ScenarioName, Seed, SkillFile

if TYPE_CHECKING:
    from models.scenario import Scenario
    from skill.manipulation_skill import ManipulationSkill
    from systems.runs.practice_rounds import Practice, Round
    from systems.runs.trial_result import TrialResult

app = make_app()


def run(
    *, skill: Path, out: Path, practice: Practice, held_out: int, held_out_seed: int, scenario: str, jobs: int
) -> None:
    """Practises, writes the best skill, and compares it with the first one on held-out trials.

    Raises:
        ValueError: if the skill file or the scenario is not valid.
        OSError: if a file cannot be written.
    """
    import numpy as np
    import pandas as pd

    from models.scenario import dump_scenario, load_scenario
    from skill.figures.paper_figures import save_figure
    from skill.figures.practice_figure import plot_practice
    from skill.manipulation_skill import ManipulationSkill
    from skill.practice.paired_comparison import paired_change
    from systems.reports.practice_report import MEASURES, change_table, check_costs, practice_record, round_table
    from systems.reports.terminal import console, progress, say, write_json
    from systems.runs.practice_rounds import practise
    from systems.runs.provenance import versions

    first = ManipulationSkill.load(skill)
    chosen = load_scenario(scenario)
    rounds: list[Round] = []
    with progress("practice", practice.n_trials) as advance:
        for r in practise(chosen, first, practice, jobs=jobs, advance=advance):
            rounds.append(r)
            r.skill.save(out)  # an interrupted practice keeps the best skill so far
            say(f"round {len(rounds) - 1}: cost of the check {np.mean(r.check.costs):.2f} s")
    console.print(round_table(rounds))
    numbers = list(range(held_out_seed, held_out_seed + held_out))
    with progress("held-out trials", 2 * held_out) as advance:
        before, after = (_run_trials(chosen, s, numbers, jobs, advance) for s in (first, rounds[-1].skill))
    changes = {
        name: paired_change([getattr(r, field) for r in before], [getattr(r, field) for r in after])
        for name, (field, _) in MEASURES.items()
    }
    about = {"versions": versions(), "scenario": dump_scenario(chosen), "practice": asdict(practice)}
    write_json(out.with_suffix(".json"), about | practice_record(rounds, before, after, changes))
    tables = [pd.DataFrame([r.record() for r in results]) for results in (before, after)]
    save_figure(plot_practice(check_costs(rounds), *tables), out.with_suffix(".png"))
    console.print(change_table(changes, before, after))
    say(f"skill in {out}; all trials in {out.with_suffix('.json')}; figure in {out.with_suffix('.png')}")


def _run_trials(
    scenario: Scenario, skill: ManipulationSkill, numbers: list[int], jobs: int, advance: Callable[[str], None]
) -> list[TrialResult]:
    from systems.runs.trial import run_trials

    results = []
    for result, _ in run_trials(scenario, skill, numbers, jobs=jobs):
        results.append(result)
        advance(f"trial {result.seed}: {result.reason}, {result.time:.1f} s")
    return results


@app.command()
@command
def main(
    skill: SkillFile = Path("out/skill.npz"),
    out: OutFile = Path("out/practised.npz"),
    rounds: Annotated[int, typer.Option(min=1, help="Number of rounds of practice.")] = 4,
    starts: Annotated[
        int, typer.Option(min=1, help="Starts per round; each is tried with a perturbation and its opposite.")
    ] = 8,
    checks: Annotated[
        int, typer.Option(min=1, help="Trials on which a new skill must be better than the one before.")
    ] = 8,
    held_out: Annotated[int, typer.Option(min=2, help="Trials on which both skills are compared at the end.")] = 20,
    held_out_seed: Annotated[
        int, typer.Option(min=0, help="Number of the first held-out trial, as `--seed` of `haptic-skill rig`.")
    ] = 1000,
    seed: Seed = 0,
    scenario: ScenarioName = "nominal",
    jobs: Jobs = 2,
) -> None:
    """Improves a skill by practice on the simulated rig.

    In each round the skill varies its turns and its feed, weights the trials by how much better they went than
    expected, and keeps the new skill only if it is better on separate trials. At the end the first and the last skill
    are compared on held-out trials, which share no random draw with practice or demonstrations. The seed is that of
    the practice; held-out trial k uses held-out seed + k.

    Reads a skill and a scenario. Writes the practised skill to the file of `--out`, and beside it a .json with every
    trial and a .png figure.

    For example:

        haptic-skill practise --rounds 2 --starts 4 --held-out 10 --out out/quick.npz
    """
    from systems.runs.practice_rounds import Practice

    run(
        skill=skill,
        out=out,
        practice=Practice(rounds=rounds, starts=starts, checks=checks, seed=seed),
        held_out=held_out,
        held_out_seed=held_out_seed,
        scenario=scenario,
        jobs=jobs,
    )


if __name__ == "__main__":
    run_app(app)
