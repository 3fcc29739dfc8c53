"""Exact contact states of demonstrations, and the names that they give to the states of a trained skill.

The names are assigned after training: the learner receives no label.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from experiments.trial.penetration import MIN_UPRIGHT
from models.assembly import Assembly
from models.contact_bodies import ContactLabel
from models.exact_geometry import rotations_of_vectors
from skill.data.demonstration import Demonstration
from skill.data.geometry import PegHoleGeometry
from skill.features.measurement import MEASURED
from skill.manipulation_skill import ManipulationSkill
from skill.states.state_naming import name_states

UNKNOWN = -1
"""Number of a contact label that is not known."""


def exact_labels(demonstration: Demonstration) -> NDArray[np.intp]:
    """Returns the exact contact state (`ContactLabel`) of each sample, (n,), from the true pose.

    It is `UNKNOWN` where a diverged simulation tilts the peg by more than 44.9 degrees.

    Raises:
        ValueError: if the metadata of the demonstration hold no complete geometry.
    """
    samples = demonstration.samples
    R_HP = rotations_of_vectors(samples[["ax", "ay", "az"]].to_numpy() * samples[["angle"]].to_numpy())
    upright = R_HP[:, 2, 2] > MIN_UPRIGHT
    labels = np.full(len(samples), UNKNOWN, dtype=np.intp)
    bodies = Assembly.of(PegHoleGeometry.from_metadata(demonstration.metadata, "demonstration"))
    labels[upright] = bodies.label(samples[["x", "y", "z"]].to_numpy()[upright], R_HP[upright])
    return labels


def give_names(skill: ManipulationSkill, demonstrations: Sequence[Demonstration]) -> None:
    """Names the states of a skill in place.

    Ignores demonstrations without a geometry; if there are no others, the states keep their numbers.
    """
    labelled = [d for d in demonstrations if d.metadata.get("geometry") is not None]
    if not labelled:
        return
    labels = np.concatenate([exact_labels(d) for d in labelled])
    measured = np.concatenate([d.samples[list(MEASURED)].to_numpy() for d in labelled])
    states = skill.state_probabilities(measured).argmax(axis=1)
    skill.name_states(
        name_states(states, labels, [label.label for label in ContactLabel], n_states=skill.n_states).names
    )
