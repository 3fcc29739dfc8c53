"""Demonstrations as episodes of a data set."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from experiments.exact_states import UNKNOWN, exact_labels
from interfaces.exports.episodes import ENDINGS, WRENCH, Episode, Feature, endings, wrench_features
from models.contact_geometry import ContactLabel
from skill.data.demonstration import ACTIONS, COLUMNS, Demonstration
from skill.data.geometry import PegHoleGeometry
from skill.data.outcome import Outcome
from skill.data.refinement import with_following_actions
from skill.manipulation_skill import ManipulationSkill
from skill.states.estimate import estimates
from skill.training_samples import observed_series

IntArray = NDArray[np.int64]

KIND = "demonstrations"
ROBOT = "haptic device in a virtual environment"
SUCCESSES = (Outcome.INSERTED, Outcome.INSERTED_ROUGHLY)

POSE = ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z")
LENGTH_AND_ANGLE = ("m", "m", "m", "rad", "rad", "rad")

FEATURES = {
    "observation.state": Feature("float32", POSE, LENGTH_AND_ANGLE, "tip and rotation vector of the peg P in H"),
    **wrench_features("on the peg about its tip, in P"),
    "action": Feature("float32", ACTIONS, LENGTH_AND_ANGLE, "motion of the hand until the next frame, in P"),
    "contact_label": Feature(
        "int64", frame="exact, of the true pose; -1: not known", labels=tuple(c.label for c in ContactLabel)
    ),
    "outcome": Feature("int64", frame="of the whole episode", labels=tuple(Outcome)),
    **ENDINGS,
    "recording": Feature("float64", COLUMNS, frame="the columns of the recording, unchanged"),
}


def demonstration_features(skill: ManipulationSkill | None) -> dict[str, Feature]:
    """Returns the features of demonstrations, with those that a skill adds."""
    if skill is None:
        return dict(FEATURES)
    contexts = tuple(f"context {k}" for k in range(len(skill.estimator().initial().contexts)))
    return FEATURES | {
        "contact_state": Feature("int64", frame="most probable state, causal", labels=tuple(skill.state_names())),
        "context": Feature("int64", frame="most probable context, causal", labels=contexts),
    }


def demonstration_episode(demonstration: Demonstration, name: str, skill: ManipulationSkill | None = None) -> Episode:
    """Returns a demonstration as an episode.

    Args:
        demonstration: to convert.
        name: of its file.
        skill: estimates its contact states and contexts; None for none.

    Raises:
        ValueError: if the skill is made for another peg or hole.
    """
    samples = demonstration.samples
    rotation = samples[["ax", "ay", "az"]].to_numpy() * samples[["angle"]].to_numpy()
    wrench = samples[list(WRENCH)].to_numpy(dtype=np.float32)
    columns = {
        "observation.state": np.hstack([samples[["x", "y", "z"]].to_numpy(), rotation]).astype(np.float32),
        "observation.environment_state": wrench,
        "observation.wrench": wrench,
        "action": with_following_actions(samples)[list(ACTIONS)].to_numpy(dtype=np.float32),
        "contact_label": contact_labels(demonstration),
        "outcome": np.full(len(samples), list(Outcome).index(demonstration.outcome)),
        **endings(len(samples), success=demonstration.outcome in SUCCESSES),
        "recording": samples[list(COLUMNS)].to_numpy(dtype=np.float64),
    }
    if skill is not None:
        _check_geometry(demonstration, skill, name)
        columns["contact_state"], columns["context"] = most_probable(demonstration, skill)
    header = {"good": demonstration.good, "outcome": demonstration.reason, "metadata": demonstration.metadata}
    return Episode(name, str(demonstration.outcome), columns, header)


def contact_labels(demonstration: Demonstration) -> NDArray[np.int64]:
    """Returns the labels (n,) of `exact_labels`; without a geometry they are `UNKNOWN`."""
    if demonstration.metadata.get("geometry") is None:
        return np.full(len(demonstration.samples), UNKNOWN, dtype=np.int64)
    return exact_labels(demonstration).astype(np.int64)


def most_probable(
    demonstration: Demonstration, skill: ManipulationSkill
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Returns the most probable contact state and context (n,) of each sample, given the samples so far, as on the rig.

    The wrench is that of the recording, without the noise of a sensor.
    """
    found = estimates(skill.estimator(), observed_series(demonstration.samples))
    states, contexts = np.array([(e.state, e.context) for e in found], dtype=np.int64).T
    return states, contexts


def _check_geometry(demonstration: Demonstration, skill: ManipulationSkill, name: str) -> None:
    """Refuses a skill for another peg or hole."""
    own = PegHoleGeometry.find(demonstration.metadata, name)
    learnt = PegHoleGeometry.find(skill.metadata_, "the skill")
    if own is not None and learnt is not None and own != learnt:
        raise ValueError(f"{name}: another peg or hole than that of the skill; expected a skill for this one")
