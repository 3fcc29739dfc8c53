"""Lets the robot practise: it varies its skill on the rig, keeps what went well, and is measured on other trials."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer
from rich.box import SIMPLE
from rich.table import Table

from models.scenario import Scenario, dump_scenario, load_scenario
from skill.figures.paper_figures import save_figure
from skill.figures.practice_figure import plot_practice
from skill.manipulation_skill import ManipulationSkill
from skill.practice.paired_comparison import PairedChange, paired_change
from systems.reports.terminal import console, progress, report_errors, write_json
from systems.runs.practice_rounds import Practice, Round, practise
from systems.runs.provenance import versions
from systems.runs.trial import run_trials
from systems.runs.trial_result import TrialResult

app = typer.Typer(add_completion=False)

MEASURES = {  # key in the JSON file: field of a result, and its title
    "time_s": ("time", "time (s)"),
    "peak_lateral_n": ("peak_lateral_force", "peak force across (N)"),
    "peak_axial_n": ("peak_axial_force", "peak force along (N)"),
}
WORTHWHILE = 0.20  # a change of a median that is called one, if its interval leaves out zero


def round_table(rounds: list[Round]) -> Table:
    """One row a round: what was tried, and what the check said."""
    table = Table(title="practice", box=SIMPLE, padding=(0, 1, 0, 0))
    for name in ("round", "tried", "inserted", "check cost (s)", "inserted", ""):
        table.add_column(name, justify="right")
    for number, r in enumerate(rounds):
        tried = [str(len(r.practised)), str(sum(p.inserted for p in r.practised))] if number else ["", ""]
        verdict = "as it was" if not number else "[green]kept[/]" if r.kept else "[red]discarded[/]"
        table.add_row(
            str(number),
            *tried,
            f"{np.mean(r.check.costs):.2f}",
            f"{sum(c.inserted for c in r.check.results)} of {len(r.check.results)}",
            verdict,
        )
    table.caption = "mean cost of a check trial: its time, and time's worth of the force across"
    return table


def change_table(changes: dict[str, PairedChange], before: list[TrialResult], after: list[TrialResult]) -> Table:
    """Held-out trials before and after, medians over all of them, inserted or not."""
    table = Table(title=f"{len(before)} held-out trials, median", box=SIMPLE, padding=(0, 1, 0, 0))
    table.add_column("")
    for name in ("before", "after", "change", "95 % interval", "p (Wilcoxon)"):
        table.add_column(name, justify="right")
    for name, change in changes.items():
        table.add_row(
            MEASURES[name][1],
            *(f"{change.before:.2f}", f"{change.after:.2f}", f"{100 * change.change:+.0f} %"),
            f"{100 * change.lower:+.0f} to {100 * change.upper:+.0f} %",
            f"{change.p_value:.2g}",
        )
    table.add_row("inserted", str(sum(r.inserted for r in before)), str(sum(r.inserted for r in after)), "", "", "")
    fell = [MEASURES[n][1].split(" (")[0] for n, c in changes.items() if c.change <= -WORTHWHILE and c.upper < 0]
    rose = [MEASURES[n][1].split(" (")[0] for n, c in changes.items() if c.change >= WORTHWHILE and c.lower > 0]
    share = f"{100 * WORTHWHILE:.0f} %"
    table.caption = f"fell by {share} or more: {', '.join(fell) or 'nothing'}" + (
        f"; rose by {share} or more: {', '.join(rose)}" if rose else ""
    )
    return table


@report_errors
def run(
    *,
    skill: Path,
    out: Path,
    practice: Practice,
    held_out: int,
    held_out_seed: int,
    scenario: str,
    jobs: int,
) -> dict[str, PairedChange]:
    """Practises, saves the best skill, and measures it against the one that began."""
    began = ManipulationSkill.load(skill)
    chosen = load_scenario(scenario)
    rounds: list[Round] = []
    with progress("practice", practice.n_trials) as advance:
        for r in practise(chosen, began, practice, jobs=jobs, advance=advance):
            rounds.append(r)
            r.skill.save(out)  # whoever interrupts keeps what has been learnt
            console.print(f"round {len(rounds) - 1}: cost of the check {np.mean(r.check.costs):.2f} s")
    console.print(round_table(rounds))
    learnt = rounds[-1].skill
    numbers = list(range(held_out_seed, held_out_seed + held_out))
    with progress("held-out trials", 2 * held_out) as advance:
        before, after = (_measured(chosen, s, numbers, jobs, advance) for s in (began, learnt))
    changes = {
        name: paired_change([getattr(r, field) for r in before], [getattr(r, field) for r in after])
        for name, (field, _) in MEASURES.items()
    }
    write_json(out.with_suffix(".json"), _record(chosen, practice, rounds, before, after, changes))
    figure = plot_practice(
        _checks(rounds), *(pd.DataFrame([r.record() for r in results]) for results in (before, after))
    )
    save_figure(figure, out.with_suffix(".png"))
    console.print(change_table(changes, before, after))
    console.print(f"skill in {out}; every trial in {out.with_suffix('.json')}, drawn in {out.with_suffix('.png')}")
    return changes


def _measured(
    scenario: Scenario, skill: ManipulationSkill, numbers: list[int], jobs: int, advance: Callable[[str], None]
) -> list[TrialResult]:
    results = []
    for result, _ in run_trials(scenario, skill, numbers, jobs=jobs):
        results.append(result)
        advance(f"trial {result.seed}: {result.reason}, {result.time:.1f} s")
    return results


def _checks(rounds: list[Round]) -> pd.DataFrame:
    return pd.DataFrame(
        [{"round": k, "kept": r.kept, "cost": cost} for k, r in enumerate(rounds) for cost in r.check.costs]
    )


def _record(
    scenario: Scenario,
    practice: Practice,
    rounds: list[Round],
    before: list[TrialResult],
    after: list[TrialResult],
    changes: dict[str, PairedChange],
) -> dict[str, Any]:
    return {
        "versions": versions(),
        "scenario": dump_scenario(scenario),
        "practice": asdict(practice),
        "rounds": [
            {
                "kept": r.kept,
                "practised": [p.record() for p in r.practised],
                "checks": [
                    {"cost_s": round(c, 3), **p.record()} for p, c in zip(r.check.results, r.check.costs, strict=True)
                ],
            }
            for r in rounds
        ],
        "held_out": {
            "changes": {name: asdict(change) for name, change in changes.items()},
            "trials": [
                {"seed": b.seed, "before": b.record(), "after": a.record()} for b, a in zip(before, after, strict=True)
            ],
        },
    }


@app.command()
def main(
    skill: Annotated[Path, typer.Option(help="A skill file of train_skill, to begin with.")] = Path("out/skill.npz"),
    out: Annotated[
        Path, typer.Option(help="The practised skill's file; beside it a .json with every trial, and a .png.")
    ] = Path("out/practised.npz"),
    rounds: Annotated[int, typer.Option(min=1, help="Rounds of practice.")] = 4,
    starts: Annotated[int, typer.Option(min=1, help="Starts in a round, each tried one way and the opposite.")] = 8,
    checks: Annotated[
        int, typer.Option(min=1, help="Trials on which the skill of a round must beat the one before.")
    ] = 8,
    held_out: Annotated[int, typer.Option(min=2, help="Trials for before and after, made with both skills.")] = 20,
    held_out_seed: Annotated[
        int, typer.Option(min=0, help="Number of the first held-out trial, as run_rig numbers them.")
    ] = 1000,
    seed: Annotated[int, typer.Option(min=0, help="Of the practice: other starts, other variations.")] = 0,
    scenario: Annotated[
        str, typer.Option(help="Name of a scenario in models/scenarios, or the path of your own YAML file.")
    ] = "nominal",
    jobs: Annotated[int, typer.Option(min=1, help="Processes to use.")] = 2,
) -> None:
    """Let the robot learn from its own performance.

    In each round it varies how far it turns and how fast it feeds, remembers what was tried by how much better it went
    than expected, and keeps the new skill only if it does better on trials of their own. Then the skill before and
    after is measured on held-out trials: neither practice nor demonstrations share a random draw with them.

    Example: python -m scripts.practise --rounds 2 --starts 4 --held-out 10 --out out/quick.npz
    """
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
    app()
