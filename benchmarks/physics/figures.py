"""The pictures of docs/physics.md, which `benchmarks.physics.theory` draws from its results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from models.contact_theory import jamming_vertices, slenderness, two_point_depth
from models.scenario import Scenario
from skill.states.state_style import PALETTE

BLUE, ORANGE, GREEN, WINE = PALETTE[0], PALETTE[1], PALETTE[2], PALETTE[7]


def draw_depth(result: dict[str, Any], path: Path) -> None:
    """Draws the two-point depth over the tilt."""
    g = Scenario().geometry
    tilt = np.linspace(0.22, 3.2, 300)
    figure, axis = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
    h = 1e3 * two_point_depth(np.radians(tilt), peg_radius=g.peg_radius, hole_radius=g.hole_radius)
    axis.plot(tilt, h, color="0.3", label="exact: $(D - r(\\cos\\theta + 1/\\cos\\theta))\\,/\\,\\tan\\theta$")
    axis.plot(
        result["tilts_deg"], result["two_point_depth_mm"], "o", color=BLUE, label="meshes, corners on both circles"
    )
    label = "meshes, bore outside its circle"
    axis.plot(result["tilts_deg"], result["two_point_depth_default_mm"], "x", color=ORANGE, label=label)
    axis.set(xlabel="tilt [deg]", ylabel="depth of two-point contact [mm]", xscale="log", yscale="log")
    axis.set_xticks([0.25, 0.5, 1, 2, 3], ["0.25", "0.5", "1", "2", "3"], minor=False)
    axis.set_xticks([], minor=True)
    axis.set_yticks([2, 5, 10, 20], ["2", "5", "10", "20"])
    axis.set_yticks([], minor=True)
    axis.legend(frameon=False)
    _finish(figure, path)


def draw_jamming(results: Sequence[dict[str, Any]], path: Path) -> None:
    """Draws the loads that slid and stuck in the jamming diagram, one panel per friction."""
    figure, axes = plt.subplots(1, len(results), figsize=(3.6 * len(results), 3.8), layout="constrained", squeeze=False)
    for axis, result in zip(axes[0], results, strict=True):
        trials = np.array(result["jam_trials"])
        mu, radius = result["friction"], Scenario().geometry.peg_radius
        lam = float(slenderness(1e-3 * result["load_depth_mm"], peg_radius=radius, friction=mu))
        slid = trials[:, 3] > 0.5
        axis.plot(*trials[slid, :2].T, "o", ms=3.5, color=BLUE, label="slid")
        axis.plot(*trials[~slid, :2].T, "x", ms=4, color=ORANGE, label="stuck")
        corners = jamming_vertices(slenderness=lam, friction=mu)
        axis.fill(*corners.T, facecolor=BLUE, alpha=0.08)
        axis.plot(*np.vstack([corners, corners[:1]]).T, color="0.3", lw=1, label="predicted edge")
        title = f"μ = {mu:g}, λ = {lam:.3g}: {100 * result['jam_agreement']:.1f} % as predicted"
        axis.set(xlabel="$F_x/F_z$", title=title)
        axis.title.set_size(9.5)
    axes[0, 0].set_ylabel("$M/(r F_z)$")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    _finish(figure, path)


def draw_wedging(results: Sequence[dict[str, Any]], path: Path) -> None:
    """Draws the part of its squeeze that a peg keeps over tilt / (c / mu)."""
    figure, axis = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
    for colour, result in zip((BLUE, ORANGE, GREEN, WINE), results, strict=False):
        tilt, kept = np.array(result["wedge_trials"]).T
        law = np.radians(result["wedge_angle_law_deg"])
        order = np.argsort(tilt)
        label = f"μ = {result['friction']:g}"
        axis.plot(tilt[order] / law, np.maximum(kept[order], -0.3), "o-", ms=4, lw=1, color=colour, label=label)
        if result["wedge_angle_exact_deg"] is not None:
            axis.axvline(np.radians(result["wedge_angle_exact_deg"]) / law, color=colour, ls=":", lw=1.5)
    axis.axvline(1.0, color="0.3", lw=1)
    axis.text(0.99, 1.04, "c / μ", ha="right", va="bottom", color="0.3")
    axis.axhline(0.9, color="0.8", lw=1, zorder=0)
    xlabel = "tilt / (c / μ); dotted: both friction cones, exactly"
    axis.set(xlabel=xlabel, ylabel="squeeze kept without load", ylim=(-0.35, 1.15))
    axis.legend(frameon=False, loc="lower right")
    _finish(figure, path)


def draw_balance(results: Sequence[dict[str, Any]], path: Path) -> None:
    """Draws the simulated over the predicted axial force of a sliding peg."""
    figure, axis = plt.subplots(figsize=(4.6, 4.0), layout="constrained")
    for colour, result in zip((BLUE, ORANGE, GREEN, WINE), results, strict=False):
        predicted = 1e3 * np.array(result["axial_force_predicted"])
        measured = 1e3 * np.array(result["axial_force_measured"])
        axis.plot(predicted, measured, "o", color=colour, label=f"μ = {result['friction']:g}")
    limit = 1.08 * max(1e3 * max(result["axial_force_measured"]) for result in results)
    axis.plot([0, limit], [0, limit], color="0.3", lw=1)
    axis.fill_between([0, limit], [0, 0.95 * limit], [0, 1.05 * limit], color="0.9", label="within 5 %")
    axis.set(xlabel="predicted axial force [mN]", ylabel="simulated [mN]", xlim=(0, limit), ylim=(0, limit))
    axis.legend(frameon=False)
    _finish(figure, path)


def _finish(figure: Any, path: Path) -> None:
    for axis in figure.axes:
        axis.spines[["top", "right"]].set_visible(False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150, metadata={"Date": None} if path.suffix == ".svg" else None)
    plt.close(figure)


def draw_all(depths: dict[str, Any], laws: Sequence[dict[str, Any]], folder: Path) -> None:
    """Draws the pictures of `benchmarks.physics.theory.depths` and of its ``laws`` at up to four frictions."""
    with plt.rc_context({"svg.hashsalt": "physics"}):
        draw_depth(depths, folder / "two_point_depth.svg")
        draw_jamming(laws, folder / "jamming.svg")
        draw_wedging(laws, folder / "wedging.svg")
        draw_balance(laws, folder / "force_balance.svg")
