"""The commands end to end: record, train, rig, replay, diagram and demo on a quick scenario."""

import contextlib
import json
import math
from dataclasses import asdict

import numpy as np
import pytest

from experiments.outputs.output_checks import check_file
from models.scenario import dump_scenario, load_scenario
from skill.data.demonstration import read_demonstrations
from skill.data.rig_run import read_rig_run
from skill.manipulation_skill import ManipulationSkill
from tests.quick_scenario import make_quick_scenario
from tests.scripts.commands import files, invoke

pytestmark = pytest.mark.slow

TRIAL_MEASUREMENTS = ("time_s", "depth_mm", "peak_axial_n", "peak_lateral_n", "peak_moment_nm", "penetration_um")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a space in its path, that holds a quick scenario."""
    scenario = make_quick_scenario()
    scenario.start.tilt_range = scenario.start.demonstrated_tilt_range = math.radians(1.5)
    scenario.recorder.time_limit = 1.5
    folder = tmp_path_factory.mktemp("chain") / "a folder"
    folder.mkdir()
    (folder / "quick.yaml").write_text(dump_scenario(scenario))
    return folder


def run(folder, name, *arguments):
    """Runs a command in this folder; returns what it printed."""
    with contextlib.chdir(folder):
        done = invoke(name, *arguments)
    assert done.exit_code == 0, done.output
    return done.output


@pytest.fixture(scope="module")
def chain(folder):
    """Records, trains, runs the rig and replays in this folder; what each command printed."""
    commands = {
        "record": ("--good", 3, "--bad", 1, "--seed", 1, "--scenario", "quick.yaml", "--jobs", 1, "--out", "shown"),
        "train": ("--demonstrations", "shown", "--out", "skill.npz"),
        "rig": (
            *("--skill", "skill.npz", "--trials", 2, "--seed", 5, "--tilt-deg", 1.0, "--friction", 0.15),
            *("--scenario", "quick.yaml", "--out", "rig", "--json", "mine.json", "--jobs", 1),
        ),
        "replay": ("rig/run_0005.parquet", "--no-open"),
    }
    return {name: run(folder, name, *arguments) for name, arguments in commands.items()}


def test_demonstrations_and_skill_are_written_and_told(chain, folder):
    assert [d.good for d in read_demonstrations(folder / "shown")] == [True, True, True, False]
    assert "003_bad_blind.parquet" in files(folder / "shown")
    assert "4 demonstrations in shown" in chain["record"]
    skill = ManipulationSkill.load(folder / "skill.npz")
    assert f"{skill.n_states} contact states" in chain["train"]
    assert all(name in chain["train"] for name in skill.state_names())


def test_every_run_is_recorded_with_the_result_that_the_json_has(chain, folder):
    results = json.loads((folder / "mine.json").read_text())
    check_file(folder / "mine.json", "trials.json")  # may be replaced by the same command
    assert [(r["seed"], r["inserted"], r["reason"]) for r in results] == [(n, True, "inserted") for n in (5, 6)]
    assert "2 of 2 inserted" in chain["rig"]
    assert files(folder / "rig") == [
        *("index.json", "replay_0005.html", "replay_0006.html", "report.html", "results.json"),
        *("run_0005.html", "run_0005.parquet", "run_0006.parquet"),
    ]
    assert json.loads((folder / "rig" / "results.json").read_text()) == results
    for r in results:
        run = read_rig_run(folder / "rig" / f"run_{r['seed']:04d}.parquet")
        assert run.result == r
        assert all(math.isfinite(r[name]) for name in TRIAL_MEASUREMENTS)
        assert max(map(abs, r["tilt_deg"])) <= 1.0
        assert "friction: 0.15" in run.metadata["scenario"]
    assert (folder / "rig" / "run_0005.html").stat().st_size > 500_000
    assert chain["replay"].startswith("rig/run_0005.html: rig run, ")


def test_a_skill_that_plans_performs_a_trial_which_is_not_the_imitated_one(chain, folder):
    run(folder, "train", "--demonstrations", "shown", "--policy", "plan", "--out", "planned.npz")
    rig = ("--skill", "planned.npz", "--trials", 1, "--seed", 5, "--tilt-deg", 1.0, "--friction", 0.15)
    run(folder, "rig", *rig, "--scenario", "quick.yaml", "--out", "planned", "--jobs", 1)
    (result,) = json.loads((folder / "planned" / "results.json").read_text())
    assert result["inserted"]
    planned, imitated = (read_rig_run(folder / name / "run_0005.parquet").samples for name in ("planned", "rig"))
    assert len(planned) != len(imitated) or not np.array_equal(planned["depth"], imitated["depth"])


@pytest.mark.graphviz
def test_the_diagrams_are_drawn(chain, folder):
    skill = ManipulationSkill.load(folder / "skill.npz")
    skill.metadata_["geometry"] |= asdict(load_scenario().geometry)  # a skill for the hole that is drawn
    skill.save(folder / "nominal.npz")
    run(folder, "diagram", "--skill", "nominal.npz", "--out", "pictures")
    assert files(folder / "pictures") == ["rig.svg", "virtual_environment.svg"]
    assert "</svg>" in (folder / "pictures" / "rig.svg").read_text()


class Stop(BaseException):
    """Ends a demo as a kill does."""


@pytest.mark.nightly
def test_an_interrupted_demo_goes_on_and_a_complete_one_is_made_anew(folder, tmp_path, monkeypatch):
    demo = ("--good", 3, "--bad", 0, "--trials", 1, "--seed", 1, "--jobs", 1, "--verbose")
    demo = (*demo, "--scenario", folder / "quick.yaml")
    recording, trial = tmp_path / "demonstrations" / "000_good_expert.parquet", tmp_path / "rig" / "run_0001.parquet"
    monkeypatch.setattr("scripts.demo.PRACTICE_TRIALS", 1)

    def stop(*arguments):
        raise Stop

    for pictures in (stop, stop, lambda *arguments: None):
        monkeypatch.setattr("scripts.demo.write_pictures", pictures)
        try:
            result = invoke("demo", *demo, "--out", tmp_path)
        except Stop:
            times = [path.stat().st_mtime_ns for path in (recording, trial)]
    assert result.exit_code == 0, result.output
    assert "3 of 3 demonstrations are there already" in result.output
    assert "1 of 1 trials are there already" in result.output
    assert [path.stat().st_mtime_ns for path in (recording, trial)] == times
    assert [path.name for path in tmp_path.glob(".*")] == []
    monkeypatch.setattr("scripts.demo.write_pictures", stop)
    with pytest.raises(Stop):
        invoke("demo", *demo, "--out", tmp_path)
    assert recording.stat().st_mtime_ns > times[0]
    assert trial.stat().st_mtime_ns > times[1]


def test_the_demo_runs_the_whole_chain(folder, tmp_path, monkeypatch):
    monkeypatch.setattr("scripts.demo.PRACTICE_TRIALS", 2)
    monkeypatch.setattr("scripts.demo.CORRECTIONS", 1)
    demo = ("--good", 3, "--bad", 0, "--trials", 1, "--seed", 1, "--jobs", 1)
    printed = run(tmp_path, "demo", *demo, "--scenario", folder / "quick.yaml", "--out", "out")
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"demonstrations", "skill.npz", "rig", "replay_demonstration.html", "fig3_demonstration.png"} <= written
    assert (tmp_path / "out" / "rig" / "run_0001.parquet").is_file()  # seed x trials
    lines = printed.splitlines()
    for line in lines[-3:]:
        assert (tmp_path / line.strip().split(": ")[0]).is_file()
    for title in ("contact states", "insertions on the rig"):
        assert sum(line.strip() == title for line in lines) == 1
