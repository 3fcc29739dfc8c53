"""Lets a skill practise, has shown what it could not do, and trains it again."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from scripts.command_line import command, make_app
from scripts.options import Driver, Host, Jobs, OutFile, Overwrite, Port, ScenarioName, Seed, SkillFile, parse_path

app = make_app()


@app.command()
@command
def main(
    skill: SkillFile = Path("out/skill.npz"),
    demonstrations: Annotated[
        Path, typer.Option(parser=parse_path, metavar="FOLDER", help="Recordings that the skill was trained with.")
    ] = Path("out/demonstrations"),
    corrections: Annotated[
        Path | None,
        typer.Option(
            parser=parse_path,
            metavar="FOLDER",
            help="Folder to write the corrections into.",
            show_default="out/corrections, with --live out/live_corrections",
        ),
    ] = None,
    out: OutFile = Path("out/corrected.npz"),
    rounds: Annotated[
        int | None,
        typer.Option(
            min=1, max=100, help="Rounds of practice, corrections and training.", show_default="2, with --live 1"
        ),
    ] = None,
    practice: Annotated[int, typer.Option(min=1, max=10_000, help="Practice trials in each round.")] = 24,
    most: Annotated[
        int | None,
        typer.Option(min=1, max=1000, help="Corrections in each round, at most.", show_default="10, with --live 3"),
    ] = None,
    live: Annotated[
        bool, typer.Option("--live", help="Show the corrections yourself, in the browser, and see the rig do it.")
    ] = False,
    ask: Annotated[
        bool, typer.Option("--ask", help="Only say which query states the skill wants shown; write nothing.")
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
    driver: Driver = None,
    host: Host = None,
    port: Port = None,
) -> None:
    """Lets a skill practise, has shown what it could not do, and trains it again.

    A skill that imitates gets into query states that nobody has shown. In each round it performs practice trials on
    the rig. Where it backs off for the first time in a trial, the simulated operator takes over in the virtual
    environment, in the same pose and with the same senses as in a demonstration. These corrections become part of the
    demonstrations, from which a skill of the same policy and number of contexts is trained.
    The seed is that of the demonstrations, whose operators take over, of the practice, and of the clustering.

    Reads a skill, its demonstrations and a scenario. Writes the corrections of round k into the folder round_k
    of `--corrections`, and the skill to the file of `--out` after each round. Given again after an interruption, it
    repeats the practice trials and keeps the corrections.

    With `--live` all happens on one page in the browser: the skill practises; you demonstrate from each pose in which
    it was stuck (Space starts, G/B/X, N skips, Q quits); it is trained again; and the rig performs those trials with
    the new skill. Live corrections have a folder of their own, which no command replaces; the skill learns from all.

    For example:

        haptic-skill correct --rounds 1 --practice 12 --out out/quick.npz

        haptic-skill correct --live --out out/better.npz
    """
    from scripts.correction_session import CorrectionPlan, ask_only, correct

    if live and (ask or overwrite):
        raise typer.BadParameter("--ask and --overwrite are not for --live: live recordings are never deleted")
    if not live and {driver, host, port} != {None}:
        raise typer.BadParameter("--driver, --host and --port need --live")
    if json is not None and not ask:
        raise typer.BadParameter("--json needs --ask")
    plan = CorrectionPlan(
        rounds=rounds or (1 if live else 2), trials=practice, most=most or (3 if live else 10), seed=seed
    )
    if ask:
        ask_only(skill=skill, plan=plan, scenario=scenario, json=json, jobs=jobs)
        return
    run: Callable[..., object] = partial(correct, overwrite=overwrite)
    if live:
        from scripts.live_correction_session import correct_live

        run = partial(correct_live, driver=driver, host=host, port=port)
    folder = corrections or Path("out/live_corrections" if live else "out/corrections")
    files = {"skill": skill, "demonstrations": demonstrations, "corrections": folder, "out": out}
    run(**files, plan=plan, scenario=scenario, jobs=jobs)


if __name__ == "__main__":
    app()
