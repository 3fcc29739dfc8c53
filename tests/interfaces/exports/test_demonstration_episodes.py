"""Demonstrations as episodes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from experiments.exact_states import exact_bodies
from interfaces.exports.demonstration_episodes import (
    FEATURES,
    contact_labels,
    demonstration_episode,
    demonstration_features,
    most_probable,
)
from models.contact_geometry import ContactLabel
from skill.data.demonstration import COLUMNS
from skill.data.outcome import Outcome
from skill.features.wrench_features import MEASURED
from skill.states.estimate import estimates
from skill.training_samples import observed_series
from tests.trajectories import make_demonstration


def test_every_feature_has_its_numbers():
    demonstration = make_demonstration()
    episode = demonstration_episode(demonstration, "a.parquet")
    assert set(episode.columns) == set(FEATURES)
    for key, feature in FEATURES.items():
        values = episode.columns[key]
        assert values.dtype == np.dtype(feature.dtype)
        assert values.shape == ((len(episode), feature.width) if feature.names else (len(episode),))
    assert len(episode) == len(demonstration.samples)


def test_pose_wrench_and_recording():
    demonstration = make_demonstration()
    columns, samples = demonstration_episode(demonstration, "a.parquet").columns, demonstration.samples
    np.testing.assert_array_equal(columns["recording"], samples[list(COLUMNS)])
    np.testing.assert_array_equal(columns["observation.wrench"], samples[list(MEASURED[:6])].astype("f4"))
    np.testing.assert_array_equal(columns["observation.state"][:, :3], samples[["x", "y", "z"]].astype("f4"))
    turn = samples[["ax", "ay", "az"]].to_numpy() * samples[["angle"]].to_numpy()
    np.testing.assert_allclose(columns["observation.state"][:, 3:], turn, rtol=1e-6)


def test_an_action_is_the_motion_that_follows():
    demonstration = make_demonstration()
    action = demonstration_episode(demonstration, "a.parquet").columns["action"]
    moved = demonstration.samples[["ux", "uy", "uz", "rx", "ry", "rz"]].to_numpy(dtype="f4")
    np.testing.assert_array_equal(action[:-1], moved[1:])
    assert not action[-1].any()


@pytest.mark.parametrize(
    ("outcome", "success"), [(Outcome.INSERTED, True), (Outcome.INSERTED_ROUGHLY, True), (Outcome.JAMMED, False)]
)
def test_outcome_and_success(outcome, success):
    episode = demonstration_episode(replace(make_demonstration(), outcome=outcome, good=False), "a.parquet")
    assert set(episode.columns["outcome"].tolist()) == {list(Outcome).index(outcome)}
    assert bool(episode.columns["next.success"].any()) is success
    assert episode.outcome == outcome
    assert episode.header["good"] is False


def test_labels_are_exact():
    demonstration = make_demonstration()
    samples = demonstration.samples
    axes = Rotation.from_rotvec(samples[["ax", "ay", "az"]].to_numpy() * samples[["angle"]].to_numpy()).as_matrix()
    bodies = exact_bodies(demonstration)
    positions = samples[["x", "y", "z"]].to_numpy()
    one_by_one = [bodies.label(p[None], R[None, :, 2])[0] for p, R in zip(positions, axes, strict=True)]
    found = contact_labels(demonstration)
    assert found.tolist() == one_by_one
    assert ContactLabel.FREE in found


def test_labels_are_unknown_without_geometry_and_beyond_45_degrees():
    demonstration = make_demonstration()
    assert set(contact_labels(replace(demonstration, metadata={})).tolist()) == {-1}
    samples = demonstration.samples.copy()
    samples.loc[3, "angle"] = 1.2
    broken = replace(demonstration, samples=samples, outcome=Outcome.DIVERGED)
    found = contact_labels(broken)
    assert found[3] == -1
    assert (np.delete(found, 3) >= 0).all()


@pytest.mark.slow
def test_states_and_contexts_are_those_of_the_estimator_of_the_skill(skill, demonstrations):
    states, contexts = most_probable(demonstrations[0], skill)
    found = list(estimates(skill.estimator(), observed_series(demonstrations[0].samples)))
    assert states.tolist() == [estimate.state for estimate in found]
    assert contexts.tolist() == [estimate.context for estimate in found]
    episode = demonstration_episode(demonstrations[0], "a.parquet", skill)
    assert set(episode.columns) == set(demonstration_features(skill))
    assert demonstration_features(skill)["contact_state"].labels == tuple(skill.state_names())


@pytest.mark.slow
def test_a_skill_for_another_peg_is_refused(skill):
    demonstration = make_demonstration()
    wider = {**demonstration.metadata["geometry"], "hole_radius": 0.0102}
    with pytest.raises(ValueError, match=r"^a\.parquet: another peg or hole than that of the skill"):
        demonstration_episode(replace(demonstration, metadata={"geometry": wider}), "a.parquet", skill)
