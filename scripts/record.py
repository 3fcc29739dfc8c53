"""Records demonstrations in the virtual environment, by the simulated operator or by a person."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scripts.command_line import (
    Bad,
    Driver,
    Engine,
    Good,
    Host,
    Jobs,
    OptionalOutFolder,
    OptionalScenarioName,
    Overwrite,
    Port,
    Seed,
    Verbose,
    counted,
    path_option,
    read_scenario,
)
from scripts.compilation import compile_contact

if TYPE_CHECKING:
    from experiments.self_test import HeldPace
    from interfaces.live.page import LivePage
    from models.scenario import Scenario
    from systems.haptics.coupling_margins import Margin

FIGURE = "demonstrations.png"


def main(
    context: typer.Context,
    out: OptionalOutFolder = None,
    good: Good = 24,
    bad: Bad = 6,
    seed: Seed = 0,
    scenario: OptionalScenarioName = None,
    engine: Engine = None,
    jobs: Jobs = 2,
    overwrite: Overwrite = False,
    live: Annotated[bool, typer.Option("--live", help="Demonstrate yourself, in the browser.")] = False,
    driver: Driver = None,
    asked: Annotated[
        Path | None,
        path_option(
            "FILE", "With --live: begin in the query states of this file, by `haptic-skill correct --ask --json FILE`."
        ),
    ] = None,
    observer: Annotated[
        Path | None,
        path_option(
            "FILE",
            "With --live: skill that names the contact states while you demonstrate, and shows what it would do.",
        ),
    ] = None,
    host: Host = None,
    port: Port = None,
    verbose: Verbose = False,
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
    simulated = map(context.get_parameter_source, ("good", "bad", "jobs", "overwrite"))
    if live and any(source is not None and source.name != "DEFAULT" for source in simulated):
        raise typer.BadParameter(
            "--good, --bad, --jobs and --overwrite are not for --live: a person demonstrates, and live recordings are"
            " never deleted"
        )
    if not live and {driver, host, port, asked, observer} != {None}:
        raise typer.BadParameter("--driver, --host, --port, --asked and --observer need --live")
    if live:
        from experiments.outputs.output_set import open_live_folder

        folder = out or Path("out/live")
        with open_live_folder(folder):
            record_live(
                out=folder,
                seed=seed,
                scenario=scenario or live_scenario_name(driver, engine),
                engine=engine,
                driver=driver,
                host=host,
                port=port,
                asked=asked,
                observer=observer,
                verbose=verbose,
            )
    else:
        chosen, folder = scenario or "nominal", out or Path("out/demonstrations")
        record(folder, good, bad, seed, chosen, jobs, engine=engine, overwrite=overwrite, verbose=verbose)


def record(
    out: Path,
    good: int,
    bad: int,
    seed: int,
    scenario: str,
    jobs: int,
    *,
    engine: str | None = None,
    overwrite: bool = False,
    verbose: bool = False,
) -> list[Path]:
    """Records ``good`` + ``bad`` demonstrations into the folder ``out``, and returns the paths of their files.

    Demonstrations that an interrupted call with the same arguments has finished are kept and not repeated.

    Raises:
        ValueError: if no demonstration is requested, the scenario is not valid or not stable, or the folder holds what
            may not be replaced (see `experiments.outputs.output_set.check_set`).
        OSError: if another process writes into the folder, or a file cannot be written. What is finished stays.
    """
    from functools import partial

    from experiments.demonstration_set import demonstrate_all, requests
    from experiments.outputs.output_checks import RECORDING_SIZE, REPORT_SIZE, check_folder
    from experiments.outputs.output_set import DEMONSTRATIONS, SetIndex, open_set
    from experiments.provenance import versions
    from interfaces.terminal import progress, say
    from models.scenario import dump_scenario
    from skill.data.demonstration import Demonstration, write_demonstration
    from skill.figures.demonstration_figure import plot_set
    from skill.figures.paper_figures import save_figure
    from systems.haptics.coupling_margins import require_margins

    chosen = read_scenario(scenario, engine)
    requested = {request.file_name: request for request in requests(good, bad)}
    margins = require_margins(chosen)
    check_folder(out, size=len(requested) * RECORDING_SIZE + REPORT_SIZE)
    about = {"good": good, "bad": bad, "seed": seed, "scenario": dump_scenario(chosen), "versions": versions()}
    index = SetIndex(DEMONSTRATIONS, about, tuple(requested), reports=(FIGURE,))
    with open_set(out, index, overwrite=overwrite) as files:
        print_margins(margins, verbose=verbose)
        if files.damaged:
            say(f"cannot be read and are recorded again: {', '.join(files.damaged)}")
        if files.finished:
            say(f"{len(files.finished)} of {len(requested)} demonstrations are there already")
        done: dict[str, Demonstration] = dict(files.finished)
        missing = [request for name, request in requested.items() if name not in done]
        compile_contact(chosen.geometry)
        with progress("demonstrations", len(missing)) as advance:
            for request, demonstration in demonstrate_all(chosen, missing, seed=seed, jobs=jobs):
                files.write(request.file_name, partial(write_demonstration, demonstration))
                done[request.file_name] = demonstration
                advance(f"{request.habit}: {demonstration.reason}, {demonstration.duration:.1f} s")
        files.complete()
        ordered = [done[name] for name in requested]
        files.write(FIGURE, partial(save_figure, plot_set(ordered, rough_force=chosen.recorder.rough_force)))
    produced = max(0.0, *(-1e3 * d.metadata["lowest_probe_energy_J"] for d in ordered))
    say(f"the haptic display produced at most {produced:.3f} mJ of energy in a demonstration")
    say(f"{counted(len(ordered), 'demonstration')} in {out}; open {out / FIGURE}: outcomes, forces and times")
    return [out / name for name in requested]


# ------------------------------------------------------------------ live


def record_live(
    *,
    out: Path,
    seed: int,
    scenario: str,
    driver: str | None,
    port: int | None,
    host: str | None = None,
    engine: str | None = None,
    asked: Path | None = None,
    observer: Path | None = None,
    verbose: bool = False,
) -> list[Path]:
    """Runs a session in the browser with a person at the controls, and returns the recordings that they kept.

    Keys that the scenario does not state have the values of ``device``. With ``asked``, a file of query states, each
    demonstration begins in one of them. A skill as ``observer`` names the contact states on the page, and shows what
    it would do.

    Raises:
        ValueError: if the scenario is not valid or not stable, no device driver has the name ``driver``, the file
            of query states or of the skill is not valid, or the skill is of another peg, hole or period.
        OSError: if the folder ``out`` cannot be written, or the page cannot listen at ``host`` and ``port``.
    """
    from math import isclose

    from experiments.self_test import hold_pace
    from interfaces.live.session import LiveSession, asked_scenario, live_scenario
    from interfaces.terminal import say
    from models.scenario import load_scenario
    from skill.manipulation_skill import ManipulationSkill
    from skill.policy.policy_observer import PolicyObserver
    from skill.policy.query_state import read_query_states
    from systems.law.wiring import check_geometry

    chosen = read_scenario(scenario, engine, defaults=load_scenario("device"))
    margins = live_margins(chosen, driver)
    query_states = read_query_states(asked) if asked is not None else []
    skill = None
    if observer is not None:
        skill = ManipulationSkill.load(observer)
        check_geometry(chosen, skill)
        acts, records = skill.period_, chosen.recorder.period
        if not isclose(acts, records, rel_tol=1e-6):
            periods = f"the skill acts every {acts:g} s, the scenario records every {records:g} s"
            raise ValueError(f"{observer}: {periods}; expected the same period")
        # The first look of a new installation compiles for some ten seconds, which must not stop a demonstration.
        PolicyObserver(skill).watch([0.0] * 7, [0.0] * 2)

    def start_of(number: int) -> Scenario:
        if query_states:
            return asked_scenario(chosen, query_states, seed=seed, number=number)
        return live_scenario(chosen, seed=seed, number=number)

    for number in range(max(1, len(query_states))):  # all are checked before the page opens
        start_of(number)
    pace = hold_pace(chosen)
    chosen = pace.scenario
    with announced_page(margins, pace, host=host, port=port, verbose=verbose) as page:
        kept = LiveSession(start_of=start_of, out=out, page=page, announce=say, driver=driver, policy=skill).run()
    say(f"{counted(len(kept), 'demonstration')} kept in {out}")
    return kept


def live_scenario_name(driver: str | None, engine: str | None) -> str:
    """Returns the scenario of a session: Drake's contact is too slow for the steps of ``device`` beside a browser."""
    from systems.operators.device_operator import DEVICE_SCENARIO, default_scenario

    if driver is not None:
        return default_scenario(driver)
    return DEVICE_SCENARIO if engine == "exact" else "live"


