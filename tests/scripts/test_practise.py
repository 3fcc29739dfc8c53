import json
import math

import pytest
from PIL import Image
from typer.testing import CliRunner

from models.scenario import dump_scenario
from scripts.practise import app
from skill.manipulation_skill import ManipulationSkill
from tests.quick_scenario import make_quick_scenario


def called(*arguments):
    return CliRunner(env={"NO_COLOR": "1", "TERM": "dumb", "COLUMNS": "160"}).invoke(app, [str(a) for a in arguments])


@pytest.fixture(scope="module")
def practised(tmp_path_factory, skill_file):
    """The smallest practice that there is, from the mouth on and almost upright."""
    folder = tmp_path_factory.mktemp("practice")
    scenario = make_quick_scenario()
    scenario.start.height, scenario.start.tilt_range = 1e-4, math.radians(0.7)
    scenario.trial.time_limit = 0.5
    (folder / "quick.yaml").write_text(dump_scenario(scenario))
    done = called(
        *("--skill", skill_file, "--out", folder / "practised.npz", "--scenario", folder / "quick.yaml"),
        *("--rounds", 1, "--starts", 1, "--checks", 1, "--held-out", 2, "--held-out-seed", 30, "--jobs", 1),
    )
    assert done.exit_code == 0, done.output
    return folder, done.output


def test_practice_leaves_a_skill_its_trials_and_a_picture(practised):
    folder, _ = practised
    ManipulationSkill.load(folder / "practised.npz")
    assert min(Image.open(folder / "practised.png").size) > 300
    assert {p.name for p in folder.iterdir()} == {"quick.yaml", "practised.npz", "practised.json", "practised.png"}


def test_the_json_pairs_the_held_out_trials(practised):
    folder, said = practised
    record = json.loads((folder / "practised.json").read_text())
    trials = record["held_out"]["trials"]
    assert [t["seed"] for t in trials] == [30, 31]
    for t in trials:
        assert t["before"]["tilt_deg"] == t["after"]["tilt_deg"]
    change = record["held_out"]["changes"]["time_s"]
    times = {when: sorted(t[when]["time_s"] for t in trials) for when in ("before", "after")}
    assert change["before"] == pytest.approx(sum(times["before"]) / 2)
    assert change["after"] == pytest.approx(sum(times["after"]) / 2)
    assert change["lower"] <= change["change"] <= change["upper"]
    assert f"{100 * change['change']:+.0f} %" in said
    assert [len(r["practised"]) for r in record["rounds"]] == [0, 2]


def test_a_discarded_round_leaves_the_skill_as_it_was(practised):
    folder, said = practised
    kept = json.loads((folder / "practised.json").read_text())["rounds"][1]["kept"]
    assert ("kept" if kept else "discarded") in said
    learnt = ManipulationSkill.load(folder / "practised.npz")
    assert ("practice_trials" in learnt.metadata_) == kept


def test_a_skill_that_is_not_there_is_one_error(tmp_path):
    done = called("--skill", tmp_path / "none.npz", "--out", tmp_path / "p.npz")
    assert done.exit_code == 1
    assert "no such skill file" in done.output
    assert list(tmp_path.iterdir()) == []
