"""Rig runs as episodes of a data set."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.exact_states import UNKNOWN
from interfaces.exports.episodes import ENDINGS, WRENCH, Episode, Feature, endings, wrench_features
from models.contact_geometry import ContactLabel
from skill.data.geometry import PegHoleGeometry
from skill.data.outcome import Outcome
from skill.data.rig_run import CONTACT_COLUMNS, CONTEXT_COLUMNS, ContactPlace, RigRun
from skill.data.run_result import outcome_of

KIND = "rig runs"
ROBOT = "3-DOF rig"

STATE = ("depth", "target_pitch", "target_yaw", "feed_speed")
COMMANDS = ("target_pitch", "target_yaw", "feed_speed")


def run_features(run: RigRun) -> dict[str, Feature]:
    """Returns the features of runs with the columns and the state names of this one."""
    names = tuple(str(name) for name in run.metadata.get("state_names") or ())
    features = {
        "observation.state": Feature("float32", STATE, ("m", "rad", "rad", "m/s"), "measured depth and own commands"),
        **wrench_features("measured, on the peg about its tip, in P"),
        "action": Feature("float32", COMMANDS, ("rad", "rad", "m/s"), "command until the next frame"),
        "contact_label": Feature(
            "int64", frame="of the simulated contacts; -1: not known", labels=tuple(c.label for c in ContactLabel)
        ),
        "contact_state": Feature("int64", frame="estimated on the rig", labels=names),
        "outcome": Feature("int64", frame="of the whole episode", labels=tuple(Outcome)),
        **ENDINGS,
        "recording": Feature("float64", run.columns, frame="the columns of the run, unchanged"),
    }
    if set(CONTEXT_COLUMNS) <= set(run.columns):
        features["context"] = Feature("int64", frame="estimated on the rig")
    return features


def run_episode(run: RigRun, name: str) -> Episode:
    """Returns a run as an episode; ``name`` is that of its file."""
    samples = run.samples
    outcome = outcome_of(run.result, name)
    wrench = samples[list(WRENCH)].to_numpy(dtype=np.float32)
    commands = samples[list(COMMANDS)].to_numpy(dtype=np.float32)
    columns = {
        "observation.state": samples[list(STATE)].to_numpy(dtype=np.float32),
        "observation.environment_state": wrench,
        "observation.wrench": wrench,
        # A row holds the command of the period before it; nothing follows the last one, whose command stays.
        "action": np.vstack([commands[1:], commands[-1:]]),
        "contact_label": contact_labels(samples, PegHoleGeometry.find(run.metadata, name)),
        "contact_state": samples["state"].to_numpy(dtype=np.int64),
        "outcome": np.full(len(samples), list(Outcome).index(outcome)),
        **endings(len(samples), success=outcome is Outcome.INSERTED),
        "recording": samples[list(run.columns)].to_numpy(dtype=np.float64),
    }
    if CONTEXT_COLUMNS[0] in samples:
        columns["context"] = samples[CONTEXT_COLUMNS[0]].to_numpy(dtype=np.int64)
    return Episode(name, str(outcome), columns, {"result": run.result, "metadata": run.metadata})


def contact_labels(samples: pd.DataFrame, geometry: PegHoleGeometry | None) -> NDArray[np.int64]:
    """Returns the contact labels (n,) of the simulated contacts; `UNKNOWN` without contacts or a geometry.

    The labels are those of `models.contact_geometry.label_contacts`, but they follow from the forces at mouth, tip and
    face, because the deflection of the mount is not recorded. A face in the lower half of the hole is the floor, and a
    contact at the mouth is on the chamfer until the tip has passed it. Contacts at mouth and tip are a two-point
    contact if their lateral forces oppose each other, and a line contact otherwise.
    """
    if geometry is None or not set(CONTACT_COLUMNS) <= set(samples.columns):
        return np.full(len(samples), UNKNOWN, dtype=np.int64)
    force = {place: samples[_names(place, ("fx", "fy", "fz"))].to_numpy() for place in ContactPlace}
    mouth, tip, face = (force[place].any(axis=1) for place in ContactPlace)
    lateral = (force[ContactPlace.MOUTH][:, :2] * force[ContactPlace.TIP][:, :2]).sum(axis=1)
    deep = samples["contact_face_z"].to_numpy() < -0.5 * geometry.hole_depth
    rules = {
        ContactLabel.SEATED: face & deep,
        ContactLabel.FACE: face,
        ContactLabel.CHAMFER: (mouth | tip) & (samples["tip_z"].to_numpy() > -geometry.chamfer),
        ContactLabel.TWO_POINT: mouth & tip & (lateral < 0.0),
        ContactLabel.LINE: mouth & tip,
        ContactLabel.MOUTH: mouth,
        ContactLabel.TIP: tip,
    }
    chosen = np.select(list(rules.values()), [int(label) for label in rules], default=int(ContactLabel.FREE))
    return np.asarray(chosen, dtype=np.int64)


def _names(place: ContactPlace, parts: Sequence[str]) -> list[str]:
    return [f"contact_{place}_{part}" for part in parts]
