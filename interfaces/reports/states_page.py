"""One self-contained HTML page about discovered contact states: what they are, and every recording over its states.

The layout is in states.html and states.css; states.js draws the series.
"""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from interfaces.reports.page_template import definitions, fill_page, script_value, tiles
from interfaces.reports.result_tables import following_texts
from skill.arrays import Array
from skill.recordings.channel_groups import channel_groups
from skill.states.phase_agreement import PhaseAgreement, phase_codes
from skill.states.state_style import PALETTE, TINTS, state_colours
from skill.states.state_summary import FORCE, GAP, MOMENT, LabelledRecording, Spread, StateSummary

MAX_SHOWN, MAX_SHOWN_TOGETHER = 20_000, 500_000
"""Largest number of samples of a recording, and of all together, in the page; if there are more, it has every n-th."""

RESOLUTION = 1 / 5000
"""Resolution of the series, as a share of the largest magnitude of their group, at most."""

CENTRAL, OUTLYING = 0.995, 3.0
"""The axis of a group covers all values, unless their range is more than OUTLYING times that of the CENTRAL share."""

LISTED_NEXT = 3
"""Largest number of following states that the table lists."""


@dataclass(frozen=True)
class StatesReport:
    """What the page tells.

    Attributes:
        title: heading.
        about: what was read, in one line.
        method: how the states were found, in two sentences.
        labelled: the recordings with their states, all with the same channels.
        states: the summary of each state.
        agreement: with known phases; None if no recording has phases.
        made_by: what determined the result, by name: files, options, versions.
    """

    title: str
    about: str
    method: str
    labelled: Sequence[LabelledRecording]
    states: Sequence[StateSummary]
    agreement: PhaseAgreement | None
    made_by: Mapping[str, str]


def states_page(report: StatesReport) -> str:
    """Returns the page as HTML text; it needs no other file."""
    columns = _columns(report)
    colours = page_colours(len(report.states))
    inks = [ink_on(colour) for colour in colours]
    stride = _stride([len(item.states) for item in report.labelled])
    return fill_page(
        "states",
        title=html.escape(report.title),
        about=html.escape(report.about),
        method=html.escape(report.method),
        tiles=tiles(_summary(report)),
        headings=_headings(columns),
        rows="\n".join(
            _row(state, _chip(k, colours[k], inks[k]), columns, len(report.labelled))
            for k, state in enumerate(report.states)
        ),
        phases=_phase_table(report.agreement, colours, inks),
        thinned=f" The page contains every {stride}th sample." if stride > 1 else "",
        legend="".join(
            f"<span>{_chip(k, colours[k], inks[k])} {html.escape(state.name)}</span>"
            for k, state in enumerate(report.states)
        ),
        trials="\n".join(_trial(k, item) for k, item in enumerate(report.labelled)),
        made_by=definitions(report.made_by),
        data=script_value(page_data(report.labelled, report.states, colours, stride)),
    )


def page_colours(number: int) -> list[str]:
    """The colours of the states; they repeat if there are more states than colours."""
    distinct = state_colours(min(number, len(TINTS) * len(PALETTE)))
    return [distinct[k % len(distinct)] for k in range(number)]


def ink_on(colour: str) -> str:
    """Returns the colour, black or white, in which a number is easy to read on a colour "#RRGGBB" (WCAG 2.1)."""
    channels = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    luminance = float(linear @ [0.2126, 0.7152, 0.0722])
    return "#000" if (luminance + 0.05) / 0.05 > 1.05 / (luminance + 0.05) else "#fff"


# ------------------------------------------------------------ data of the script


def page_data(
    labelled: Sequence[LabelledRecording], states: Sequence[StateSummary], colours: Sequence[str], stride: int = 1
) -> dict[str, Any]:
    """Returns what the script draws. Values are integers, in units of the ``step`` of their group."""
    recordings = [item.recording for item in labelled]
    groups = channel_groups(recordings[0].channels)
    known = [item for item in labelled if item.recording.phases is not None]
    codes, phases = phase_codes(known) if known else ([], ())
    place = {id(item): code for item, code in zip(known, codes, strict=True)}
    described, columns = [], []
    for group in groups:
        mine = [recordings[0].channels.index(channel) for channel in group.channels]
        values = group.factor * np.concatenate([recording.values[:, mine] for recording in recordings])
        step = _step(values)
        low, high = _axis(values)
        described.append(
            {
                **{"name": group.name, "unit": group.unit, "channels": group.channels, "step": step},
                **{"digits": decimals(values), "low": low, "high": high},
                "cut": bool(values.min() < low or values.max() > high),
            }
        )
        columns += [(column, group.factor / step) for column in mine]
    return {
        "groups": described,
        "states": [{"name": s.name, "colour": c, "ink": ink_on(c)} for s, c in zip(states, colours, strict=True)],
        "phases": phases,
        "gap": GAP,
        "trials": [_series(item, columns, place.get(id(item)), stride) for item in labelled],
    }


