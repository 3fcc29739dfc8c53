"""The motion that a replay shows: poses, wrench and contact state over time, of a demonstration or a rig run."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from models.assembly import Assembly
from skill.arrays import Array
from skill.data.axes import AXES
from skill.data.demonstration import Demonstration, read_demonstration
from skill.data.geometry import PegHoleGeometry
from skill.data.rig_run import CONTACT_COLUMNS, ContactPlace, RigRun, read_rig_run
from skill.data.tables import is_rig_run
from skill.features.measurement import contact_loads
from skill.states.state_style import state_colours, state_labels

if TYPE_CHECKING:
    from skill.manipulation_skill import ManipulationSkill

# The peg is coloured by the contact force if no contact states are known.
FORCE_LEVELS = (0.5, 2.0, 8.0, 30.0)  # in units of N
LEVEL_COLOURS = ("#B0B7BF", "#9ECAE1", "#4292C6", "#08519C", "#081D58")  # one hue, from light to dark

GUARD = ("inactive", "turns reversed", "backing off")
"""What the controller of the rig does against a load."""


@dataclass(frozen=True)
class Motion:
    """Everything that a replay shows, in SI units. Frames: world W, hole block H, peg P.

    Attributes:
        kind: "demonstration" or "rig run".
        outcome: how it ended, in words.
        time: (n,), s, starting at 0.
        R_WP: n orientations of the peg.
        p_WP: (n, 3), positions of its tip, m.
        R_WH: n orientations of the hole block.
        p_WH: (n, 3), positions of the centre of the hole's mouth, m.
        force: (n, 3), contact force on the peg in P, N.
        moment: (n, 3), contact moment on the peg about its tip in P, N m.
        depth: (n,), depth of the tip below the mouth, m.
        phase: (n,), index into ``phases``: the contact state, or the level of the force if no states are known.
        phases: names of the phases.
        colours: colours of the phases, hexadecimal.
        colouring: meaning of the colours, "contact state" or "contact force".
        guard: (n,), index into `GUARD`, what the controller did against a load; None for a demonstration.
        force_limit: load that the force guard is to keep, N; None for a demonstration.
        steps: (n, 2 or 3), microsteps taken so far by the motors for pitch, yaw and clocking; None for a demonstration.
        geometry: sizes of peg and hole.
        contact_points: (n, 3, 3), points of the contacts in W, m, in the order of `ContactPlace`; None if unknown.
        contact_forces: (n, 3, 3), their normal forces on the peg in W, N, zero without contact; None if unknown.
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
    guard: NDArray[np.int64] | None
    force_limit: float | None
    steps: NDArray[np.int64] | None
    geometry: PegHoleGeometry
    contact_points: Array | None = None
    contact_forces: Array | None = None

    @property
    def lean(self) -> Array:
        """(n, 2), direction in which the peg leans, along x and y of H; its norm is the tilt in the hole, rad."""
        axis = (self.R_WH.inv() * self.R_WP).apply([0.0, 0.0, 1.0])
        sine = np.hypot(axis[:, 0], axis[:, 1])  # of the tilt; the third component is its cosine
        scale = np.divide(np.arctan2(sine, axis[:, 2]), sine, out=np.ones_like(sine), where=sine > 1e-12)
        return axis[:, :2] * scale[:, None]

    @property
    def load(self) -> Array:
        """(n,), the load that the rig's force guard monitors, N; see `contact_loads`."""
        return contact_loads(np.hstack([self.force, self.moment]), Assembly.of(self.geometry).reach)

    @property
    def lateral_force(self) -> Array:
        """(n, 2), contact force on the peg along x and y of H, N."""
        force_H: Array = (self.R_WH.inv() * self.R_WP).apply(self.force)
        return force_H[:, :2]


def read_motion(path: Path, skill: Path | None = None) -> Motion:
    """Reads a stored demonstration or rig run.

    Args:
        path: Parquet file; its metadata say which of the two it is.
        skill: file of a trained skill that estimates the contact states of a demonstration. A rig run contains its own.

    Raises:
        ValueError: if a file is missing or invalid, or a rig run is given a skill; the message names it.
    """
    if is_rig_run(path):
        if skill is not None:
            raise ValueError(f"{path}: a rig run, which contains its own contact states; expected no --skill")
        return motion_of_run(read_rig_run(path), where=str(path))
    learnt = None
    if skill is not None:
        from skill.manipulation_skill import ManipulationSkill  # imports scikit-learn, which most replays do not need

        learnt = ManipulationSkill.load(skill)
    return motion_of_demonstration(read_demonstration(path), learnt, where=str(path))


