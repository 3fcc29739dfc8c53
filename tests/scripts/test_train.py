"""`haptic-skill train`."""

import pytest

from skill.data.demonstration import write_demonstration
from skill.manipulation_skill import ManipulationSkill
from tests.scripts.commands import invoke
from tests.skill.policy.test_skill_plans import hinged_demonstrations


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("hinged")
    for k, demonstration in enumerate(hinged_demonstrations()):
        write_demonstration(demonstration, path / f"{k:03d}_good_expert.parquet")
    return path


@pytest.mark.parametrize("policy", ["imitate", pytest.param("plan", marks=pytest.mark.nightly)])
def test_train_imitates_or_plans(folder, tmp_path, policy):
    done = invoke("train", "--demonstrations", folder, "--out", tmp_path / "skill.npz", "--policy", policy)
    assert done.exit_code == 0, done.output
    assert "contact states" in done.output
    assert ManipulationSkill.load(tmp_path / "skill.npz").policy == policy
