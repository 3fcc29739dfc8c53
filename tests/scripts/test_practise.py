"""The command practise: its files, its tables and its errors."""

import json
import math

import pytest
from PIL import Image

from experiments.outputs.output_checks import check_file
from experiments.outputs.output_set import OutputSet
from models.scenario import dump_scenario
from skill.manipulation_skill import ManipulationSkill
from tests.quick_scenario import make_quick_scenario
from tests.scripts.commands import error_line, invoke


@pytest.fixture(scope="module")
def practised(tmp_path_factory, skill_file):
    """Folder and output of the shortest possible practice, which starts at the mouth and almost upright."""
    folder = tmp_path_factory.mktemp("practice")
    done = practise(folder, skill_file)
    assert done.exit_code == 0, done.output
    return folder, done.output


def practise(folder, skill_file, *more):
    scenario = make_quick_scenario()
    scenario.start.height, scenario.start.tilt_range = 1e-4, math.radians(0.7)
    scenario.trial.time_limit = 0.5
    (folder / "quick.yaml").write_text(dump_scenario(scenario))
    return invoke(
        "practise",
        *("--skill", skill_file, "--out", folder / "practised.npz", "--scenario", folder / "quick.yaml"),
        *("--rounds", 1, "--starts", 1, "--checks", 1, "--held-out", 2, "--held-out-seed", 30, "--jobs", 1, *more),
    )


def test_the_json_pairs_the_held_out_trials(practised):
    folder, output = practised
    assert {p.name for p in folder.iterdir()} == {"quick.yaml", "practised.npz", "practised.json", "practised.png"}
    assert min(Image.open(folder / "practised.png").size) > 300
    record = json.loads((folder / "practised.json").read_text())
    check_file(folder / "practised.json", "practice.json")  # may be replaced by the same command
    assert list(record) == ["versions", "scenario", "practice", "rounds", "held_out"]
    trials = record["held_out"]["trials"]
    assert [t["seed"] for t in trials] == [30, 31]
    for t in trials:
        assert t["before"]["tilt_deg"] == t["after"]["tilt_deg"]
    change = record["held_out"]["changes"]["time_s"]
    times = {when: sorted(t[when]["time_s"] for t in trials) for when in ("before", "after")}
    assert change["before"] == pytest.approx(sum(times["before"]) / 2)
    assert change["after"] == pytest.approx(sum(times["after"]) / 2)
    assert change["lower"] <= change["change"] <= change["upper"]
    assert f"{100 * change['change']:+.0f} %" in output
    assert [len(r["practised"]) for r in record["rounds"]] == [0, 2]
    kept = record["rounds"][1]["kept"]
    assert ("practice_trials" in ManipulationSkill.load(folder / "practised.npz").metadata_) == kept


class Stop(BaseException):
    """Ends a practice as a kill does: no handler of the program catches it."""


def only_trials(names):
    return [name for name in names if name.endswith(".parquet")]


@pytest.mark.slow
def test_an_interrupted_practice_goes_on_and_ends_with_the_same_files(tmp_path, practised, skill_file):
    after, written, write = 8, [], OutputSet.write

    def stopping(files, name, write_item):
        write(files, name, write_item)
        written.append(name)
        if len(only_trials(written)) == after:
            raise Stop

    before = skill_file.read_bytes()
    (tmp_path / "practised.npz").write_bytes(before)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(OutputSet, "write", stopping)
        with pytest.raises(Stop):
            practise(tmp_path, skill_file)
    assert (tmp_path / "practised.npz").read_bytes() == before
    unfinished = tmp_path / "practised.npz.unfinished"
    assert sorted(path.name for path in unfinished.glob("*.parquet")) == sorted(only_trials(written))
    ManipulationSkill.load(unfinished / "best.npz")
    line = error_line(practise(tmp_path, skill_file, "--seed", 1))
    assert f"practised.npz.unfinished: holds {after} trials of another request (another practice)" in line
    done = practise(tmp_path, skill_file)
    assert f"{after} of 8 trials are there already" in done.output
    assert {p.name for p in tmp_path.iterdir()} == {"quick.yaml", "practised.npz", "practised.json", "practised.png"}
    folder, _ = practised
    for name in ("practised.npz", "practised.json", "practised.png"):
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes(), name


def test_a_skill_is_not_practised_into_its_own_file(tmp_path, skill_file):
    (tmp_path / "skill.npz").write_bytes(skill_file.read_bytes())
    (tmp_path / "link.npz").symlink_to("skill.npz")
    for out in ("skill.npz", "link.npz"):
        line = error_line(practise(tmp_path, tmp_path / "skill.npz", "--out", tmp_path / out))
        assert "--skill and --out are the same file" in line
    assert (tmp_path / "skill.npz").read_bytes() == skill_file.read_bytes()
    assert {p.name for p in tmp_path.iterdir()} == {"quick.yaml", "skill.npz", "link.npz"}


@pytest.mark.parametrize("name", ["x.json", "x.png"])
def test_an_output_that_is_also_the_name_of_a_companion_is_refused(tmp_path, skill_file, name):
    line = error_line(invoke("practise", "--skill", skill_file, "--out", tmp_path / name))
    assert f"are the same file, {tmp_path / name}" in line
    assert list(tmp_path.iterdir()) == []
