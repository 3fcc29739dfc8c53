"""Records demonstrations in the virtual environment, by the simulated operator or by a person."""

from __future__ import annotations

import os
import sys
import webbrowser
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scripts.command_line import command, make_app, run_app
from scripts.options import Bad, Good, Jobs, OptionalScenarioName, OutFolder, Seed

if TYPE_CHECKING:
    from systems.haptics.coupling_margins import Margin

app = make_app()


def record(*, out: Path, good: int, bad: int, seed: int, scenario: str, jobs: int, overwrite: bool) -> list[Path]:
    """Records ``good`` + ``bad`` demonstrations into the folder ``out``, and returns the paths of their files.

    Raises:
        ValueError: if no demonstration is requested, the folder holds recordings and ``overwrite`` is false, or the
            scenario is not valid or not stable.
        OSError: if a file cannot be written. The recordings that were finished stay.
    """
    from models.scenario import load_scenario
    from skill.data.demonstration import read_demonstrations, write_demonstration
    from skill.figures.demonstration_figure import plot_set
    from skill.figures.paper_figures import save_figure
    from systems.haptics.coupling_margins import require_margins
    from systems.reports.terminal import progress, say
    from systems.runs.demonstration_set import demonstrate_all, requests

    chosen = load_scenario(scenario)
    requested = requests(good, bad)
    if not requested:
        raise ValueError("0 demonstrations requested; expected --good or --bad to be at least 1")
    old = sorted(out.glob("*.parquet"))
    if old and not overwrite:
        raise ValueError(f"{out}: holds {len(old)} recordings already; choose another --out, or add --overwrite")
    margins = require_margins(chosen)
    for path in old:
        path.unlink()
    remove_unfinished(out)
    print_margins(margins)
    written: list[Path] = []
    lowest: list[float] = []
    with progress("demonstrations", len(requested)) as advance:
        for request, demonstration in demonstrate_all(chosen, requested, seed=seed, jobs=jobs):
            path = out / f"{request.number:03d}_{'good' if request.good else 'bad'}_{request.habit}.parquet"
            write_demonstration(demonstration, path)
            written.append(path)
            lowest.append(demonstration.metadata["lowest_probe_energy_J"])
            advance(f"{request.habit}: {demonstration.reason}, {demonstration.duration:.1f} s")
    figure = out / "demonstrations.png"
    save_figure(plot_set(read_demonstrations(out), rough_force=chosen.recorder.rough_force), figure)
    say(f"{len(written)} demonstrations in {out}; outcomes, forces and times in {figure.name}")
    say(f"minimum energy at the probe's port: {1e3 * min(lowest):.3f} mJ (negative: the display produced energy)")
    return written


def record_live(
    *, out: Path, seed: int, scenario: str, driver: str | None, port: int | None, host: str | None = None
) -> list[Path]:
    """Runs a session in the browser with a person at the controls, and returns the recordings that they kept.

    Raises:
        ValueError: if the scenario is not valid or not stable, or no device driver has the name ``driver``.
        OSError: if the folder ``out`` cannot be written, or the page cannot listen at ``host`` and ``port``.
    """
    from models.scenario import load_scenario
    from systems.haptics.coupling_margins import require_margins
    from systems.live.access import LOCAL_HOST
    from systems.live.page import open_live_page
    from systems.live.session import LiveSession
    from systems.operators.device_operator import find_device
    from systems.reports.terminal import say

    chosen = load_scenario(scenario)
    page = open_live_page(host=host or LOCAL_HOST, port=port)
    try:
        print_margins(require_margins(chosen))
        out.mkdir(parents=True, exist_ok=True)
        remove_unfinished(out)
        for line in page.announcement():
            say(line)
        if sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
            webbrowser.open(page.address)  # without a desktop this could start a text browser in the terminal
        device = find_device(driver) if driver is not None else None
        kept = LiveSession(scenario=chosen, out=out, seed=seed, page=page, tell=say, open_device=device).run()
    finally:
        page.close()
    say(f"{len(kept)} demonstrations kept in {out}")
    return kept


def remove_unfinished(folder: Path) -> None:
    """Removes the temporary files of a session that was killed while writing, never a finished recording."""
    from systems.reports.terminal import say

    unfinished = sorted(folder.glob(".*.parquet.*"))
    for path in unfinished:
        path.unlink()
    if unfinished:
        say(f"removed {len(unfinished)} unfinished file(s) of an earlier session; finished recordings are complete")


def print_margins(margins: Sequence[Margin]) -> None:
    """Prints the stability conditions of the coupling, one row each: value, limit, and the factor between them."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    from systems.reports.terminal import console

    table = Table(title="stability margins of the coupling", box=SIMPLE_HEAD)
    for column in ("condition", "value", "below", "unit", "margin"):
        table.add_column(column, justify="left" if column in ("condition", "unit") else "right")
    for m in margins:
        note = f"x{m.factor:.2g}" if m.required else f"x{m.factor:.2g}, for comparison"
        table.add_row(m.name, f"{m.value:.3g}", f"{m.limit:.3g}", m.unit, note)
    console.print(table)


@app.command()
@command
def main(
    out: OutFolder = Path("out/demonstrations"),
    good: Good = 24,
    bad: Bad = 6,
    seed: Seed = 0,
    scenario: OptionalScenarioName = None,
    jobs: Jobs = 2,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Remove the recordings in the folder of --out first.")
    ] = False,
    live: Annotated[bool, typer.Option("--live", help="Demonstrate yourself, in the browser.")] = False,
    driver: Annotated[
        str | None, typer.Option(help="With --live: name of your device driver, or 'spacemouse' (see docs/haptics.md).")
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
    chooses the operators and the starting poses.

    For example:

        haptic-skill record --good 8 --bad 2 --out out/few
    """
    if live:
        record_live(out=out, seed=seed, scenario=scenario or "live", driver=driver, host=host, port=port)
    elif (driver, host, port) != (None, None, None):
        raise typer.BadParameter("--driver, --host and --port need --live")
    else:
        record(out=out, good=good, bad=bad, seed=seed, scenario=scenario or "nominal", jobs=jobs, overwrite=overwrite)


if __name__ == "__main__":
    run_app(app)
