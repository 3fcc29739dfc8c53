"""Demonstrations and rig runs as episodes, and their rates and times."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from interfaces.exports.episodes import (
    check_times,
    demonstration_episode,
    demonstration_features,
    demonstration_labels,
    frame_rate,
    run_episode,
    run_features,
    run_labels,
)
from models.contact_bodies import ContactLabel
from skill.data.geometry import PegHoleGeometry
from skill.data.outcome import Outcome
from skill.data.rig_run import CONTACT_COLUMNS
from skill.features.measurement import MEASURED, observed_series
from skill.states.estimate import estimates
from tests.trajectories import GEOMETRY, make_demonstration, make_rig_run

SIZES = PegHoleGeometry(**GEOMETRY)


def test_the_rate_is_a_whole_number():
    assert frame_rate(0.02 * np.arange(9), "a") == 50
    assert frame_rate(7.0 + np.arange(9) / 30.0, "a") == 30
    with pytest.raises(ValueError, match=r"^a: sampled at 33\.333 Hz, expected a whole number"):
        frame_rate(0.03 * np.arange(9), "a")
    with pytest.raises(ValueError, match=r"^a: sampled at 0\.33333 Hz"):
        frame_rate(3.0 * np.arange(9), "a")


def test_times_may_differ_by_half_a_frame():
    times = 3.0 + 0.02 * np.arange(50)
    times[7] += 0.009
    check_times(times, 50, "a")
    times[9:] += 0.012
    with pytest.raises(ValueError, match=r"^a: sample 9 at 3\.192 s, expected 3\.18 s at 50 samples"):
        check_times(times, 50, "a")


@pytest.mark.parametrize("kind", ["demonstration", "run"])
def test_every_feature_has_its_numbers_and_only_the_last_frame_ends_an_episode(kind):
    if kind == "demonstration":
        recording = make_demonstration()
        episode, features = demonstration_episode(recording, "a.parquet"), demonstration_features(None)
    else:
        recording = make_rig_run()
        episode, features = run_episode(recording, "a.parquet"), run_features(recording)
        assert features["contact_state"].labels == tuple(recording.metadata["state_names"])
    assert set(episode.columns) == set(features)
    assert len(episode) == len(recording.samples)
    for key, feature in features.items():
        values = episode.columns[key]
        assert values.dtype == np.dtype(feature.dtype)
        assert values.shape == ((len(episode), feature.width) if feature.names else (len(episode),))
    for key in ("next.done", "next.success"):
        assert np.flatnonzero(episode.columns[key]).tolist() == [len(episode) - 1]
    samples = recording.samples
    np.testing.assert_array_equal(episode.columns["recording"], samples[list(features["recording"].names)])
    np.testing.assert_array_equal(episode.columns["observation.wrench"], samples[list(MEASURED[:6])].astype("f4"))


# ---------------------------------------------------------------- demonstrations


def test_a_demonstration_holds_the_pose_and_an_action_the_motion_that_follows():
    samples = make_demonstration().samples
    columns = demonstration_episode(make_demonstration(), "a.parquet").columns
    np.testing.assert_array_equal(columns["observation.state"][:, :3], samples[["x", "y", "z"]].astype("f4"))
    turn = samples[["ax", "ay", "az"]].to_numpy() * samples[["angle"]].to_numpy()
    np.testing.assert_allclose(columns["observation.state"][:, 3:], turn, rtol=1e-6)
    moved = samples[["ux", "uy", "uz", "rx", "ry", "rz"]].to_numpy(dtype="f4")
    np.testing.assert_array_equal(columns["action"][:-1], moved[1:])
    assert not columns["action"][-1].any()


@pytest.mark.parametrize(
    ("outcome", "success"), [(Outcome.INSERTED, True), (Outcome.INSERTED_ROUGHLY, True), (Outcome.JAMMED, False)]
)
def test_outcome_and_success(outcome, success):
    episode = demonstration_episode(replace(make_demonstration(), outcome=outcome, good=False), "a.parquet")
    assert set(episode.columns["outcome"].tolist()) == {list(Outcome).index(outcome)}
    assert bool(episode.columns["next.success"].any()) is success
    assert episode.outcome == outcome
    assert episode.header["good"] is False


def test_labels_are_unknown_without_geometry_and_beyond_45_degrees():
    demonstration = make_demonstration()
    assert set(demonstration_labels(replace(demonstration, metadata={})).tolist()) == {-1}
    samples = demonstration.samples.copy()
    samples.loc[3, "angle"] = 1.2
    found = demonstration_labels(replace(demonstration, samples=samples, outcome=Outcome.DIVERGED))
    assert found.tolist().count(-1) == 1
    assert found[3] == -1
    assert found[0] == ContactLabel.FREE


@pytest.mark.slow
def test_states_are_those_of_the_estimator_of_the_skill(skill, demonstrations):
    episode, features = demonstration_episode(demonstrations[0], "a.parquet", skill), demonstration_features(skill)
    found = list(estimates(skill.estimator(), observed_series(demonstrations[0].samples)))
    assert episode.columns["contact_state"].tolist() == [estimate.state for estimate in found]
    assert set(episode.columns) == set(features)
    assert features["contact_state"].labels == tuple(skill.state_names())


@pytest.mark.slow
def test_a_skill_for_another_peg_is_refused(skill):
    demonstration = make_demonstration()
    wider = {**demonstration.metadata["geometry"], "hole_radius": 0.0102}
    with pytest.raises(ValueError, match=r"^a\.parquet: another peg or hole than that of the skill"):
        demonstration_episode(replace(demonstration, metadata={"geometry": wider}), "a.parquet", skill)


# ---------------------------------------------------------------------- rig runs


def test_a_run_holds_what_the_rig_measures_and_commands_and_an_action_the_next_command():
    run = make_rig_run()
    columns = run_episode(run, "a.parquet").columns
    names = ["target_pitch", "target_yaw", "target_clocking", "feed_speed"]
    np.testing.assert_array_equal(columns["observation.state"], run.samples[["depth", *names]].astype("f4"))
    commands = run.samples[names].to_numpy(dtype="f4")
    np.testing.assert_array_equal(columns["action"], [*commands[1:], commands[-1]])


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
    assert run_labels(pd.DataFrame([row]), SIZES).tolist() == [label]
    assert run_labels(pd.DataFrame([row]), None).tolist() == [-1]
