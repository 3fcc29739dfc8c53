"""Improves a skill by practice on the rig, and compares it with the first skill on held-out trials."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scripts.command_line import command, make_app
from scripts.options import MAX_SEED, Jobs, OutFile, ScenarioName, Seed, SkillFile

app = make_app()

MAX_NUMBER = 10_000  # of rounds and trials


@app.command()
@command
def main(
    skill: SkillFile = Path("out/skill.npz"),
    out: OutFile = Path("out/practised.npz"),
    rounds: Annotated[int, typer.Option(min=1, max=MAX_NUMBER, help="Number of rounds of practice.")] = 4,
    starts: Annotated[
        int,
        typer.Option(
            min=1, max=MAX_NUMBER, help="Starts per round; each is tried with a perturbation and its opposite."
        ),
    ] = 8,
    checks: Annotated[
        int,
        typer.Option(min=1, max=MAX_NUMBER, help="Trials on which a new skill must be better than the one before."),
    ] = 8,
    held_out: Annotated[
        int, typer.Option(min=2, max=MAX_NUMBER, help="Trials on which both skills are compared at the end.")
    ] = 20,
    held_out_seed: Annotated[
        int,
        typer.Option(
            min=0, max=MAX_SEED, help="Number of the first held-out trial, as `--seed` of `haptic-skill rig`."
        ),
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
    trial and a .png figure. Until then the finished trials and the best skill so far are in a folder beside it, whose
    name ends in .unfinished; given again after an interruption, it goes on from there.

    For example:

        haptic-skill practise --rounds 2 --starts 4 --held-out 10 --out out/quick.npz
    """
    from experiments.practice_rounds import Practice
    from scripts.practice_session import run

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
