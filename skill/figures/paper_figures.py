"""The figures of the paper from stored data: a demonstration, an insertion, and the outcomes of trials.

The figures use the objects of matplotlib, not its global state, so that they can be made in any thread and without a
screen. Their units are mm, degrees, N and N mm.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from skill.arrays import Array
from skill.data.demonstration import Demonstration
from skill.data.files import write_atomically
from skill.data.rig_run import RigRun
from skill.states.state_style import state_colours, state_labels

INK = "#1D2329"
FIRST, SECOND, THIRD = "#0072B2", "#D55E00", "#009E73"  # x, y and z
OTHER = "#A05A8C"
DEGREES = float(np.degrees(1.0))
WIDTH = 7.2  # in units of inches, width of a text block
ROW_PITCH = 2.3  # distance of the zero lines of stacked series, each in the range -1 to 1
SHORT_NAME = 12  # maximum length of state names for a legend with five columns
MAX_LISTED = 20  # maximum number of trials that are numbered one by one
RESOLUTION = 200  # of a PNG file, dots per inch


def plot_demonstration(demonstration: Demonstration) -> Figure:
    """Draws the fourteen channels of one demonstration over time, as in Fig. 3 of the paper."""
    data = demonstration.samples
    time = data["time"].to_numpy(dtype=float)
    figure = new_figure(5.6)
    panels = figure.subplots(3, 2, sharex=True)
    groups = (
        ("Position of the tip across the hole (mm)", 1e3, ("x", "y")),
        ("Position of the tip along the hole (mm)", 1e3, ("z",)),
        ("Force (N)", 1.0, ("fx", "fy", "fz")),
        ("Moment about the tip (N mm)", 1e3, ("mx", "my", "mz")),
        ("Axis of rotation", 1.0, ("ax", "ay", "az")),
        ("Angle of rotation (deg)", DEGREES, ("angle",)),
    )
    colours = dict(zip("xyz", (FIRST, SECOND, THIRD), strict=True))
    for axes, (title, factor, channels) in zip(panels.flat, groups, strict=True):
        for channel in channels:
            colour = colours.get(channel[-1], INK)
            axes.plot(time, factor * data[channel], color=colour, label=_symbol(channel), linewidth=1.3)
        axes.set_title(title, loc="left", fontsize=9)
        tidy(axes)
    turning = panels[2, 1]
    change = turning.twinx()
    change.plot(time, DEGREES * data["dangle"], color=OTHER, linewidth=0.9, label=_symbol("dangle"))
    change.set_ylabel("change per sample (deg)", color=OTHER, fontsize=8)
    change.tick_params(labelsize=8, colors=OTHER)
    change.spines["top"].set_visible(False)
    turning.plot([], [], color=OTHER, linewidth=0.9, label=_symbol("dangle"))
    turning.set_zorder(change.get_zorder() + 1)
    turning.patch.set_visible(False)
    for axes in panels.flat:
        axes.legend(ncols=3, fontsize=8, loc="best", frameon=False, handlelength=1.2, columnspacing=1.0)
    for axes in panels[-1]:
        axes.set_xlim(time[0], time[-1])
        axes.set_xlabel("time (s)", fontsize=9)
    force = np.linalg.norm(data[["fx", "fy", "fz"]], axis=1).max()
    figure.suptitle(
        f"{demonstration.reason} ({'good' if demonstration.good else 'bad'}): {demonstration.duration:.2f} s,"
        f" {len(data)} samples, to a depth of {-1e3 * data['z'].iloc[-1]:.1f} mm, force up to {force:.1f} N",
        fontsize=9,
    )
    return figure


def plot_run(run: RigRun) -> Figure:
    """Draws one insertion of the rig over the contact states, as in Fig. 5 of the paper.

    The upper panel has six series, each divided by its largest magnitude; the lower one has the corrections of the
    motors and the back-offs. The states have the names in the metadata of the run, or else their numbers.

    Raises:
        ValueError: if there are fewer names than states.
    """
    data = run.samples
    time = data["time"].to_numpy(dtype=float)
    state = np.rint(data["state"]).to_numpy(dtype=int)
    names = run.metadata.get("state_names")
    labels = state_labels(max(state.max() + 1, len(names or ())), names)
    colours = state_colours(len(labels))

    figure = new_figure(6.4)
    series, steps = figure.subplots(2, 1, sharex=True, height_ratios=(3.6, 1.0))
    for axes in (series, steps):
        for start, end, k in _stretches(time, state):
            axes.axvspan(start, end, color=colours[k], alpha=0.30, linewidth=0)
    _draw_series(series, data)
    _draw_corrections(steps, data)
    for axes in (series, steps):
        tidy(axes, grid=False)
        axes.set_xlim(time[0], time[-1])
    visited = [k for k in range(len(labels)) if (state == k).any()]
    figure.legend(
        handles=[Patch(facecolor=colours[k], alpha=0.45, edgecolor=colours[k], label=labels[k]) for k in visited],
        loc="outside upper center",
        ncols=min(len(visited), 5 if max(map(len, labels)) <= SHORT_NAME else 2),
        fontsize=8,
        frameon=False,
        title=_run_title(run),
        title_fontsize=9,
    )
    return figure


def _draw_series(axes: Axes, data: pd.DataFrame) -> None:
    """Draws wrench and height, each divided by its largest magnitude, one above the other."""
    time = data["time"].to_numpy(dtype=float)
    rows: tuple[tuple[str, Array, float, str], ...] = (
        ("$f_x$", data["fx"].to_numpy(dtype=float), 1.0, "N"),
        ("$f_y$", data["fy"].to_numpy(dtype=float), 1.0, "N"),
        ("$f_z$", data["fz"].to_numpy(dtype=float), 1.0, "N"),
        ("$M_x$", data["mx"].to_numpy(dtype=float), 1e3, "N mm"),
        ("$M_y$", data["my"].to_numpy(dtype=float), 1e3, "N mm"),
        ("$z$", -data["depth"].to_numpy(dtype=float), 1e3, "mm"),
    )
    heights, scales = [], []
    for row, (_, values, factor, unit) in enumerate(rows):
        height = -ROW_PITCH * row
        largest = float(np.abs(values).max())
        axes.axhline(height, color="white", linewidth=0.8)
        axes.plot(time, height + values / (largest or 1.0), color=INK, linewidth=1.1)
        heights.append(height)
        scales.append(f"1 = {factor * largest:.3g} {unit}")
    axes.set_yticks(heights, [name for name, *_ in rows])
    axes.set_ylim(heights[-1] - 1.2, 1.2)
    axes.set_ylabel("each over its largest magnitude", fontsize=9)
    right = axes.secondary_yaxis("right")
    right.set_yticks(heights, scales, fontsize=8)
    right.tick_params(length=0)
    right.spines["right"].set_visible(False)


def _draw_corrections(axes: Axes, data: pd.DataFrame) -> None:
    """Draws the commanded angles of the hole, and a bar at the bottom during a back-off."""
    time = data["time"].to_numpy(dtype=float)
    for name, colour in (("pitch", FIRST), ("yaw", SECOND)):
        turned = DEGREES * data[f"target_{name}"].to_numpy(dtype=float)
        axes.step(time, turned, where="post", color=colour, linewidth=1.5, label=name)
    axes.set_ylabel("correction (deg)", fontsize=9)
    axes.set_xlabel("time (s)", fontsize=9)
    handles, texts = axes.get_legend_handles_labels()
    back_off = data["back_off"].to_numpy(dtype=float) > 0.5
    if back_off.any():
        for start, end, on in _stretches(time, back_off.astype(int)):
            if on:
                axes.axvspan(start, end, ymin=0.0, ymax=0.09, color=INK, linewidth=0)
        handles, texts = [*handles, Patch(color=INK)], [*texts, "back-off"]
    low, high = axes.get_ylim()
    axes.set_ylim(low - 0.18 * (high - low), high)  # space for the bar of the back-offs below the curves
    axes.legend(handles, texts, ncols=3, fontsize=8, loc="best", frameon=False)


OUTCOMES = (
    ("time_s", "time (s)"),
    ("peak_load_n", "peak load (N)"),
    ("peak_contact_n", "peak force of a\nsingle contact (N)"),
)
"""Columns that `plot_outcomes` draws, and their labels."""


def plot_outcomes(results: pd.DataFrame) -> Figure:
    """Draws time and peak forces of rig trials, with the medians of the successful ones.

    Args:
        results: one row for each trial, with the columns inserted, time_s, peak_load_n and peak_contact_n, and
            optionally seed, the number of the trial; without it the trials are numbered from 1.

    Raises:
        ValueError: if there is no trial, or a column is missing.
    """
    missing = [c for c in ("inserted", *(name for name, _ in OUTCOMES)) if c not in results.columns]
    if missing or results.empty:
        raise ValueError(f"results: {len(results)} trials, missing columns {missing}; expected one row for each trial")
    inserted = results["inserted"].to_numpy(dtype=bool)
    number = results["seed"].to_numpy() if "seed" in results.columns else np.arange(1, len(results) + 1)
    figure = new_figure(4.8)
    panels = figure.subplots(len(OUTCOMES), 1, sharex=True)
    for axes, (column, label) in zip(panels, OUTCOMES, strict=True):
        _draw_trials(axes, number, results[column].to_numpy(dtype=float), inserted)
        axes.set_ylabel(label, fontsize=9)
        tidy(axes)
        axes.grid(visible=False, axis="x")
    *_, bottom = panels
    bottom.set_xlabel("trial", fontsize=9)
    bottom.set_xlim(number.min() - 0.6, number.max() + 0.6)
    if len(results) <= MAX_LISTED:
        bottom.set_xticks(number)
    else:
        bottom.xaxis.set_major_locator(MaxNLocator(integer=True))
    marks = [
        Line2D([], [], marker="o", color=FIRST, linestyle="", label=f"inserted: {inserted.sum()}"),
        Line2D([], [], marker="X", color=SECOND, linestyle="", label=f"not inserted: {(~inserted).sum()}"),
        Line2D([], [], color=FIRST, linestyle=(0, (5, 3)), linewidth=1.0, label="median of the inserted"),
    ]
    shown = [
        mark for mark, used in zip(marks, (inserted.any(), (~inserted).any(), inserted.any()), strict=True) if used
    ]
    figure.legend(handles=shown, loc="outside upper center", ncols=3, fontsize=8, frameon=False)
    return figure


def _draw_trials(axes: Axes, number: NDArray[Any], values: Array, inserted: NDArray[np.bool_]) -> None:
    """Draws one value for each trial, and the median of the successful ones."""
    axes.vlines(number, 0.0, values, color="#D3DAE0", linewidth=1.2, zorder=1)
    axes.scatter(number[inserted], values[inserted], s=34, color=FIRST, zorder=3)
    axes.scatter(number[~inserted], values[~inserted], s=42, color=SECOND, marker="X", zorder=3)
    if inserted.any():
        middle = float(np.median(values[inserted]))
        axes.axhline(middle, color=FIRST, linewidth=1.0, linestyle=(0, (5, 3)), zorder=2)
        axes.annotate(
            f"{middle:.3g}",
            (1.0, middle),
            xycoords=("axes fraction", "data"),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            color=FIRST,
            fontsize=8,
        )
    axes.set_ylim(0.0, 1.15 * max(float(np.nanmax(values)), 1e-9))


def save_figure(figure: Figure, path: Path) -> None:
    """Writes a figure atomically.

    Args:
        figure: figure to write.
        path: target file; its suffix selects the format (png, svg, pdf).

    Raises:
        ValueError: if the suffix is not a known format. The message names the path.
    """
    path = Path(path)
    format_ = path.suffix[1:].lower()
    known = figure.canvas.get_supported_filetypes()
    if format_ not in known:
        raise ValueError(f"{path}: suffix '{path.suffix}' is not a figure format; expected one of {sorted(known)}")
    stream = io.BytesIO()
    figure.savefig(stream, format=format_, dpi=RESOLUTION)
    write_atomically(path, stream.getvalue())


def new_figure(height: float) -> Figure:
    """Returns an empty figure of the common width with a canvas; ``height`` in inches."""
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def tidy(axes: Axes, *, grid: bool = True) -> None:
    """Applies the common style: no frame above and to the right, small tick labels, and optionally a light grid."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8)
    if grid:
        axes.grid(color="#E3E7EB", linewidth=0.6)
    axes.set_axisbelow(True)


def _symbol(channel: str) -> str:
    if channel in ("angle", "dangle"):
        return {"angle": r"$\theta$", "dangle": r"$\Delta\theta$"}[channel]
    return f"${channel[0]}_{channel[1]}$" if len(channel) == 2 else f"${channel}$"


def _stretches(time: Array, value: NDArray[np.int64]) -> list[tuple[float, float, int]]:
    """Start time, end time and value of each stretch of equal values; a sample is valid until the next one."""
    starts = np.flatnonzero(np.diff(value, prepend=value[0] - 1))
    ends = [*(float(time[k]) for k in starts[1:]), float(time[-1])]
    return [(float(time[k]), end, int(value[k])) for k, end in zip(starts, ends, strict=True)]


def _run_title(run: RigRun) -> str:
    result = run.result
    parts = [str(result.get("reason", "")), *([f"{result['time_s']:.2f} s"] if "time_s" in result else [])]
    if "tilt_deg" in result and len(result["tilt_deg"]) == 2:
        parts.append("from a tilt of {:.1f}° and {:.1f}°".format(*result["tilt_deg"]))
    return ", ".join(p for p in parts if p)
