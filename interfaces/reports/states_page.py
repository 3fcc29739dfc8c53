"""One self-contained HTML page about discovered contact states: what they are, and every recording over its states.

The layout is in states.html and states.css; states.js reads the values at a cursor.
"""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from interfaces.reports.page_template import definitions, fill_page
from interfaces.reports.result_tables import following_texts
from interfaces.reports.series import TICKS, bands, curve, drawing
from skill.arrays import Array
from skill.recordings.channel_groups import ChannelGroup, channel_groups
from skill.states.phase_agreement import PhaseAgreement, phase_codes
from skill.states.state_style import PALETTE, TINTS, state_colours
from skill.states.state_summary import FORCE, MOMENT, LabelledRecording, Spread, StateSummary

MAX_SHOWN, MAX_SHOWN_TOGETHER = 20_000, 500_000
"""Largest number of samples of a recording, and of all together, in the page; if there are more, it has every n-th."""

RESOLUTION = 1 / 5000
"""Resolution of the series, as a share of the largest magnitude of their group, at most."""

LISTED_NEXT = 3
"""Largest number of following states that the table lists."""

SERIES_COLOURS = 6
"""Number of colours of series in states.css."""

PHASE_COLOURS = ("var(--phase-0)", "var(--phase-1)")


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


@dataclass(frozen=True)
class _Panel:
    """How the series of a group of channels are drawn in every recording.

    Attributes:
        group: the channels.
        columns: their places among all channels.
        step: unit of the drawn values, in the unit in which people read them.
        low: smallest value in this unit, or 0.
        high: largest one, or 0.
        digits: number of decimals.
    """

    group: ChannelGroup
    columns: list[int]
    step: float
    low: float
    high: float
    digits: int


def states_page(report: StatesReport) -> str:
    """Returns the page as HTML text; it needs no other file."""
    lengths = [len(item.states) for item in report.labelled]
    stride = max(1, math.ceil(max(lengths) / MAX_SHOWN), math.ceil(sum(lengths) / MAX_SHOWN_TOGETHER))
    channels = report.labelled[0].recording.channels
    number = min(len(report.states), len(TINTS) * len(PALETTE))
    colours = [state_colours(number)[k % number] for k in range(len(report.states))]
    chips = [f'<i class="chip" style="--colour: {colour}">{k}</i>' for k, colour in enumerate(colours)]
    known = [item for item in report.labelled if item.recording.phases is not None]
    codes, phases = phase_codes(known) if known else ([], ())
    code_of = {id(item): code for item, code in zip(known, codes, strict=True)}
    panels = [_panel(group, report.labelled) for group in channel_groups(channels)]
    return fill_page(
        "states",
        assets=("page", "states"),
        title=html.escape(report.title),
        about=html.escape(report.about),
        method=html.escape(report.method),
        tiles="".join(
            f'<div class="panel tile"><b>{value}</b><span>{note}</span></div>' for value, note in _summary(report)
        ),
        table=_state_table(report, chips),
        phases=_phase_table(report.agreement, chips),
        thinned=f" The page contains every {stride}th sample." if stride > 1 else "",
        style="".join(
            f"body:has(#show-{k}:not(:checked)) .channel-{k} {{ display: none }}\n" for k in range(len(channels))
        ),
        channels="".join(_switches(panel) for panel in panels),
        legend="".join(
            f"<span>{chip} {html.escape(state.name)}</span>" for chip, state in zip(chips, report.states, strict=True)
        ),
        trials="\n".join(
            _trial(item, panels, stride, report.states, colours, phases, code_of.get(id(item)))
            for item in report.labelled
        ),
        made_by=definitions(report.made_by),
    )


# ------------------------------------------------------------ recordings


def _panel(group: ChannelGroup, labelled: Sequence[LabelledRecording]) -> _Panel:
    """The scale of a group of channels, over all recordings: a power of ten that resolves the largest magnitude."""
    recordings = [item.recording for item in labelled]
    columns = [recordings[0].channels.index(channel) for channel in group.channels]
    values = group.factor * np.concatenate([recording.values[:, columns] for recording in recordings])
    largest = float(np.abs(values).max())
    step = 10.0 ** math.floor(math.log10(RESOLUTION * largest)) if largest > 0 else 1.0
    low, high = min(0.0, float(values.min())), max(0.0, float(values.max()))
    return _Panel(group, columns, step, low, high, decimals(values))


def _switches(panel: _Panel) -> str:
    """What shows and hides each series of a group, and tells its colour."""
    boxes = "".join(
        f'<label><input type="checkbox" id="show-{column}" checked><i style="background: {_series_colour(k)}"></i>'
        f"{html.escape(channel)}</label>"
        for k, (column, channel) in enumerate(zip(panel.columns, panel.group.channels, strict=True))
    )
    return f"<span>{_named(panel.group.name, panel.group.unit)}</span>{boxes}"


