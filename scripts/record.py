"""Records demonstrations in the virtual environment, by the simulated operator or by a person."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scripts.command_line import command, make_app
from scripts.options import (
    Bad,
    Driver,
    Good,
    Host,
    Jobs,
    OptionalOutFolder,
    OptionalScenarioName,
    Overwrite,
    Port,
    Seed,
    parse_path,
)

app = make_app()


@app.command()
@command
def main(
    out: OptionalOutFolder = None,
    good: Good = 24,
    bad: Bad = 6,
    seed: Seed = 0,
    scenario: OptionalScenarioName = None,
    jobs: Jobs = 2,
    overwrite: Overwrite = False,
    live: Annotated[bool, typer.Option("--live", help="Demonstrate yourself, in the browser.")] = False,
    driver: Driver = None,
    asked: Annotated[
        Path | None,
        typer.Option(
            parser=parse_path,
            metavar="FILE",
            help="With --live: begin in the query states of this file, by `haptic-skill correct --ask --json FILE`.",
        ),
    ] = None,
    observer: Annotated[
        Path | None,
        typer.Option(
            parser=parse_path,
            metavar="FILE",
            help="With --live: skill that names the contact states while you demonstrate, and shows what it would do.",
        ),
    ] = None,
    host: Host = None,
    port: Port = None,
) -> None:
    """Records demonstrations of peg-in-hole insertion in the virtual environment.

    A simulated person moves a haptic probe that is coupled to the peg, sees its tilt (late and inexactly) and feels the
    contact. With `--live` a page opens in the browser, and you move the peg with sliders, keys or a gamepad.

    Reads a scenario (nominal, or live with `--live`). Writes into the folder of `--out` one .parquet file per
    demonstration, with the fourteen channels and the action, sampled at 50 Hz, and demonstrations.png. The seed
    chooses the operators and the starting poses. Given again after an interruption, it goes on where it stopped. Live
    recordings have a folder of their own, which no command replaces.

    For example:

        haptic-skill record --good 8 --bad 2 --out out/few
    """
    if live and overwrite:
        raise typer.BadParameter("--overwrite is not for --live: live recordings are never deleted")
    if live:
        from experiments.outputs.live_folder import open_live_folder
        from scripts.live_session import record_live

        folder = out or Path("out/live")
        with open_live_folder(folder):
            chosen = scenario or ("device" if driver else "live")
            record_live(
                out=folder, seed=seed, scenario=chosen, driver=driver, host=host, port=port, asked=asked, skill=observer
            )
    elif {driver, host, port, asked, observer} != {None}:
        raise typer.BadParameter("--driver, --host, --port, --asked and --observer need --live")
    else:
        from scripts.record_session import record

        folder = out or Path("out/demonstrations")
        chosen = scenario or "nominal"
        record(out=folder, good=good, bad=bad, seed=seed, scenario=chosen, jobs=jobs, overwrite=overwrite)


if __name__ == "__main__":
    app()
