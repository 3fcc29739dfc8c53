"""`haptic-skill train`: the contexts that it discovers and prints."""

import pytest

from skill.data.demonstration import write_demonstration
from skill.manipulation_skill import ManipulationSkill
from tests.scripts.commands import invoke
from tests.skill.test_skill_contexts import hinged_demonstrations


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Recordings with two contexts."""
    path = tmp_path_factory.mktemp("hinged")
    for k, demonstration in enumerate(hinged_demonstrations()):
        write_demonstration(demonstration, path / f"{k:03d}_good_expert.parquet")
    return path


def test_train_learns_to_imitate_or_to_plan(folder, tmp_path):
    policies = []
    for k, options in enumerate(((), ("--policy", "plan"))):
        done = invoke("train", "--demonstrations", folder, "--out", tmp_path / f"{k}.npz", *options)
        assert done.exit_code == 0, done.output
        policies.append(ManipulationSkill.load(tmp_path / f"{k}.npz").policy)
    assert policies == ["imitate", "plan"]


@pytest.mark.parametrize(
    ("options", "expected"),
    [((), "2 contexts"), (("--contexts", 1), "a single context")],
)
def test_train_discovers_contexts_unless_it_may_not(folder, tmp_path, options, expected):
    done = invoke("train", "--demonstrations", folder, "--out", tmp_path / "skill.npz", *options)
    assert done.exit_code == 0, done.output
    assert expected in done.output
