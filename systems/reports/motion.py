"""What a stored demonstration or rig run shows: poses, wrench and contact state over time, in one form for both."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from models.bore import TriangleMesh, make_bore
from skill.arrays import Array
from skill.data.demonstration import Demonstration, read_demonstration
from skill.data.rig_run import RigRun, read_rig_run
from skill.states.state_style import state_colours, state_labels

if TYPE_CHECKING:
    from skill.manipulation_skill import ManipulationSkill

SIZES = (
    *("peg_radius", "peg_length", "hole_radius", "hole_depth", "chamfer"),
    *("facets", "block_radius", "floor"),
)
"""What must be known of the geometry; in m, but for the number of facets."""

KEPT = (3 / 8, 7 / 8)  # of the block's ring, in turns, in its picture; one looks in from the other half

FORCE_LEVELS = (0.5, 2.0, 8.0, 30.0)  # in units of N, where a demonstration's states are not known
LEVEL_COLOURS = ("#B0B7BF", "#9ECAE1", "#4292C6", "#08519C", "#081D58")  # one hue, from light to dark


@dataclass(frozen=True)
class Motion:
    """Everything that a replay shows, in SI units.

    Attributes:
        kind: "demonstration" or "rig run".
        outcome: in a word or two.
        time: (n,), s, from 0.
        R_WP: n orientations of the peg.
        p_WP: (n, 3), position of its tip, m.
        R_WH: n orientations of the hole block.
        p_WH: (n, 3), of the centre of its mouth, m.
        force: (n, 3), on the peg, in P, N.
        moment: (n, 3), on the peg about its tip, in P, N m.
        depth: (n,), of the tip below the mouth, m.
        phase: (n,), index into ``phases``: the contact state, or the level of force where no states are known.
        phases: their names.
        colours: theirs, hexadecimal.
        colouring: what the colours mean: "contact state" or "contact force".
        guard: (n,), whether the rig's force guard was backing off; None for a demonstration.
        force_limit: of the load, N, above which that guard acts; None for a demonstration.
        steps: (n, 2), corrective steps that the motors for pitch and yaw had taken; None for a demonstration.
        geometry: the `SIZES`.
    """

    kind: str
    outcome: str
    time: Array
    R_WP: Rotation
    p_WP: Array
    R_WH: Rotation
    p_WH: Array
    force: Array
    moment: Array
    depth: Array
    phase: NDArray[np.int64]
    phases: list[str]
    colours: list[str]
    colouring: str
    guard: NDArray[np.bool_] | None
    force_limit: float | None
    steps: NDArray[np.int64] | None
    geometry: dict[str, float]

    @property
    def lean(self) -> Array:
        """(n, 2), where the peg's axis leans in the hole, about which its tilt is |lean|: x and y of H, rad."""
        axis = (self.R_WH.inv() * self.R_WP).apply([0.0, 0.0, 1.0])
        across = np.hypot(axis[:, 0], axis[:, 1])
        scale = np.divide(np.arctan2(across, axis[:, 2]), across, out=np.ones_like(across), where=across > 1e-12)
        return axis[:, :2] * scale[:, None]

    @property
    def load(self) -> Array:
        """(n,), the norm of force and moment over the peg's radius, N, which the rig's force guard watches."""
        moment = np.linalg.norm(self.moment, axis=1) / self.geometry["peg_radius"]
        return np.hypot(np.linalg.norm(self.force, axis=1), moment)

    @property
    def lateral_force(self) -> Array:
        """(n, 2), the force across the hole's axis, along x and y of H, N."""
        return (self.R_WH.inv() * self.R_WP).apply(self.force)[:, :2]


def read_motion(path: Path, skill: Path | None = None) -> Motion:
    """Reads a stored demonstration or rig run.

    Args:
        path: of the Parquet file; its metadata say which of both it is.
        skill: of the trained skill that tells a demonstration's contact states; a rig run holds its own.

    Raises:
        ValueError: naming the file and its fault.
    """
    if _stored_kind(path) == "rig_run":
        return motion_of_run(read_rig_run(path), where=str(path))
    demonstration = read_demonstration(path)
    if skill is None:
        return motion_of_demonstration(demonstration, where=str(path))
    from skill.manipulation_skill import ManipulationSkill  # slow to import, and seldom needed

    return motion_of_demonstration(demonstration, ManipulationSkill.load(skill), where=str(path))


