"""The command correct: what it asks for, its files, and how it goes on."""

import json

import numpy as np
import pytest

from experiments.outputs.output_checks import check_file
from models.scenario import dump_scenario
from skill.data.demonstration import read_demonstrations, write_demonstration
from skill.manipulation_skill import ManipulationSkill
from skill.policy.query_state import read_query_states
from tests.query_states import write_stuck_skill
from tests.quick_scenario import make_quick_scenario
from tests.scripts.commands import error_line, files, invoke

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def place(tmp_path_factory, demonstration_folder):
    """A folder with a scenario, and a skill that gets stuck: it has learnt feeds, but no turns."""
    folder = tmp_path_factory.mktemp("correct")
    write_stuck_skill(folder, demonstration_folder)
    return folder


def correct(place, demonstration_folder, *more, skill="straight.npz", out="corrected.npz"):
    return invoke(
        "correct",
        *("--skill", place / skill, "--demonstrations", demonstration_folder, "--out", place / out),
        *("--corrections", place / "corrections", "--scenario", place / "quick.yaml"),
        *("--rounds", 1, "--practice", 3, "--most", 2, "--jobs", 1, *more),
    )


@pytest.fixture(scope="module")
def corrected(place, demonstration_folder):
    done = correct(place, demonstration_folder)
    assert done.exit_code == 0, done.output
    return done.output


@pytest.mark.nightly
def test_what_it_asks_for_can_be_shown_by_a_person(place, demonstration_folder, tmp_path):
    before = sorted(place.rglob("*"))
    done = correct(place, demonstration_folder, "--ask", "--json", tmp_path / "asked.json")
    assert done.exit_code == 0, done.output
    assert "query states in which the skill got stuck" in done.output
    assert sorted(place.rglob("*")) == before
    query_states = read_query_states(tmp_path / "asked.json")
    check_file(tmp_path / "asked.json", "query_states.json")  # may be replaced by the same command
    assert f"{len(query_states)} query states in" in done.output
    assert 1 <= len(query_states) <= 2


def test_corrections_are_a_set_of_demonstrations_from_which_the_skill_learns(corrected, place, demonstration_folder):
    folder = place / "corrections" / "round_1"
    assert files(folder) == ["000_correction_expert.parquet", "001_correction_novice.parquet", "index.json"]
    shown = read_demonstrations(folder)
    asked = json.loads((folder / "index.json").read_text())["request"]["query_states"]
    assert [d.metadata["correction"] for d in shown] == asked
    for d in shown:
        assert d.samples["z"].iloc[0] == pytest.approx(3e-4 - d.metadata["correction"]["depth"], abs=1e-4)
    assert "2 corrections in" in corrected
    learnt = ManipulationSkill.load(place / "corrected.npz")
    assert learnt.metadata_["demonstrations"] == len(read_demonstrations(demonstration_folder)) + 2


@pytest.mark.nightly
def test_a_skill_that_plans_goes_on_so(place, demonstration_folder, tmp_path):
    skill = ManipulationSkill(policy="plan").fit(read_demonstrations(demonstration_folder))
    skill.regressor_.y_[:, :2] = 0.0
    skill.planning_.outputs[:] = 0.0  # no answer to any motion: it imitates a straight push, and gets stuck
    skill.save(place / "plan.npz")
    more = ("--corrections", tmp_path / "corrections")
    done = correct(place, demonstration_folder, *more, skill="plan.npz", out="planned.npz")
    assert done.exit_code == 0, done.output
    learnt = ManipulationSkill.load(place / "planned.npz")
    assert learnt.metadata_["demonstrations"] > skill.metadata_["demonstrations"]
    assert learnt.policy == "plan"


def test_a_second_call_keeps_the_corrections_and_gives_the_same_skill(corrected, place, demonstration_folder):
    recording = place / "corrections" / "round_1" / "000_correction_expert.parquet"
    written, skill = recording.stat().st_mtime_ns, (place / "corrected.npz").read_bytes()
    done = correct(place, demonstration_folder)
    assert done.exit_code == 0, done.output
    assert "2 of 2 corrections are there already" in done.output
    assert recording.stat().st_mtime_ns == written
    assert (place / "corrected.npz").read_bytes() == skill


def test_other_corrections_are_replaced_only_when_asked(corrected, place, demonstration_folder):
    done = correct(place, demonstration_folder, "--seed", 9, out="other.npz")
    assert done.exit_code == 1
    assert "add --overwrite to replace them" in error_line(done)
    assert not (place / "other.npz").exists()


def test_a_foreign_folder_of_corrections_is_refused_before_anything_is_simulated(place, demonstration_folder, tmp_path):
    foreign = tmp_path / "corrections" / "round_1"
    foreign.mkdir(parents=True)
    (foreign / "000_correction_expert.parquet").write_text("my own notes")
    done = correct(place, demonstration_folder, "--corrections", tmp_path / "corrections", out="other.npz")
    assert done.exit_code == 1
    assert str(foreign) in error_line(done)
    assert "practice trials" not in done.output
    assert (foreign / "000_correction_expert.parquet").read_text() == "my own notes"
    assert not (place / "other.npz").exists()


def test_a_skill_that_is_never_stuck_is_written_unchanged(place, demonstration_folder, skill_file, tmp_path):
    scenario = make_quick_scenario()
    scenario.start.tilt = [0.0, 0.0]
    (tmp_path / "easy.yaml").write_text(dump_scenario(scenario))
    done = invoke(
        "correct",
        *("--skill", skill_file, "--demonstrations", demonstration_folder, "--out", tmp_path / "same.npz"),
        *("--corrections", tmp_path / "corrections", "--scenario", tmp_path / "easy.yaml"),
        *("--rounds", 2, "--practice", 1, "--jobs", 1),
    )
    assert done.exit_code == 0, done.output
    assert "no corrections are needed" in done.output
    first, same = ManipulationSkill.load(skill_file), ManipulationSkill.load(tmp_path / "same.npz")
    np.testing.assert_array_equal(same.regressor_.y_, first.regressor_.y_)
    assert not (tmp_path / "corrections").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--port", 7123), "--driver, --host and --port need --live"),
        (("--live", "--ask"), "--ask and --overwrite are not for --live"),
        (("--live", "--overwrite"), "--ask and --overwrite are not for --live"),
    ],
)
def test_options_that_do_not_fit_together_are_refused(place, demonstration_folder, options, message):
    done = correct(place, demonstration_folder, *options)
    assert done.exit_code == 2
    assert message in done.stderr


def test_corrections_of_another_peg_are_refused_before_the_page_opens(place, demonstration_folder, tmp_path):
    shown = read_demonstrations(demonstration_folder)[0]
    other = shown.metadata["geometry"] | {"hole_radius": 0.0102}
    shown.metadata["geometry"] = other
    write_demonstration(shown, tmp_path / "000_good_live.parquet")
    done = correct(place, demonstration_folder, "--live", "--corrections", tmp_path)
    assert "expected one geometry" in error_line(done)
    assert "in a browser" not in done.output
