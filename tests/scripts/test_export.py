"""The commands export and import: messages, and what they refuse."""

import pytest

from skill.data.demonstration import write_demonstration
from skill.data.rig_run import write_rig_run
from tests.interfaces.exports.datasets import write_demonstrations, write_runs
from tests.scripts.commands import error_line, files, invoke
from tests.trajectories import make_demonstration, make_rig_run


def done(*arguments):
    result = invoke(*arguments)
    assert result.exit_code == 0, result.output
    return " ".join(result.stdout.split())


def test_demonstrations_go_to_lerobot_and_back(tmp_path):
    source = write_demonstrations(tmp_path / "in")
    text = done("export", "lerobot", source, tmp_path / "dataset")
    assert "dataset: 3 demonstrations as episodes (3 inserted), 360 frames at 50 Hz" in text
    assert "again: 3 demonstrations" in done("import", "lerobot", tmp_path / "dataset", tmp_path / "again")
    assert files(tmp_path / "again") == files(source)


def test_a_data_set_is_replaced_only_with_the_option(tmp_path):
    source = write_runs(tmp_path / "in")
    done("export", "lerobot", source, tmp_path / "dataset")
    line = error_line(invoke("export", "lerobot", source, tmp_path / "dataset"))
    assert "holds a data set; choose another OUT, or add --overwrite" in line
    done("export", "lerobot", source, tmp_path / "dataset", "--overwrite")
    (tmp_path / "dataset" / "mine.txt").write_text("mine")
    line = error_line(invoke("export", "lerobot", source, tmp_path / "dataset", "--overwrite"))
    assert "holds mine.txt, which is not replaced" in line
    line = error_line(invoke("import", "lerobot", tmp_path / "dataset", tmp_path / "in"))
    assert "in: holds run_0000.parquet, which is not replaced" in line
    assert sorted(p.name for p in tmp_path.iterdir()) == ["dataset", "in"]


@pytest.mark.slow
def test_a_skill_adds_states(tmp_path, demonstration_folder, skill_file):
    done("export", "lerobot", demonstration_folder, tmp_path / "dataset", "--skill", skill_file)
    assert '"contact_state"' in (tmp_path / "dataset/meta/info.json").read_text()
    runs = write_runs(tmp_path / "runs")
    line = error_line(invoke("export", "lerobot", runs, tmp_path / "other", "--skill", skill_file))
    assert "runs: rig runs, which contain their own contact states; expected no --skill" in line


def other_names(folder):
    write_rig_run(make_rig_run(), folder / "run_0000.parquet")
    write_rig_run(make_rig_run(state_names=["a", "b", "c", "d"]), folder / "run_0001.parquet")


def mixed(folder):
    write_rig_run(make_rig_run(), folder / "a.parquet")
    write_demonstration(make_demonstration(), folder / "b.parquet")


REFUSED = {
    "other states": (other_names, "run_0001.parquet: another 'contact_state' than run_0000.parquet has"),
    "two kinds": (mixed, "b.parquet: no 'rig_run' metadata"),
    "missing": (lambda folder: None, "no such folder; expected one of demonstrations or rig runs"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_exported_is_named_in_one_line(tmp_path, name):
    write, message = REFUSED[name]
    write(tmp_path / "in")
    before = sorted(p.name for p in tmp_path.iterdir())
    assert message in error_line(invoke("export", "lerobot", tmp_path / "in", tmp_path / "out"))
    assert sorted(p.name for p in tmp_path.iterdir()) == before


def test_a_log_is_written_beside_the_run_or_where_it_is_asked_for(tmp_path):
    write_runs(tmp_path, 1)
    write_demonstrations(tmp_path, 1)
    run, demonstration = tmp_path / "run_0000.parquet", tmp_path / "000_good_expert.parquet"
    assert "run_0000.mcap: 120 /wrench, 120 /peg/pose, 120 /hole/pose" in done("export", "mcap", run)
    done("export", "mcap", run)  # replaces its own
    assert "120 /exact_contact" in done("export", "mcap", demonstration, tmp_path / "logs" / "a.mcap")
    assert "(Parquet), and is not replaced" in error_line(invoke("export", "mcap", run, demonstration))
    assert "is the recording; choose another OUT" in error_line(invoke("export", "mcap", run, run))
    assert "no such file" in error_line(invoke("export", "mcap", tmp_path / "none.parquet"))
    assert files(tmp_path) == ["000_good_expert.parquet", "logs/a.mcap", "run_0000.mcap", "run_0000.parquet"]
