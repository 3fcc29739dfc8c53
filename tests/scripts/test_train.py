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


@pytest.mark.parametrize(
    ("options", "policy", "contexts"),
    [
        (("--contexts", 3), "imitate", "2 contexts"),
        pytest.param(("--policy", "plan"), "plan", "contact states", marks=pytest.mark.nightly),
    ],
)
def test_train_imitates_or_plans_and_discovers_contexts_unless_it_may_not(folder, tmp_path, options, policy, contexts):
    done = invoke("train", "--demonstrations", folder, "--out", tmp_path / "skill.npz", *options)
    assert done.exit_code == 0, done.output
    assert contexts in done.output
    assert ManipulationSkill.load(tmp_path / "skill.npz").policy == policy
