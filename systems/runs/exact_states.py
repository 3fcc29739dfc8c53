"""Names the states that a skill has discovered, by the exact contact states of the demonstrations it learnt from.

The judge comes after the learning: no label reaches the learner.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from models.contact_geometry import ContactLabel, PegInHole, axes_of_rotation_vectors
from skill.data.demonstration import Demonstration
from skill.features.wrench_features import MEASURED
from skill.manipulation_skill import ManipulationSkill
from skill.states.state_naming import name_states


def exact_bodies(demonstration: Demonstration) -> PegInHole:
    """The round peg and hole of a demonstration.

    Raises:
        ValueError: if the demonstration does not name its geometry.
    """
    geometry = demonstration.metadata.get("geometry")
    if geometry is None:
        raise ValueError("the demonstration has no 'geometry' in its metadata; expected the sizes of peg and hole")
    return PegInHole(geometry["peg_radius"], geometry["hole_radius"], geometry["hole_depth"], geometry["chamfer"])


def exact_labels(demonstration: Demonstration) -> NDArray[np.intp]:
    """The exact contact state (`ContactLabel`) of each sample, (n,), from the true pose."""
    samples = demonstration.samples
    axis = axes_of_rotation_vectors(samples[["ax", "ay", "az"]].to_numpy() * samples[["angle"]].to_numpy())
    return exact_bodies(demonstration).label(samples[["x", "y", "z"]].to_numpy(), axis)


def give_names(skill: ManipulationSkill, demonstrations: Sequence[Demonstration]) -> None:
    """Names the skill's states in place; demonstrations without a geometry leave them numbered."""
    judged = [d for d in demonstrations if d.metadata.get("geometry") is not None]
    if not judged:
        return
    labels = np.concatenate([exact_labels(d) for d in judged])
    measured = np.concatenate([d.samples[list(MEASURED)].to_numpy() for d in judged])
    states = skill.state_probabilities(measured).argmax(axis=1)
    skill.name_states(
        name_states(states, labels, [label.label for label in ContactLabel], n_states=skill.n_states).names
    )
