"""Records demonstrations by the simulated operator in the virtual environment."""

from __future__ import annotations

import os
import sys
import webbrowser
from pathlib import Path
from typing import Annotated

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

from models.scenario import load_scenario
from skill.data.demonstration import read_demonstrations, write_demonstration
from skill.figures.demonstration_figure import plot_set
from skill.figures.paper_figures import save_figure
from systems.haptics.coupling_margins import Margin, require_margins
from systems.live.page import open_live_page
from systems.live.session import LiveSession
from systems.operators.device_operator import find_device
from systems.reports.terminal import console, progress, report_errors
from systems.runs.demonstration_set import demonstrate_all, requests

app = typer.Typer(add_completion=False)


@report_errors
def record(*, out: Path, good: int, bad: int, seed: int, scenario: str, jobs: int, overwrite: bool) -> list[Path]:
    """Records ``good`` + ``bad`` demonstrations into the folder ``out``, one Parquet file each; returns their paths."""
    chosen = load_scenario(scenario)
    wanted = requests(good, bad)
    if not wanted:
        raise ValueError("0 demonstrations asked for; expected --good or --bad to be at least 1")
    stale = sorted(out.glob("*.parquet"))
    if stale and not overwrite:
        raise ValueError(f"{out}: holds {len(stale)} recordings already; choose another --out, or give --overwrite")
    for path in stale:
        path.unlink()
    sweep(out)
    print_margins(require_margins(chosen))
    made: list[Path] = []
    lowest: list[float] = []
    with progress("demonstrations", len(wanted)) as advance:
        for request, demonstration in demonstrate_all(chosen, wanted, seed=seed, jobs=jobs):
            path = out / f"{request.number:03d}_{'good' if request.good else 'bad'}_{request.habit}.parquet"
            write_demonstration(demonstration, path)
            made.append(path)
            lowest.append(demonstration.metadata["lowest_probe_energy_J"])
            advance(f"{request.habit}: {demonstration.reason}, {demonstration.duration:.1f} s")
    figure = out / "demonstrations.png"
    save_figure(plot_set(read_demonstrations(out), rough_force=chosen.recorder.rough_force), figure)
    console.print(f"{len(made)} demonstrations in {out}; outcomes, forces and times in {figure.name}")
    console.print(f"lowest energy at the probe's port: {1e3 * min(lowest):.3f} mJ (below 0 the display gave some)")
    return made


@report_errors
def record_live(*, out: Path, seed: int, scenario: str, driver: str | None, port: int | None) -> list[Path]:
    """A session of a person at the controls, in the browser; returns what was kept."""
    chosen = load_scenario(scenario)
    print_margins(require_margins(chosen))
    out.mkdir(parents=True, exist_ok=True)
    sweep(out)
    meshcat, page = open_live_page(port)
    console.print(f"open {page.address} in a browser", soft_wrap=True, highlight=False)
    if sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        webbrowser.open(page.address)  # without a desktop it might be one of text
    session = LiveSession(
        scenario=chosen,
        out=out,
        seed=seed,
        meshcat=meshcat,
        page=page,
        tell=lambda message: console.print(message, highlight=False),
        open_device=find_device(driver) if driver is not None else None,
    )
    try:
        kept = session.run()
    finally:
        page.close()
    console.print(f"{len(kept)} demonstrations kept in {out}")
    return kept


def sweep(folder: Path) -> None:
    """Removes what a session that was killed in the middle of a write has left: never a finished recording."""
    left = sorted(folder.glob(".*.parquet.*"))
    for path in left:
        path.unlink()
    if left:
        console.print(f"{len(left)} unfinished file(s) of an earlier session removed; what was finished is whole")


def print_margins(margins: list[Margin]) -> None:
    """One line a condition: what it is, what it may be, and how often it fits."""
    table = Table(title="stability margins of the coupling", box=SIMPLE_HEAD)
    for column in ("condition", "value", "below", "unit", "margin"):
        table.add_column(column, justify="left" if column in ("condition", "unit") else "right")
    for m in margins:
        note = f"x{m.factor:.2g}" if m.required else f"x{m.factor:.2g}, for comparison"
        table.add_row(m.name, f"{m.value:.3g}", f"{m.limit:.3g}", m.unit, note)
    console.print(table)


@app.command()
def main(
    out: Annotated[Path, typer.Option(help="Folder for the recordings, one .parquet file each.")] = Path(
        "out/demonstrations"
    ),
    good: Annotated[int, typer.Option(min=0, help="Good examples: they insert gently.")] = 24,
    bad: Annotated[int, typer.Option(min=0, help="Bad examples: they jam, slam, give up or over-correct.")] = 6,
    seed: Annotated[int, typer.Option(min=0, help="Another seed, other operators and starts.")] = 0,
    scenario: Annotated[
        str | None,
        typer.Option(help="Name of a scenario in models/scenarios, or the path of your own YAML file."),
    ] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Processes to use.")] = 2,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Remove what the folder holds first.")] = False,
    live: Annotated[bool, typer.Option("--live", help="Show it yourself, in the browser.")] = False,
    driver: Annotated[
        str | None, typer.Option(help="With --live: a device of your own, or 'spacemouse' (see docs/haptics.md).")
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(help="With --live: of the page, which takes the one after it too; free ones if not given."),
    ] = None,
) -> None:
    """Record demonstrations of peg-in-hole insertion in the virtual environment.

    A simulated person moves a haptic probe that is coupled to the peg, sees its tilt (late and inexactly) and feels the
    contact. Each demonstration holds the fourteen channels and the action, sampled at 50 Hz.

    With --live a page opens in the browser: sliders, keys or a gamepad move the peg; what is kept joins the folder.

    Example: python -m scripts.record_demonstrations --good 8 --bad 2 --out out/few
    """
    if live:
        record_live(out=out, seed=seed, scenario=scenario or "live", driver=driver, port=port)
    elif driver is not None or port is not None:
        raise typer.BadParameter("--driver and --port need --live")
    else:
        record(out=out, good=good, bad=bad, seed=seed, scenario=scenario or "nominal", jobs=jobs, overwrite=overwrite)


if __name__ == "__main__":
    app()
