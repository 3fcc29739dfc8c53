"""Records demonstrations in the virtual environment, by the simulated operator or by a person."""

from __future__ import annotations

import os
import sys
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scripts.command_line import command, make_app, run_app
from scripts.options import Bad, Good, Jobs, OptionalOutFolder, OptionalScenarioName, Overwrite, Seed, parse_path

if TYPE_CHECKING:
    from models.scenario import Scenario

app = make_app()


def record_live(
    *,
    out: Path,
    seed: int,
    scenario: str,
    driver: str | None,
    port: int | None,
    host: str | None = None,
    asked: Path | None = None,
) -> list[Path]:
    """Runs a session in the browser with a person at the controls, and returns the recordings that they kept.

    With ``asked``, a file of situations, each demonstration begins in one of them.

    Raises:
        ValueError: if the scenario is not valid or not stable, no device driver has the name ``driver``, or the file
            of situations is not valid.
        OSError: if the folder ``out`` cannot be written, or the page cannot listen at ``host`` and ``port``.
    """
    from models.scenario import load_scenario
    from skill.practice.situation import read_situations
    from systems.haptics.coupling_margins import require_margins
    from systems.live.access import LOCAL_HOST
    from systems.live.page import open_live_page
    from systems.live.session import LiveSession, asked_scenario, live_scenario
    from systems.operators.device_operator import find_device
    from systems.reports.terminal import say
    from systems.servo.multirate_margins import require_multirate_margins
    from systems.sessions.margin_table import print_margins

    chosen = load_scenario(scenario)
    margins = require_margins(chosen) if driver is None else require_multirate_margins(chosen)
    situations = read_situations(asked) if asked is not None else []

    def start_of(number: int) -> Scenario:
        if situations:
            return asked_scenario(chosen, situations, seed=seed, number=number)
        return live_scenario(chosen, seed=seed, number=number)

    for number in range(max(1, len(situations))):  # all are checked before the page opens
        start_of(number)
    if driver is not None:
        find_device(driver)
    page = open_live_page(host=host or LOCAL_HOST, port=port)
    try:
        print_margins(margins)
        for line in page.announcement():
            say(line)
        if sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
            webbrowser.open(page.address)  # without a desktop this could start a text browser in the terminal
        kept = LiveSession(start_of=start_of, out=out, page=page, tell=say, driver=driver).run()
    finally:
        page.close()
    say(f"{len(kept)} demonstrations kept in {out}")
    return kept


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
    driver: Annotated[
        str | None, typer.Option(help="With --live: name of your device driver, or 'spacemouse' (see docs/haptics.md).")
    ] = None,
    asked: Annotated[
        Path | None,
        typer.Option(
            parser=parse_path,
            metavar="FILE",
            help="With --live: begin in the situations of this file, by `haptic-skill recover --ask --json FILE`.",
        ),
    ] = None,
    host: Annotated[
        str | None,
        typer.Option(help="With --live: address at which the page listens.", show_default="127.0.0.1: this machine"),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(help="With --live: port of the page.", show_default="a free one"),
    ] = None,
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
        from systems.outputs.live_folder import open_live_folder

        folder = out or Path("out/live")
        with open_live_folder(folder):
            chosen = scenario or ("device" if driver else "live")
            record_live(out=folder, seed=seed, scenario=chosen, driver=driver, host=host, port=port, asked=asked)
    elif (driver, host, port, asked) != (None, None, None, None):
        raise typer.BadParameter("--driver, --host, --port and --asked need --live")
    else:
        from systems.sessions.record_session import record

        folder = out or Path("out/demonstrations")
        chosen = scenario or "nominal"
        record(out=folder, good=good, bad=bad, seed=seed, scenario=chosen, jobs=jobs, overwrite=overwrite)


if __name__ == "__main__":
    run_app(app)
