import numpy as np
import pytest

from experiments.exact_states import exact_labels, give_names
from models.contact_bodies import ContactLabel
from skill.data.demonstration import Demonstration


def test_a_demonstration_starts_free_and_is_in_contact_where_forces_act(demonstrations):
    for demonstration in demonstrations[:3]:
        labels = exact_labels(demonstration)
        assert labels.shape == (len(demonstration.samples),)
        assert labels[0] == ContactLabel.FREE
        force = np.linalg.norm(demonstration.samples[["fx", "fy", "fz"]], axis=1)
        assert np.mean((force > 0.01) == (labels != ContactLabel.FREE)) > 0.9


def test_states_are_named_after_their_exact_contact_states(skill, demonstrations, skill_file, tmp_path):
    named = type(skill).load(skill_file)
    give_names(named, demonstrations)
    assert len(set(named.state_names())) == named.n_states
    assert any("free" in name for name in named.state_names())
    assert any("point" in name or "line" in name for name in named.state_names())
    named.save(tmp_path / "named.npz")
    assert type(skill).load(tmp_path / "named.npz").state_names() == named.state_names()


def test_a_demonstration_without_a_geometry_is_not_labelled(demonstrations, skill, skill_file):
    foreign = Demonstration(demonstrations[0].samples, good=True, outcome="inserted")
    with pytest.raises(ValueError, match="geometry"):
        exact_labels(foreign)
    numbered = type(skill).load(skill_file)
    give_names(numbered, [foreign])
    assert numbered.state_names() == [f"state {k}" for k in range(numbered.n_states)]