def _series(
    item: LabelledRecording, columns: Sequence[tuple[int, float]], phases: NDArray[np.intp] | None, stride: int
) -> dict[str, Any]:
    """The samples of a recording, every ``stride``-th; columns are (index, size of the SI unit in steps)."""
    time = item.recording.time[::stride] - item.recording.time[0]
    values = item.recording.values[::stride]
    return {
        "time": [round(t, 4) for t in time.tolist()],
        "values": [np.rint(size * values[:, column]).astype(int).tolist() for column, size in columns],
        "states": _runs(item.states[::stride]),
        "probability": np.rint(100 * item.probabilities[::stride]).astype(int).tolist(),
        "phases": None if phases is None else _runs(phases[::stride]),
    }


def _runs(labels: NDArray[np.intp]) -> list[list[int]]:
    """The index of the first sample and the label of each run of equal labels."""
    starts = np.flatnonzero(np.diff(labels, prepend=labels[0] - 1))
    return [[int(k), int(labels[k])] for k in starts]


def _stride(lengths: Sequence[int]) -> int:
    """Which samples are shown: every n-th."""
    return max(1, math.ceil(max(lengths) / MAX_SHOWN), math.ceil(sum(lengths) / MAX_SHOWN_TOGETHER))


def _step(values: Array) -> float:
    """A power of ten that resolves the values by at least ``RESOLUTION`` of the largest magnitude."""
    largest = float(np.abs(values).max())
    return 10.0 ** math.floor(math.log10(RESOLUTION * largest)) if largest > 0 else 1.0


def _axis(values: Array) -> tuple[float, float]:
    """The ends of the axis of a group; zero lies between them."""
    low, high = min(0.0, float(values.min())), max(0.0, float(values.max()))
    tail = (1 - CENTRAL) / 2
    inner = np.quantile(values, (tail, 1 - tail))
    inner_low, inner_high = min(0.0, float(inner[0])), max(0.0, float(inner[1]))
    span = inner_high - inner_low
    if span > 0 and high - low > OUTLYING * span:
        low, high = max(low, inner_low - span / 2), min(high, inner_high + span / 2)
    return (low, high) if high > low else (-1.0, 1.0)


def decimals(values: Array) -> int:
    """Number of decimals with which the largest magnitude has three digits, at most five."""
    largest = float(np.abs(values).max()) if len(values) else 0.0
    return int(np.clip(2 - math.floor(math.log10(largest)), 0, 5)) if largest > 0 else 0


# ------------------------------------------------------------ tables


def _summary(report: StatesReport) -> list[tuple[str, str]]:
    """The summary: (value, note) for each tile."""
    recordings = [item.recording for item in report.labelled]
    durations = [recording.duration for recording in recordings]
    rates = sorted(recording.rate for recording in recordings)
    same = rates[-1] < 1.02 * rates[0]
    rate = f"{rates[-1]:.3g}" if same else f"{rates[0]:.3g} to {rates[-1]:.3g}"
    channels = ", ".join(recordings[0].channels)
    summary = [
        (str(len(report.states)), "contact states"),
        (str(len(recordings)), f"recordings of {min(durations):.1f} to {max(durations):.1f} s"),
        (f"{rate} Hz", f"{sum(len(item.states) for item in report.labelled):,} samples"),
        (str(len(recordings[0].channels)), f"channels: {html.escape(channels)}"),
    ]
    if report.agreement is not None:
        summary.append((f"{report.agreement.ari:.2f}", "adjusted Rand index of states and known phases; 1: the same"))
    return summary


@dataclass(frozen=True)
class _Column:
    """A quantity of the table: its name, unit, size of the SI unit in it, and number of decimals."""

    name: str
    unit: str
    factor: float
    digits: int


def _columns(report: StatesReport) -> list[_Column]:
    """The lengths of force and moment, and the channels."""
    columns = []
    for group in channel_groups(report.labelled[0].recording.channels):
        typical = np.array([state.quantities[channel] for state in report.states for channel in group.channels])
        digits = decimals(group.factor * np.nan_to_num(typical))
        length = {"force": FORCE, "moment": MOMENT}.get(group.name)
        names = (*([length] if length in report.states[0].quantities else []), *group.channels)
        columns += [_Column(str(name), group.unit, group.factor, digits) for name in names]
    return columns


