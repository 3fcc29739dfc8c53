"""Runs a trained skill on the simulated 3-DOF rig."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from scripts.command_line import command, make_app
from scripts.options import DefaultSkillFile, Jobs, OutFolder, Overwrite, ScenarioName, Seed, Trials, parse_path

app = make_app()


@app.command()
@command
def main(
    skill: DefaultSkillFile = None,
    trials: Trials = 10,
    seed: Seed = 0,
    tilt_deg: Annotated[
        float | None,
        typer.Option(min=0.0, help="Largest starting tilt about each axis, degrees.", show_default="from the scenario"),
    ] = None,
    friction: Annotated[
        float | None,
        typer.Option(min=0.0, help="Coulomb friction coefficient of peg and hole.", show_default="from the scenario"),
    ] = None,
    arm: Annotated[
        Literal["default", "stress"],
        typer.Option(help="Which trials: all that the scenario contains, or only the hard ones."),
    ] = "default",
    scenario: ScenarioName = "nominal",
    out: OutFolder = Path("out/rig"),
    json: Annotated[
        Path | None,
        typer.Option(
            parser=parse_path,
            metavar="FILE",
            help="JSON file for a copy of results.json, one object per trial.",
            show_default="no copy",
        ),
    ] = None,
    jobs: Jobs = 2,
    overwrite: Overwrite = False,
) -> None:
    """Inserts the peg on the simulated rig with a trained skill.

    The trials start from tilts that the skill has not seen, and share no random draw with the demonstrations. The
    controller measures the wrench and the depth, and nothing else. The stress arm has steep tilts, a pivot well off
    the mouth, and much friction.

    Reads a skill and a scenario. Writes into the folder of `--out` one run_NNNN.parquet per trial (NNNN = seed + k)
    and results.json as the trials end, then report.html, which links to a replay of the worst trial. Given again after
    an interruption, it goes on where it stopped. It does not mix its runs with those of another request.

    For example:

        haptic-skill rig --trials 20 --seed 100 --tilt-deg 2 --friction 0.3 --out out/mine
    """
    from experiments.trial import Arm
    from scripts.default_skill import find_skill
    from scripts.rig_session import run

    run(
        skill=find_skill(skill),
        trials=trials,
        seed=seed,
        tilt_deg=tilt_deg,
        friction=friction,
        arm=Arm(arm),
        scenario=scenario,
        out=out,
        json=json,
        jobs=jobs,
        overwrite=overwrite,
    )


if __name__ == "__main__":
    app()
