"""What the commands do with outputs: tried before the work, never mixed or replaced unasked, kept after a failure."""

import json
import re
import resource
import signal
import subprocess
import sys

import pytest

from experiments.outputs.output_set import open_live_folder
from experiments.trial.trial_set import TrialSet, trial_scenario
from models.scenario import dump_scenario, parse_scenario
from skill.data.demonstration import write_demonstration
from skill.data.rig_run import read_rig_run
from skill.manipulation_skill import ManipulationSkill
from tests.experiments.outputs.sets import make_set
from tests.quick_scenario import make_quick_scenario
from tests.scripts.commands import HAPTIC_SKILL, ROOT, error_line, files, invoke
from tests.trajectories import make_demonstration

FEW = ("--good", 1, "--bad", 0, "--jobs", 1)


@pytest.fixture
def nowhere(tmp_path):
    """A path below a file, where nothing can be written."""
    (tmp_path / "taken").write_text("mine")
    return tmp_path / "taken" / "out"


@pytest.fixture
def quick(tmp_path_factory):
    """Path of a scenario whose trials last a tenth of a second."""
    scenario = make_quick_scenario()
    scenario.trial.time_limit = 0.1
    path = tmp_path_factory.mktemp("scenario") / "quick.yaml"
    path.write_text(dump_scenario(scenario))
    return path


# ------------------------------------------------------- before the work


def test_outputs_are_tried_before_the_work(nowhere, skill_file, demonstration_folder):
    commands = {
        "record": (*FEW, "--out", nowhere),
        "train": ("--demonstrations", demonstration_folder, "--out", nowhere),
        "rig": ("--skill", skill_file, "--out", nowhere),
        "practise": ("--skill", skill_file, "--out", nowhere),
        "demo": ("--out", nowhere),
        "replay": (demonstration_folder / "000.parquet", "--out", nowhere),
    }
    for name, arguments in commands.items():
        line = error_line(invoke(name, *arguments))
        assert "taken is not a folder" in line, name
        assert "--out" in line


@pytest.mark.parametrize("json_name", ["skill.npz", "rig/run_0000.parquet", "rig/report.html"])
def test_the_copy_of_the_results_replaces_no_other_file_of_the_command(tmp_path, skill_file, json_name):
    (tmp_path / "skill.npz").write_bytes(skill_file.read_bytes())
    rig = ("--skill", tmp_path / "skill.npz", "--out", tmp_path / "rig", "--trials", 1)
    assert "are the same file" in error_line(invoke("rig", *rig, "--json", tmp_path / json_name))
    ManipulationSkill.load(tmp_path / "skill.npz")
    assert files(tmp_path) == ["skill.npz"]


@pytest.mark.parametrize("command", [("rig",), ("arm", "--yes"), ("twin",), ("correct", "--ask")])
def test_a_copy_replaces_no_json_file_of_something_else(tmp_path, skill_file, command):
    (tmp_path / "mine.json").write_text('{"mine": 1}')
    options = () if command == ("twin",) else ("--skill", skill_file)
    line = error_line(invoke(*command, *options, "--json", tmp_path / "mine.json"))
    assert "mine.json: is another JSON file, and is not replaced by a file of " in line
    assert (tmp_path / "mine.json").read_text() == '{"mine": 1}'


@pytest.mark.parametrize(
    "arguments",
    [
        ("record", "--out", ""),
        ("train", "--demonstrations", ""),
        ("rig", "--trials", "99999999999"),
        ("practise", "--starts", "99999999999"),
        ("record", "--live", "--overwrite"),
        *(("record", "--live", "--scenario", "nowhere", option, 3) for option in ("--good", "--bad", "--jobs")),
        ("rig", "--scenario", "nowhere", "--trials", 3, "--seed", 2**32 - 1),
        ("demo", "--scenario", "nowhere", "--trials", 3, "--seed", 2**31),
        ("practise", "--held-out", 3, "--held-out-seed", 2**32 - 1),
        ("rig", "--skill", "zz\udcff.npz"),  # not UTF-8
        ("replay", "--out", "zz\udcff.html"),
    ],
)
def test_an_impossible_value_of_an_option_is_wrong_usage(tmp_path, monkeypatch, arguments):
    monkeypatch.chdir(tmp_path)
    result = invoke(*arguments)
    assert result.exit_code == 2, result.output
    assert arguments[-2] in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_live_recording_is_not_replaced_by_another_file(tmp_path, skill_file, demonstration_folder):
    live = tmp_path / "live" / "000.parquet"
    with open_live_folder(live.parent):
        write_demonstration(make_demonstration(habit="live"), live)
    before = live.read_bytes()
    for command in (
        ("train", "--demonstrations", demonstration_folder, "--out"),
        ("replay", demonstration_folder / "000.parquet", "--no-open", "--out"),
        ("rig", "--skill", skill_file, "--out", tmp_path / "rig", "--trials", 1, "--json"),
        ("practise", "--skill", skill_file, "--out"),
    ):
        assert "; choose another --" in error_line(invoke(*command, live)), command
    assert live.read_bytes() == before