def _headings(columns: Sequence[_Column]) -> str:
    quantities = "".join(
        f'<th scope="col">{html.escape(column.name)}<small>{column.unit or "&nbsp;"}</small></th>' for column in columns
    )
    return (
        '<th scope="col" class="text">state<small>&nbsp;</small></th><th scope="col">time<small>share</small></th>'
        '<th scope="col">visits<small>a recording</small></th><th scope="col">duration<small>s</small></th>'
        f'<th scope="col" class="text">what follows<small>share of the visits</small></th>{quantities}'
    )


def _row(state: StateSummary, chip: str, columns: Sequence[_Column], recordings: int) -> str:
    """The table row of a state."""
    following = ", ".join(f"<span>{text}</span>" for text in following_texts(state, LISTED_NEXT))
    cells = [
        f"<td>{100 * state.share:.0f} %</td>",
        f"<td>{state.visits:.1f}<small>in {state.recordings} of {recordings}</small></td>",
        _range(state.duration, 1.0, 2),
        f'<td class="text">{following or "-"}</td>',
        *(_range(state.quantities[column.name], column.factor, column.digits) for column in columns),
    ]
    return f'<tr><th scope="row" class="text">{chip} {html.escape(state.name)}</th>{"".join(cells)}</tr>'


def _range(spread: Spread, size: float, digits: int) -> str:
    """A cell with a median and its range."""
    if math.isnan(spread.median):
        return "<td>-</td>"
    median, low, high = (rounded(size * value, digits) for value in spread)
    return f"<td>{median}<small>{low} to {high}</small></td>"


def rounded(value: float, digits: int) -> str:
    """Text with a fixed number of digits; never "-0"."""
    return f"{0.0 if abs(value) < 0.5 * 10**-digits else value:.{digits}f}"


def _phase_table(agreement: PhaseAgreement | None, colours: Sequence[str], inks: Sequence[str]) -> str:
    """How the samples of each known phase are distributed over the states."""
    if agreement is None:
        return ""
    headings = "".join(f'<th scope="col">{_chip(k, colours[k], inks[k])}</th>' for k in range(len(colours)))
    rows = []
    for name, counts in zip(agreement.phases, agreement.counts, strict=True):
        shares = 100 * counts / counts.sum()
        cells = "".join(f'<td class="{"most" if share >= 50 else ""}">{share:.0f} %</td>' for share in shares)
        rows.append(f'<tr><th scope="row" class="text">{html.escape(name)}</th>{cells}<td>{counts.sum():,}</td></tr>')
    return (
        "<section><h2>Known phases</h2>"
        '<p class="about">Share of the samples of each phase that lie in each state. The learner has not seen the'
        f" phases. Adjusted Rand index {agreement.ari:.2f}: 1 if states and phases are the same, about 0 if they have"
        ' nothing to do with each other.</p><div class="scroll narrow"><table><thead><tr>'
        f'<th scope="col" class="text">phase</th>{headings}<th scope="col">samples</th></tr></thead><tbody>'
        f"{''.join(rows)}</tbody></table></div></section>"
    )


def _chip(k: int, colour: str, ink: str) -> str:
    return f'<i class="chip" style="background: {colour}; color: {ink}">{k}</i>'


def _trial(k: int, item: LabelledRecording) -> str:
    """The place of a recording; the script draws into it."""
    time = item.recording.time - item.recording.time[0]
    runs = _runs(item.states)
    ends = [*(float(time[start]) for start, _ in runs[1:]), float(time[-1])]
    visits = ", ".join(f"{state} until {end:.2f} s" for (_, state), end in zip(runs, ends, strict=True))
    name = html.escape(item.recording.name)
    start = item.recording.time[0]
    begin = f"{start:.6f}".rstrip("0").rstrip(".")
    since = f", from {begin} s of the file on" if start else ""
    return (
        f'<section class="panel trial" id="trial-{k}"><h3>{name}<small>{item.recording.duration:.2f} s{since},'
        f" {len(runs)} visits</small></h3>"
        f'<div class="plot" tabindex="0" role="slider" aria-label="time since the first sample of {name}"'
        f' aria-valuemin="0" aria-valuemax="{item.recording.duration:.2f}" aria-valuenow="0"'
        f' aria-describedby="order-{k}">'
        '<canvas aria-hidden="true"></canvas><div class="cursor"></div></div><p class="readout"></p>'
        f'<details><summary>states in order</summary><p id="order-{k}">{visits}</p></details></section>'
    )
