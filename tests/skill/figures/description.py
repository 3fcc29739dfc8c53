"""A description of a figure in plain numbers and texts, to compare it with a stored one."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axes._secondary_axes import SecondaryAxis
from matplotlib.collections import Collection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch, Patch
from matplotlib.text import Annotation, Text
from matplotlib.ticker import FixedLocator


def describe(figure: Figure) -> list[str]:
    """One line for each visible artist: its kind, data, colour and style, in the order of drawing.

    Positions on the page are left out: they depend on the fonts of the machine.
    """
    figure.canvas.draw()
    lines = [f"figure {numbers(figure.get_size_inches())}"]
    for number, axes in enumerate(figure.axes):
        lines += [f"axes {number} {line}" for line in _axes(axes)]
    lines += [f"figure {_legend(legend)}" for legend in figure.legends]
    if figure.get_suptitle():
        lines.append(f"title {figure.get_suptitle()!r} {numbers(figure._suptitle.get_fontsize())}")
    return lines


def numbers(values: Any) -> str:
    """Numbers with six digits; of many, only their number, sum, extremes and second moment."""
    array = np.ravel(np.asarray(values, dtype=float))
    if len(array) > 12:
        finite = array[np.isfinite(array)]
        array = np.array([len(array), finite.sum(), finite.min(), finite.max(), (finite**2).sum()])
    return " ".join(f"{value:.6g}" for value in array + 0.0)


def _axes(axes: Axes | SecondaryAxis) -> list[str]:
    # Automatic ticks depend on the size of the axes on the page, and so on the fonts.
    fixed = [axis for axis in (axes.xaxis, axes.yaxis) if isinstance(axis.get_major_locator(), FixedLocator)]
    ticks = [text.get_text() for axis in fixed for text in axis.get_ticklabels()]
    sizes = {t.get_fontsize() for axis in (axes.xaxis, axes.yaxis) for t in axis.get_ticklabels()}
    lines = [line for axis in (axes.xaxis, axes.yaxis) for line in axis.get_gridlines()[:1]]
    grid = [f"{g.get_linewidth():g} {to_hex(g.get_color())}" if g.get_visible() else "none" for g in lines]
    lengths = [line.get_markersize() for axis in (axes.xaxis, axes.yaxis) for line in axis.get_ticklines()[:1]]
    result = [
        f"limits {numbers([*axes.get_xlim(), *axes.get_ylim()])} order {axes.get_zorder():g}",
        f"ticks {ticks} {numbers(sorted(sizes))} length {numbers(lengths)} grid {grid} {axes.get_axisbelow()}",
        f"spines {[name for name, spine in axes.spines.items() if spine.get_visible()]}",
        f"axis {axes.axison} background {axes.patch.get_visible()} aspect {axes.get_aspect()}",
    ]
    for text in (axes.xaxis.label, axes.yaxis.label, axes.title, axes._left_title):
        if text.get_text():
            result.append(_text(text))
    for artist in axes.get_children():
        if artist not in (axes.patch, axes.title, axes._left_title, axes._right_title):
            result += _artist(artist)
    return result


def _artist(artist: Artist) -> list[str]:
    alpha = "" if artist.get_alpha() is None else f" alpha {artist.get_alpha():g}"
    common = f"order {artist.get_zorder():g}{alpha}"
    if isinstance(artist, Line2D):
        marker = f"{artist.get_marker()} {artist.get_markersize():g} {artist.get_markeredgewidth():g}"
        style = f"{to_hex(artist.get_color())} {artist.get_linewidth():g} {artist._unscaled_dash_pattern} {marker}"
        data = f"{numbers(artist.get_xdata(orig=False))} | {numbers(artist.get_ydata(orig=False))}"
        return [f"line {data} {style} {artist.get_drawstyle()} {common}"]
    if isinstance(artist, Legend):
        return [_legend(artist)]
    if isinstance(artist, FancyArrowPatch):
        (x0, y0), (x1, y1) = artist._posA_posB
        style = f"{artist.get_mutation_scale():g} {artist.get_linewidth():.6g} {artist.shrinkA:g} {artist.shrinkB:g}"
        bow = vars(artist.get_connectionstyle()).get("rad")
        return [f"arrow {numbers([x0, y0, x1, y1])} {to_hex(artist.get_edgecolor())} {style} bow {bow:g} {common}"]
    if isinstance(artist, Collection):
        sizes = artist.get_sizes() if hasattr(artist, "get_sizes") else []
        style = f"{[to_hex(c) for c in artist.get_facecolor()[:3]]} {[to_hex(c) for c in artist.get_edgecolor()[:3]]}"
        paths = [path.vertices for path in artist.get_paths()]
        return [
            f"points {numbers(np.ma.filled(artist.get_offsets(), np.nan))} {numbers(np.concatenate(paths))} {style}"
            f" {numbers(sizes)} {numbers(artist.get_linewidths())} {common}"
        ]
    if isinstance(artist, Patch):
        x, y = artist.get_path().vertices.T if not hasattr(artist, "get_bbox") else artist.get_bbox().get_points().T
        style = f"{to_hex(artist.get_facecolor())} {artist.get_linewidth():g}"
        return [f"patch {numbers(x)} | {numbers(y)} {style} {common}"]
    if isinstance(artist, Text) and artist.get_text():
        return [_text(artist)]
    if isinstance(artist, SecondaryAxis):
        return [f"secondary {line}" for line in _axes(artist)]
    return []


def _text(text: Text) -> str:
    place = f" {numbers(text.xy)} {numbers(text.xyann)}" if isinstance(text, Annotation) else ""
    style = f"{numbers(text.get_fontsize())} {to_hex(text.get_color())} {text.get_ha()} {text.get_va()}"
    return f"text {text.get_text()!r} {style} order {text.get_zorder():g}{place}"


def _legend(legend: Legend) -> str:
    handles = [line for handle in legend.legend_handles for line in _artist(handle)]
    texts = [(t.get_text(), t.get_fontsize()) for t in legend.get_texts()]
    title = (legend.get_title().get_text(), legend.get_title().get_fontsize())
    space = f"{legend.handlelength:g} {legend.columnspacing:g}"
    columns = f"columns {legend._ncols} space {space}"
    return f"legend {texts} {title} {columns} frame {legend.get_frame_on()} {legend._loc} {handles}"