# ------------------------------------------------------- what is there already


def test_a_demo_is_refused_before_it_records_if_its_rig_folder_holds_something_else(tmp_path):
    make_set(tmp_path / "rig", 1)
    line = error_line(invoke("demo", *FEW, "--out", tmp_path))
    assert "rig: holds demonstrations, not runs" in line
    assert {path.name for path in tmp_path.iterdir()} == {"rig"}


def test_a_second_session_in_one_folder_stops_with_one_line(tmp_path, skill_file):
    code = (
        "import sys; from pathlib import Path; from experiments.outputs.folder_lock import locked_folder, locked_file\n"
    )
    code += "with locked_folder(Path(sys.argv[1])), locked_file(Path(sys.argv[1] + '.npz')): print(flush=True); input()"
    with subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path / "out")], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as holder:
        holder.stdout.readline()
        commands = {
            "record": (*FEW, "--out", tmp_path / "out"),
            "rig": ("--skill", skill_file, "--out", tmp_path / "out"),
            "demo": (*FEW, "--out", tmp_path / "out"),
            "practise": ("--skill", skill_file, "--out", tmp_path / "out.npz"),
        }
        for name, arguments in commands.items():
            assert f"process {holder.pid} (-c, since 2" in error_line(invoke(name, *arguments)), name
        live = error_line(invoke("record", "--live", "--out", tmp_path / "out"))
        assert f"process {holder.pid}" in live
        holder.stdin.close()
        holder.wait()
    assert files(tmp_path) == []


# ------------------------------------------------------- the folder of the rig


def rig(skill_file, quick, out, *more, trials=2, seed=0):
    arguments = ("--skill", skill_file, "--scenario", quick, "--out", out, "--trials", trials, "--seed", seed)
    return invoke("rig", *arguments, "--jobs", 1, *more)


def agreeing_runs(folder):
    """The numbers of the results, after comparing them with the run files."""
    results = json.loads((folder / "results.json").read_text())
    runs = [read_rig_run(path).result for path in sorted(folder.glob("run_*.parquet"))]
    assert results == runs
    return [r["seed"] for r in results]


@pytest.mark.slow
def test_the_hard_set_has_hard_trials_and_is_a_request_of_its_own(tmp_path, skill_file, quick):
    scenario = parse_scenario(quick.read_text(), "quick")
    scenario.rig.pivot_range = 0.003
    quick.write_text(dump_scenario(scenario))
    done = rig(skill_file, quick, tmp_path, "--trials-of", "hard", trials=1, seed=4)
    assert done.exit_code == 0, done.output
    run = parse_scenario(read_rig_run(tmp_path / "run_0004.parquet").metadata["scenario"], "run")
    hard = trial_scenario(scenario, number=4, trial_set=TrialSet.HARD)
    assert (run.start.tilt, run.rig.pivot_height) == (hard.start.tilt, hard.rig.pivot_height)
    assert "another" in error_line(rig(skill_file, quick, tmp_path, trials=1, seed=4))


@pytest.mark.slow
def test_an_interrupted_rig_goes_on_and_its_results_are_those_of_one_run(tmp_path, skill_file, quick):
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    assert rig(skill_file, quick, whole).exit_code == 0
    assert rig(skill_file, quick, parts).exit_code == 0
    for name in ("run_0001.parquet", "replay_0001.html"):
        (parts / name).unlink()
    (parts / "results.json").unlink()
    kept = (parts / "run_0000.parquet").stat().st_mtime_ns
    result = rig(skill_file, quick, parts, "--json", tmp_path / "copy.json")
    assert "1 of 2 trials are there already" in result.output
    assert (parts / "run_0000.parquet").stat().st_mtime_ns == kept
    assert agreeing_runs(parts) == [0, 1]
    assert (parts / "results.json").read_bytes() == (whole / "results.json").read_bytes()
    assert (tmp_path / "copy.json").read_bytes() == (whole / "results.json").read_bytes()


@pytest.mark.slow
def test_a_full_disk_keeps_the_runs_and_names_the_file(tmp_path, skill_file, quick):
    """The limit on the size of files lets runs pass and stops the replay at the end."""
    command = [sys.executable, *HAPTIC_SKILL, "rig", "--skill", skill_file, "--scenario", quick, "--out", tmp_path]
    done = subprocess.run(
        [str(part) for part in (*command, "--trials", 2, "--jobs", 1)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: (
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN),
            resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000)),
        ),
    )
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert re.search(r"replay_000[01]\.html: not written \(File too large\)", done.stderr)
    assert "2 of 2 runs in" in done.stderr
    assert agreeing_runs(tmp_path) == [0, 1]


# ------------------------------------------------------- signals and workers
