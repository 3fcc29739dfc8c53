"""Opens the page of a live session and records what a person demonstrates there."""

from __future__ import annotations

import math
import os
import sys
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from interfaces.live.access import LOCAL_HOST
from interfaces.live.page import LivePage, open_live_page
from interfaces.live.session import LiveSession, asked_scenario, live_scenario
from interfaces.terminal import say
from models.scenario import Scenario, load_scenario
from scripts.margin_table import print_margins
from skill.manipulation_skill import ManipulationSkill
from skill.practice.query_state import read_query_states
from systems.haptics.coupling_margins import Margin
from systems.operators.device_operator import find_device
from systems.rig import check_geometry
from systems.servo.multirate_margins import require_multirate_margins


def record_live(
    *,
    out: Path,
    seed: int,
    scenario: str,
    driver: str | None,
    port: int | None,
    host: str | None = None,
    asked: Path | None = None,
    skill: Path | None = None,
) -> list[Path]:
    """Runs a session in the browser with a person at the controls, and returns the recordings that they kept.

    With ``asked``, a file of query states, each demonstration begins in one of them. A ``skill`` names the contact
    states on the page, and shows what it would do.

    Raises:
        ValueError: if the scenario is not valid or not stable, no device driver has the name ``driver``, the file
            of query states or of the skill is not valid, or the skill is of another peg, hole or period.
        OSError: if the folder ``out`` cannot be written, or the page cannot listen at ``host`` and ``port``.
    """
    chosen = load_scenario(scenario)
    margins = live_margins(chosen, driver)
    query_states = read_query_states(asked) if asked is not None else []
    watching = None if skill is None else _load_watching(skill, chosen)

    def start_of(number: int) -> Scenario:
        if query_states:
            return asked_scenario(chosen, query_states, seed=seed, number=number)
        return live_scenario(chosen, seed=seed, number=number)

    for number in range(max(1, len(query_states))):  # all are checked before the page opens
        start_of(number)
    with announced_page(margins, host=host, port=port) as page:
        kept = LiveSession(start_of=start_of, out=out, page=page, announce=say, driver=driver, policy=watching).run()
    say(f"{len(kept)} demonstrations kept in {out}")
    return kept


def live_margins(scenario: Scenario, driver: str | None) -> list[Margin]:
    """Returns the margins of stability of a live session.

    Raises:
        ValueError: if the scenario is not stable, or no device driver has the name ``driver``.
    """
    if driver is not None:
        find_device(driver)
    return require_multirate_margins(scenario)


@contextmanager
def announced_page(margins: list[Margin], *, host: str | None, port: int | None) -> Iterator[LivePage]:
    """Opens the page of a live session, prints the margins and its address, and shows it in the desktop's browser.

    Raises:
        OSError: if the page cannot listen at ``host`` and ``port``.
    """
    page = open_live_page(host=host or LOCAL_HOST, port=port)
    try:
        print_margins(margins)
        for line in page.announcement():
            say(line)
        if sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
            webbrowser.open(page.address)  # without a desktop this could start a text browser in the terminal
        yield page
    finally:
        page.close()


def _load_watching(path: Path, scenario: Scenario) -> ManipulationSkill:
    """Loads a skill that can watch demonstrations of the scenario."""
    skill = ManipulationSkill.load(path)
    check_geometry(scenario, skill)
    acts, records = skill.period_, scenario.recorder.period
    if not math.isclose(acts, records, rel_tol=1e-6):
        raise ValueError(
            f"{path}: the skill acts every {acts:g} s, the scenario records every {records:g} s; expected"
            " the same period"
        )
    return skill