def _trial(
    item: LabelledRecording,
    panels: Sequence[_Panel],
    stride: int,
    states: Sequence[StateSummary],
    colours: Sequence[str],
    phases: Sequence[str],
    codes: NDArray[np.intp] | None,
) -> str:
    """A recording: its series over its states, and over its phases if they are known."""
    recording = item.recording
    time, values = (recording.time - recording.time[0])[::stride], recording.values[::stride]
    titles = [f"state {k}: {state.name}" for k, state in enumerate(states)]
    labels, numbers = item.states[::stride], [str(k) for k in range(len(states))]
    strips = f'<div class="band" data-name="state">{bands(time, labels, colours, titles, numbers)}</div>'
    if codes is not None:
        greys, named = [PHASE_COLOURS[k % 2] for k in range(len(phases))], [f"phase {name}" for name in phases]
        strips += f'<div class="band" data-name="phase">{bands(time, codes[::stride], greys, named, phases)}</div>'
    probability = " ".join(f"{100 * p:.0f}" for p in item.probabilities[::stride])
    name, begin = html.escape(recording.name), f"{recording.time[0]:.6f}".rstrip("0").rstrip(".")
    since = f", from {begin} s of the file on" if recording.time[0] else ""
    return (
        f'<section class="panel trial"><h3>{name}<small>{recording.duration:.2f} s{since}</small></h3>'
        f'<div class="plot" tabindex="0" role="slider" aria-label="time since the first sample of {name}"'
        f' aria-valuemin="0" aria-valuemax="{recording.duration:.2f}" aria-valuenow="0"'
        f' data-probability="{probability}"><div class="tint">{bands(time, labels, colours, titles)}</div>'
        f"{''.join(_series(panel, time, values) for panel in panels)}{strips}"
        '<div class="cursor"></div></div><p class="readout"></p></section>'
    )


def _series(panel: _Panel, time: Array, values: Array) -> str:
    """A drawing of the series of a group, with the range of its axis above it."""
    group, step = panel.group, panel.step
    curves = "".join(
        f'<path class="channel-{column}" data-name="{html.escape(channel)}" stroke="{_series_colour(k)}"'
        f' d="{curve(time, group.factor / step * values[:, column])}"/>'
        for k, (column, channel) in enumerate(zip(panel.columns, group.channels, strict=True))
    )
    zero = f'<path class="zero" d="M0 0H{TICKS * time[-1]:.0f}"/>'
    low, high = panel.low / step, panel.high / step
    attributes = f'data-step="{step:g}" data-digits="{panel.digits}" data-unit="{group.unit}"'
    ends = " to ".join(rounded(end, panel.digits) for end in (panel.low, panel.high))
    return (
        f"<h4>{_named(group.name, group.unit)}<small>{ends}</small></h4>"
        f"{drawing(float(time[-1]), low, high if high > low else low + 1.0, zero + curves, attributes)}"
    )


def _series_colour(k: int) -> str:
    return f"var(--series-{k % SERIES_COLOURS})"


def _named(name: str, unit: str) -> str:
    return f"{html.escape(name)} ({unit})" if unit else html.escape(name)


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


def _state_table(report: StatesReport, chips: Sequence[str]) -> str:
    """A row per state: the lengths of force and moment, and the channels, among others."""
    states = report.states
    columns = {
        ("state", ""): [  # no break after the sign of an axis, nor between a number and its unit
            f"{chip} {html.escape(state.name).replace('-', '-&NoBreak;').replace(' N', '&nbsp;N')}"
            for chip, state in zip(chips, states, strict=True)
        ],
        ("time", "share"): [f"{100 * state.share:.0f} %" for state in states],
        ("visits", "a recording"): [
            f"{state.visits:.1f}<small>in {state.recordings} of {len(report.labelled)}</small>" for state in states
        ],
        ("duration", "s"): [_range(state.duration, 1.0, 2) for state in states],
        ("what follows", "share of the visits"): [
            ", ".join(following_texts(state, LISTED_NEXT)) or "-" for state in states
        ],
    }
    for group in channel_groups(report.labelled[0].recording.channels):
        typical = np.array([state.quantities[channel] for state in states for channel in group.channels])
        digits = decimals(group.factor * np.nan_to_num(typical))
        length = {"force": FORCE, "moment": MOMENT}.get(group.name)
        names = (*([length] if length in states[0].quantities else []), *group.channels)
        for name in names:
            columns[str(name), group.unit] = [_range(s.quantities[str(name)], group.factor, digits) for s in states]
    return _html(
        {f"{html.escape(name)}<small>{unit or '&nbsp;'}</small>": cells for (name, unit), cells in columns.items()}
    )


def _range(spread: Spread, size: float, digits: int) -> str:
    """A cell with a median and its range."""
    if math.isnan(spread.median):
        return "-"
    median, low, high = (rounded(size * value, digits) for value in spread)
    return f"{median}<small>{low} to {high}</small>"


def rounded(value: float, digits: int) -> str:
    """Text with a fixed number of digits; never "-0"."""
    return f"{0.0 if abs(value) < 0.5 * 10**-digits else value:.{digits}f}"


def _phase_table(agreement: PhaseAgreement | None, chips: Sequence[str]) -> str:
    """How the samples of each known phase are distributed over the states."""
    if agreement is None:
        return ""
    shares = 100 * agreement.counts / agreement.counts.sum(axis=1, keepdims=True)
    table = _html(
        {
            "phase": [html.escape(name) for name in agreement.phases],
            **{chip: [f"{share:.0f} %" for share in column] for chip, column in zip(chips, shares.T, strict=True)},
            "samples": [f"{count:,}" for count in agreement.counts.sum(axis=1)],
        }
    )
    return (
        "<section><h2>Known phases</h2>"
        '<p class="about">Share of the samples of each phase that lie in each state. The learner has not seen the'
        f" phases. Adjusted Rand index {agreement.ari:.2f}: 1 if states and phases are the same, about 0 if they have"
        f' nothing to do with each other.</p><div class="scroll narrow">{table}</div></section>'
    )


def _html(columns: Mapping[str, Sequence[str]]) -> str:
    """A table of HTML texts by their headings."""
    return pd.DataFrame(columns).to_html(index=False, escape=False, border=0)
