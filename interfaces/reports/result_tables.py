"""Tables for the terminal: the results of rig trials, and the contact states of a skill."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.box import SIMPLE
from rich.table import Table
from rich.text import Text

from skill.states.state_summary import FORCE, MOMENT, Spread, StateSummary

if TYPE_CHECKING:
    from experiments.scoreboard.summary import Table as Scores
    from experiments.trial.trial_result import TrialResult
    from skill.manipulation_skill import ManipulationSkill
    from skill.policy.query_state import QueryState
    from skill.states.phase_agreement import PhaseAgreement


def plain_table(title: str, *, text: str | None = None, numbers: Sequence[str] = ()) -> Table:
    """An empty table in the style of all tables here: a column of texts if it is named, and columns of numbers."""
    table = Table(title=title, box=SIMPLE, padding=(0, 1, 0, 0))
    if text is not None:
        table.add_column(text, overflow="fold")
    for name in numbers:
        table.add_column(name, justify="right", min_width=max(map(len, name.split("\n"))))
    return table


def result_table(results: Sequence[TrialResult]) -> Table:
    """One row per trial.

    Load, contact: the largest load of the net wrench, and the largest normal force of any single contact.
    """
    table = plain_table("insertions on the rig")
    table.padding = (0, 0, 0, 0)  # so that ten columns fit 80 characters
    table.add_column("trial", justify="right")
    table.add_column("tilt\n(deg)", no_wrap=True, justify="right")
    table.add_column("outcome", min_width=len("inserted"), overflow="fold")
    for name in ("time\n(s)", "depth\n(mm)", "load\n(N)", "contact\n(N)", "> 20 N\n(s)", "steps"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("states\n(visits)", min_width=len("(visits)"), overflow="fold")
    for r in results:
        table.add_row(
            str(r.seed),
            "{:+.1f} {:+.1f}".format(*np.degrees(r.tilt)),
            Text(r.reason, style="green" if r.inserted else "red"),
            *(f"{r.time:.2f}", f"{1e3 * r.depth:.1f}"),
            *(f"{r.peak_load:.1f}", f"{r.peak_contact_force:.1f}", f"{r.time_above_20n:.2f}"),
            str(r.steps),
            f"{' '.join(map(str, dict.fromkeys(r.states)))} ({len(r.states)})",
        )
    return table


def result_summary(results: Sequence[TrialResult]) -> list[str]:
    """The outcome of all trials, in lines of less than 80 characters."""
    time, load, contact, overlap = (
        np.median([getattr(r, name) for r in results])
        for name in ("time", "peak_load", "peak_contact_force", "penetration")
    )
    distrusted = sum(not r.trusted for r in results)
    return [
        f"{sum(r.inserted for r in results)} of {len(results)} inserted; median {time:.2f} s",
        f"medians: peak load {load:.0f} N, peak force of a contact {contact:.0f} N, overlap {1e6 * overlap:.0f} um",
        *([f"physics not trusted in {distrusted} of {len(results)} trials: the bodies overlap"] if distrusted else []),
    ]


def query_state_table(query_states: Sequence[QueryState]) -> Table:
    """One row per query state in which a skill was stuck."""
    columns = ("practice\ntrial", "time\n(s)", "depth\n(mm)", "tilt\n(deg)", "load\n(N)")
    table = plain_table("query states in which the skill got stuck", numbers=columns)
    table.add_column("state")
    for s in query_states:
        numbers = (f"{s.time:.2f}", f"{1e3 * s.depth:.1f}", f"{np.degrees(np.hypot(*s.tilt)):.1f}", f"{s.load:.0f}")
        table.add_row(str(s.trial), *numbers, Text(s.state))
    return table


def state_table(skill: ManipulationSkill) -> Table:
    """The graph of contact states, one row per state."""
    table = plain_table("contact states", text="state", numbers=("visits", "dwell", "phase", "next"))
    rows = skill.graph_.to_frame().itertuples(index=False)
    for k, (name, row) in enumerate(zip(skill.state_names(), rows, strict=True)):
        visits, dwell, _, phase, _, following = row
        table.add_row(Text(f"{k} {name}"), str(visits), f"{dwell:.2f}", f"{phase:.2f}", str(following))
    chances = skill.graph_.reach_
    table.caption = (
        "dwell: mean time in the state, s; phase: 0 at the start; next: most frequent next state on the way to"
        f" insertion; an insertion follows a state with probability {chances.min():.2f} to {chances.max():.2f}"
    )
    return table


def discovered_table(states: Sequence[StateSummary]) -> Table:
    """One row per state that was discovered in recordings."""
    names = {FORCE: ("force\n(N)", ".1f"), MOMENT: ("moment\n(N m)", ".2f")}
    lengths = [name for name in names if name in states[0].quantities]
    columns = ("time\n(%)", "visits", "duration\n(s)", *(names[name][0] for name in lengths), "next")
    table = plain_table("contact states", text="state", numbers=columns)
    for k, state in enumerate(states):
        table.add_row(
            Text(f"{k} {state.name}"),
            *(f"{100 * state.share:.0f}", f"{state.visits:.1f}", _median(state.duration, ".2f")),
            *(_median(state.quantities[name], names[name][1]) for name in lengths),
            ", ".join(following_texts(state, 2)) or "-",
        )
    table.caption = (
        "visits: in a recording, on average; duration of a visit, and lengths of the vectors of force and moment:"
        " medians; next: what follows a visit most often"
    )
    return table


def following_texts(state: StateSummary, number: int) -> list[str]:
    """What follows a state most often, such as "2 (62 %)"."""
    return [f"{'end' if after is None else after} ({100 * share:.0f} %)" for after, share in state.following[:number]]


def _median(spread: Spread, form: str) -> str:
    return "-" if np.isnan(spread.median) else format(spread.median, form)


def phase_table(agreement: PhaseAgreement) -> Table:
    """One row per known phase: how its samples are distributed over the states."""
    columns = [*(f"state {k}\n(%)" for k in range(agreement.counts.shape[1])), "samples"]
    table = plain_table("known phases and contact states", text="phase", numbers=columns)
    for name, counts in zip(agreement.phases, agreement.counts, strict=True):
        shares = (f"{100 * count / counts.sum():.0f}" for count in counts)
        table.add_row(Text(name), *shares, str(counts.sum()))
    table.caption = f"adjusted Rand index {agreement.ari:.2f}; 1: states and phases are the same"
    return table


def scoreboard_table(scores: Scores, reference: str) -> Table:
    """One row per policy, with the columns that matter most; below a number what stands below it on the page."""
    from experiments.scoreboard.columns import COLUMNS

    columns = [column for column in COLUMNS if column.is_main]
    headings = [f"{column.name}\n({column.unit})" for column in columns]
    found = plain_table(scores.conditions.title, text="policy", numbers=headings)
    for row in scores.rows:
        name = f"{row.summary.policy} (reference)" if row.summary.policy == reference else row.summary.policy
        cells = [f"{row.text(column)}\n{row.note(column)}".strip() for column in columns]
        found.add_row(Text(name), *(Text(cell, justify="right") for cell in cells))
    return found