def live_margins(scenario: Scenario, driver: str | None) -> list[Margin]:
    """Returns the margins of stability of a live session.

    Raises:
        ValueError: if the scenario is not stable or names another device than the driver's, or no device driver has
            the name ``driver``.
    """
    from systems.operators.device_operator import check_preset, find_device
    from systems.servo.multirate_margins import require_multirate_margins

    if driver is not None:
        find_device(driver)
        check_preset(driver, scenario)
    return require_multirate_margins(scenario)


@contextmanager
def announced_page(
    margins: list[Margin], pace: HeldPace, *, host: str | None, port: int | None, verbose: bool
) -> Iterator[LivePage]:
    """Opens the page of a live session, prints margins, pace and address, and shows it in the desktop's browser.

    Raises:
        OSError: if the page cannot listen at ``host`` and ``port``.
    """
    import os
    import sys
    import webbrowser

    from interfaces.live.access import LOCAL_HOST
    from interfaces.live.page import open_live_page
    from interfaces.terminal import say

    page = open_live_page(host=host or LOCAL_HOST, port=port)
    try:
        print_margins(margins, verbose=verbose)
        page.show(pace=pace.rate)
        for line in (pace.note, *page.announcement()):
            say(line)
        if sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
            webbrowser.open(page.address)  # without a desktop this could start a text browser in the terminal
        yield page
    finally:
        page.close()


def print_margins(margins: list[Margin], *, verbose: bool) -> None:
    """Prints the smallest stability margin of the coupling in a line, or all of them in a table."""
    import math

    from interfaces.reports.result_tables import plain_table
    from interfaces.terminal import say, show

    if not verbose:
        least = min((margin for margin in margins if margin.required), key=lambda margin: margin.factor)
        say(f"the coupling is stable: smallest margin x{least.factor:.2g} ({least.name})")
        return
    table = plain_table("stability margins of the coupling")
    for column in ("condition", "value", "below", "unit", "margin"):
        table.add_column(column, justify="left" if column in ("condition", "unit") else "right", overflow="fold")
    for m in margins:
        factor = f"x{m.factor:.2g}" if math.isfinite(m.factor) else "any"
        note = factor if m.required else f"{factor}, for comparison"
        table.add_row(m.name, f"{m.value:.3g}", f"{m.limit:.3g}", m.unit, note)
    show(table)