def motion_of_demonstration(
    demonstration: Demonstration, skill: ManipulationSkill | None = None, *, where: str = "demonstration"
) -> Motion:
    """The peg moves in a hole that stands still.

    Args:
        demonstration: with a geometry among its metadata.
        skill: that tells the contact states; without one the colours are those of the force.
        where: names the source in errors.
    """
    samples = demonstration.samples
    geometry = _geometry(demonstration.metadata, where)
    n = len(samples)
    force = _columns(samples, "fx", "fy", "fz")
    axis, angle = _columns(samples, "ax", "ay", "az"), samples["angle"].to_numpy()
    if skill is not None:
        probabilities = skill.state_probabilities(_columns(samples, "fx", "fy", "fz", "mx", "my", "mz", "z"))
        phase, number = probabilities.argmax(axis=1), probabilities.shape[1]
        phases, colours, colouring = skill.state_names(), state_colours(number), "contact state"
    else:
        phase = np.digitize(np.linalg.norm(force, axis=1), FORCE_LEVELS)
        edges = [f"{level:g}" for level in FORCE_LEVELS]
        middle = [f"{a} to {b} N" for a, b in pairwise(edges)]
        phases = [f"below {edges[0]} N", *middle, f"above {edges[-1]} N"]
        colours, colouring = list(LEVEL_COLOURS), "contact force"
    return Motion(
        kind="demonstration",
        outcome=f"{demonstration.reason}, {'good' if demonstration.good else 'bad'}",
        time=samples["time"].to_numpy() - samples["time"].iloc[0],
        R_WP=Rotation.from_rotvec(axis * angle[:, None]),
        p_WP=_columns(samples, "x", "y", "z"),
        R_WH=Rotation.identity(n),
        p_WH=np.zeros((n, 3)),
        force=force,
        moment=_columns(samples, "mx", "my", "mz"),
        depth=-samples["z"].to_numpy(),
        phase=phase.astype(np.int64),
        phases=phases,
        colours=colours,
        colouring=colouring,
        guard=None,
        force_limit=None,
        steps=None,
        geometry=geometry,
    )


def motion_of_run(run: RigRun, *, where: str = "rig run") -> Motion:
    """The peg slides along a fixed axis, and the hole turns: by pitch about x, then by yaw about its own y."""
    samples = run.samples
    geometry = _geometry(run.metadata, where)
    n = len(samples)
    height = run.metadata.get("rig", {}).get("pivot_height", 0.0)
    R_WH = Rotation.from_euler("XY", _columns(samples, "pitch", "yaw"))
    pivot = np.array([0.0, 0.0, float(height)])
    state = samples["state"].to_numpy()
    phase = np.rint(state).astype(np.int64)
    if phase.min() < 0 or np.any(phase != state):
        raise ValueError(f"{where}: column 'state' holds {state.min():g}; expected whole numbers from 0")
    names = run.metadata.get("state_names")
    number = max(int(phase.max()) + 1, len(names) if names is not None else 0)
    try:
        phases, colours = state_labels(number, names), state_colours(number)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from error
    return Motion(
        kind="rig run",
        outcome=str(run.result.get("reason", "")),
        time=samples["time"].to_numpy() - samples["time"].iloc[0],
        R_WP=Rotation.identity(n),
        p_WP=np.column_stack([np.zeros((n, 2)), samples["tip_z"].to_numpy()]),
        R_WH=R_WH,
        p_WH=pivot - R_WH.apply(pivot),
        force=_columns(samples, "fx", "fy", "fz"),
        moment=_columns(samples, "mx", "my", "mz"),
        depth=-samples["tip_z"].to_numpy(),
        phase=phase,
        phases=phases,
        colours=colours,
        colouring="contact state",
        guard=samples["guard"].to_numpy() > 0.5,
        force_limit=run.metadata.get("force_limit"),
        steps=np.rint(_columns(samples, "pitch_taken", "yaw_taken")).astype(np.int64),
        geometry=geometry,
    )


def make_block(size: Mapping[str, float]) -> TriangleMesh:
    """The hole block of the `SIZES`, cut open towards the camera."""
    facets = round(size["facets"])
    return make_bore(
        radius=size["hole_radius"],
        depth=size["hole_depth"],
        chamfer=size["chamfer"],
        facets=facets,
        block_radius=size["block_radius"],
        floor=size["floor"],
        sector=(round(KEPT[0] * facets), round(KEPT[1] * facets)),
    )


def _columns(samples: pd.DataFrame, *names: str) -> Array:
    # A copy: pandas hands out read-only views, which some of scipy refuses.
    return samples[list(names)].to_numpy(dtype=float, copy=True)


def _stored_kind(path: Path) -> str:
    try:
        metadata = pq.read_schema(path).metadata or {}
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file; expected a stored demonstration or rig run (.parquet)") from None
    except (pa.ArrowInvalid, OSError) as error:
        raise ValueError(f"{path}: not a complete Parquet file ({error})") from error
    for kind in ("demonstration", "rig_run"):
        if kind.encode() in metadata:
            return kind
    raise ValueError(f"{path}: neither a demonstration nor a rig run of this program (a Parquet file of another kind)")


def _geometry(metadata: Mapping[str, Any], where: str) -> dict[str, float]:
    found = metadata.get("geometry")
    if not isinstance(found, Mapping):
        raise ValueError(f"{where}: no geometry among the metadata; expected the sizes {list(SIZES)}")
    missing = [name for name in SIZES if not isinstance(found.get(name), int | float)]
    if missing:
        raise ValueError(f"{where}: geometry lacks {missing}; expected numbers for {list(SIZES)}")
    size = {name: float(found[name]) for name in SIZES}
    try:
        make_block(size)
    except (ValueError, OverflowError) as error:
        raise ValueError(f"{where}: geometry: {error}") from error
    if not (0 < size["peg_radius"] < math.inf and 0 < size["peg_length"] < math.inf):
        raise ValueError(
            f"{where}: geometry: peg radius {size['peg_radius']}, length {size['peg_length']} (m);"
            " expected both above 0"
        )
    return size
