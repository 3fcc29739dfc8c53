"""Picture of how a peg fits into its hole."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from models.cad.pair import ANGLES, FINE, Fit

SHOWN = 0.04
"""Size at which the smallest clearance is drawn, over the radius of the largest circle inside the peg."""


def plot_part(found: Fit) -> Figure:
    """Draws the section with a magnified clearance, and the clearance over the angle at each depth."""
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    section, clearance = figure.subplots(1, 2)
    guide = found.guide
    points = 1e3 * guide.section.polyline(FINE)
    angles = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
    magnified = max(1.0, SHOWN * guide.section.inner_radius / found.clearance)
    seen = np.angle(points @ [1.0, 1j])
    gap = 1e3 * magnified * np.interp(seen, angles, guide.clearance, period=2.0 * np.pi)
    along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    outwards = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
    hole = points + gap[:, None] * outwards
    section.fill(*hole.T, color="#d9e4ec", ec="0.3", lw=1.2)
    section.fill(*points.T, color="#7c93a8", ec="0.2", lw=1.2)
    section.plot(0.0, 0.0, "+", color="0.1", ms=9)
    title = f"peg in hole, clearance {magnified:.1f} times as wide"
    section.set(aspect="equal", xlabel="mm", ylabel="mm", title=title)
    for mating in found.matings:
        first, last = (1e3 * depth for depth in mating.depths)
        clearance.plot(np.degrees(angles), 1e6 * mating.clearance, label=f"{first:.2f} to {last:.2f} mm deep")
    clearance.set(xlabel="angle about the axis (deg)", ylabel="clearance (µm)", title="clearance", xlim=(0.0, 360.0))
    clearance.set_xticks(range(0, 361, 60))
    clearance.set_ylim(bottom=0.0, top=1.25e6 * max(float(mating.clearance.max()) for mating in found.matings))
    clearance.legend(fontsize=8, loc="lower left")
    return figure
