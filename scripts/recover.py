"""Lets a skill practise, has shown what it could not do, and trains it again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scripts.command_line import command, make_app, run_app
from scripts.options import Jobs, OutFile, Overwrite, ScenarioName, Seed, SkillFile, parse_path

app = make_app()


@app.command()
@command
def main(
    skill: SkillFile = Path("out/skill.npz"),
    demonstrations: Annotated[
        Path, typer.Option(parser=parse_path, metavar="FOLDER", help="Recordings that the skill was trained with.")
    ] = Path("out/demonstrations"),
    recoveries: Annotated[
        Path, typer.Option(parser=parse_path, metavar="FOLDER", help="Folder to write the recoveries into.")
    ] = Path("out/recoveries"),
    out: OutFile = Path("out/recovered.npz"),
    rounds: Annotated[int, typer.Option(min=1, max=100, help="Rounds of practice, recoveries and training.")] = 2,
    practice: Annotated[int, typer.Option(min=1, max=10_000, help="Practice trials in each round.")] = 24,
    most: Annotated[int, typer.Option(min=1, max=1000, help="Recoveries in each round, at most.")] = 10,
    ask: Annotated[
        bool, typer.Option("--ask", help="Only say which situations the skill wants shown; write nothing.")
    ] = False,
    json: Annotated[
        Path | None,
        typer.Option(
            parser=parse_path,
            metavar="FILE",
            help="With --ask: write what it asks for, for `record --live --asked FILE`.",
        ),
    ] = None,
    seed: Seed = 0,
    scenario: ScenarioName = "nominal",
    jobs: Jobs = 2,
    overwrite: Overwrite = False,
) -> None:
    """Lets a skill practise, has shown what it could not do, and trains it again.

    A skill that imitates gets into situations that nobody has shown. In each round it performs practice trials on the
    rig. Where it backs off for the first time in a trial, the simulated operator takes over in the virtual environment,
    in the same pose and with the same senses as in a demonstration. These recoveries become part of the demonstrations,
    from which a skill of the same policy and number of contexts is trained.
    The seed is that of the demonstrations, whose operators take over, of the practice, and of the clustering.

    Reads a skill, its demonstrations and a scenario. Writes the recoveries of round k into the folder round_k of
    `--recoveries`, and the skill to the file of `--out` after each round. Given again after an interruption, it repeats
    the practice trials and keeps the recoveries.

    For example:

        haptic-skill recover --rounds 1 --practice 12 --out out/quick.npz
    """
    from systems.sessions.recovery_session import RecoveryPlan, ask_only, recover

    plan = RecoveryPlan(rounds=rounds, trials=practice, most=most, seed=seed)
    if ask:
        ask_only(skill=skill, plan=plan, scenario=scenario, json=json, jobs=jobs)
        return
    if json is not None:
        raise typer.BadParameter("--json needs --ask")
    recover(
        skill=skill,
        demonstrations=demonstrations,
        recoveries=recoveries,
        out=out,
        plan=plan,
        scenario=scenario,
        jobs=jobs,
        overwrite=overwrite,
    )


if __name__ == "__main__":
    run_app(app)