def motion_of_demonstration(
    demonstration: Demonstration, skill: ManipulationSkill | None = None, *, where: str = "demonstration"
) -> Motion:
    """Returns the motion of a demonstration, in which the peg moves and the hole block does not.

    Args:
        demonstration: its metadata must contain the geometry.
        skill: estimates the contact states; if None, the phases are levels of the contact force.
        where: names the source in error messages.

    Raises:
        ValueError: if the geometry is missing or invalid.
    """
    samples = demonstration.samples
    geometry = PegHoleGeometry.from_metadata(demonstration.metadata, where)
    n = len(samples)
    force = _columns(samples, "fx", "fy", "fz")
    axis, angle = _columns(samples, "ax", "ay", "az"), samples["angle"].to_numpy()
    if skill is not None:
        probabilities = skill.state_probabilities(_columns(samples, "fx", "fy", "fz", "mx", "my", "mz", "z"))
        phase, n_states = probabilities.argmax(axis=1), probabilities.shape[1]
        phases, colours, colouring = skill.state_names(), state_colours(n_states), "contact state"
    else:
        phase = np.digitize(np.linalg.norm(force, axis=1), FORCE_LEVELS)
        levels = [f"{level:g}" for level in FORCE_LEVELS]
        between = [f"{a} to {b} N" for a, b in pairwise(levels)]
        phases = [f"below {levels[0]} N", *between, f"above {levels[-1]} N"]
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
    """Returns the motion of a rig run: the peg slides along z, and the hole block turns about the axes of its steppers.

    R_WH = R_x(pitch) R_y(yaw) R_z(clocking), about the pivot at height ``pivot_height`` above the mouth. An arm turns
    the peg instead: the block rests, and the axis of the peg is drawn through the centre of the mouth.

    Args:
        run: its metadata must contain the geometry.
        where: names the source in error messages.

    Raises:
        ValueError: if the geometry is missing or invalid, or there are fewer names than contact states.
    """
    samples = run.samples
    geometry = PegHoleGeometry.from_metadata(run.metadata, where)
    n = len(samples)
    rig = run.metadata.get("rig", {})
    height, axes = rig.get("pivot_height", 0.0), AXES if rig.get("clocking_stage") else AXES[:2]
    R_WH = Rotation.from_euler("XYZ", _columns(samples, *AXES))
    pivot = np.array([0.0, 0.0, float(height)])
    R_WP, p_WP = Rotation.identity(n), np.column_stack([np.zeros((n, 2)), samples["tip_z"].to_numpy()])
    p_WH = pivot - R_WH.apply(pivot)
    if run.metadata.get("carrier", "rig") != "rig":
        R_WP, R_WH, p_WH = R_WH.inv(), R_WP, np.zeros((n, 3))
        axis = R_WP.apply([0.0, 0.0, 1.0])
        p_WP = axis * (p_WP[:, 2:] / axis[:, 2:])
    phase = np.rint(samples["state"].to_numpy()).astype(np.int64)
    names = run.metadata.get("state_names")
    n_states = max(int(phase.max()) + 1, len(names) if names is not None else 0)
    try:
        phases, colours = state_labels(n_states, names), state_colours(n_states)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from error
    return Motion(
        kind="rig run",
        outcome=str(run.result.get("reason", "")),
        time=samples["time"].to_numpy() - samples["time"].iloc[0],
        R_WP=R_WP,
        p_WP=p_WP,
        R_WH=R_WH,
        p_WH=p_WH,
        force=_columns(samples, "fx", "fy", "fz"),
        moment=_columns(samples, "mx", "my", "mz"),
        depth=-samples["tip_z"].to_numpy(),
        phase=phase,
        phases=phases,
        colours=colours,
        colouring="contact state",
        guard=np.where(samples["back_off"] > 0.5, 2, np.where(samples["turning"] < 0.0, 1, 0)),
        force_limit=run.metadata.get("force_limit"),
        steps=np.rint(_columns(samples, *(f"{axis}_taken" for axis in axes))).astype(np.int64),
        geometry=geometry,
        **_contacts(samples),
    )


def _contacts(samples: pd.DataFrame) -> dict[str, Array]:
    """The points and forces of the contacts, by field of `Motion`."""
    values = _columns(samples, *CONTACT_COLUMNS).reshape(len(samples), len(ContactPlace), 2, 3)
    points, forces = values[:, :, 0], values[:, :, 1]
    # Where nothing touches, an arrow waits, without length, where it is needed next: the viewer moves it in between.
    for place in range(len(ContactPlace)):
        touching = np.flatnonzero(forces[:, place].any(axis=1))
        if touching.size:
            following = touching[np.minimum(np.searchsorted(touching, np.arange(len(points))), touching.size - 1)]
            points[:, place] = points[following, place]
    return {"contact_points": points, "contact_forces": forces}


def _columns(samples: pd.DataFrame, *names: str) -> Array:
    # A copy, because some functions of scipy refuse the read-only views of pandas.
    return samples[list(names)].to_numpy(dtype=float, copy=True)
