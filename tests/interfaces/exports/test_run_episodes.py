"""Rig runs as episodes."""

import numpy as np
import pandas as pd
import pytest

from interfaces.exports.run_episodes import contact_labels, run_episode, run_features
from models.contact_geometry import ContactLabel
from skill.data.geometry import PegHoleGeometry
from skill.data.rig_run import CONTACT_COLUMNS
from tests.trajectories import GEOMETRY, make_rig_run

SIZES = PegHoleGeometry(**GEOMETRY)


@pytest.mark.parametrize("contacts", [True, False])
def test_every_feature_has_its_numbers(contacts):
    run = make_rig_run(contacts=contacts)
    episode, features = run_episode(run, "a.parquet"), run_features(run)
    assert set(episode.columns) == set(features)
    assert ("context" in features) is contacts
    for key, feature in features.items():
        values = episode.columns[key]
        assert values.dtype == np.dtype(feature.dtype)
        assert values.shape == ((len(episode), feature.width) if feature.names else (len(episode),))
    np.testing.assert_array_equal(episode.columns["recording"], run.samples[list(run.columns)])
    assert features["contact_state"].labels == tuple(run.metadata["state_names"])


def test_an_observation_holds_what_the_rig_measures_and_commands_and_an_action_the_next_command():
    run = make_rig_run()
    columns = run_episode(run, "a.parquet").columns
    names = ["target_pitch", "target_yaw", "feed_speed"]
    np.testing.assert_array_equal(columns["observation.state"], run.samples[["depth", *names]].astype("f4"))
    commands = run.samples[names].to_numpy(dtype="f4")
    np.testing.assert_array_equal(columns["action"], [*commands[1:], commands[-1]])


def test_labels_are_unknown_without_contacts_or_geometry():
    assert set(contact_labels(make_rig_run(contacts=False).samples, SIZES).tolist()) == {-1}
    assert set(contact_labels(make_rig_run().samples, None).tolist()) == {-1}


LABELS = {
    ContactLabel.FREE: (-0.010, {}),
    ContactLabel.FACE: (0.0, {"face": (0.0, 0.0, 0.0, 3.0)}),
    ContactLabel.SEATED: (-0.025, {"face": (-0.025, 0.0, 0.0, 3.0), "mouth": (0.0, 1.0, 0.0, 0.0)}),
    ContactLabel.CHAMFER: (-0.0002, {"mouth": (-0.0001, 1.0, 0.0, 1.0)}),
    ContactLabel.MOUTH: (-0.010, {"mouth": (-0.0005, 1.0, 0.0, 0.0)}),
    ContactLabel.TIP: (-0.010, {"tip": (-0.010, 1.0, 0.0, 0.0)}),
    ContactLabel.TWO_POINT: (-0.010, {"mouth": (-0.0005, 1.0, 0.5, 0.0), "tip": (-0.010, -1.0, 0.0, 0.0)}),
    ContactLabel.LINE: (-0.010, {"mouth": (-0.0005, 1.0, 0.5, 0.0), "tip": (-0.010, 1.0, 0.0, 0.0)}),
}


@pytest.mark.parametrize("label", LABELS, ids=lambda label: label.label)
def test_a_label_follows_from_the_contacts(label):
    tip, contacts = LABELS[label]
    row = dict.fromkeys(("tip_z", *CONTACT_COLUMNS), 0.0) | {"tip_z": tip}
    for place, numbers in contacts.items():
        row |= dict(zip((f"contact_{place}_{name}" for name in ("z", "fx", "fy", "fz")), numbers, strict=True))
    assert contact_labels(pd.DataFrame([row]), SIZES).tolist() == [label]
