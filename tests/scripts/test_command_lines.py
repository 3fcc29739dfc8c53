"""The real command lines, end to end on a quick scenario, and what they say to bad input."""

import importlib
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from models.scenario import dump_scenario
from skill.data.demonstration import read_demonstrations
from skill.data.rig_run import read_rig_run
from skill.manipulation_skill import ManipulationSkill
from tests.quick_scenario import SHOWN, make_quick_scenario

ROOT = Path(__file__).resolve().parents[2]
MEASURED_OF_A_TRIAL = ("time_s", "depth_mm", "peak_axial_n", "peak_lateral_n", "peak_moment_nm", "penetration_um")
MODULES = sorted(
    f"scripts.{path.stem}" for path in (ROOT / "scripts").glob("*.py") if "typer.Typer(" in path.read_text()
)


def command(module, *arguments):
    """Runs a script in its own process, as a person would, and returns what came of it."""
    return subprocess.run(
        [sys.executable, "-m", module, *map(str, arguments)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env={**os.environ, "NO_COLOR": "1", "COLUMNS": "200", "TERM": "dumb", "OPENBLAS_NUM_THREADS": "1"},
    )


def called(module, *arguments):
    """The same command in this process: quicker, and all that a refusal needs."""
    app = importlib.import_module(module).app
    return CliRunner(env={"NO_COLOR": "1", "TERM": "dumb"}).invoke(app, [str(a) for a in arguments])


def complaint(done):
    """The one line that a refused command says."""
    assert done.exit_code == 1, done.output
    assert isinstance(done.exception, SystemExit), done.exception
    assert "Traceback" not in done.output
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith("error:")
    return lines[0]


def files(folder):
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())


@pytest.fixture(scope="module")
def scenario_file(tmp_path_factory):
    scenario = make_quick_scenario()
    scenario.start.tilt_range = scenario.start.demonstrated_tilt_range = math.radians(1.5)
    scenario.recorder.time_limit = 1.5
    path = tmp_path_factory.mktemp("scenario") / "quick.yaml"
    path.write_text(dump_scenario(scenario))
    return path


@pytest.fixture(scope="module")
def chain(tmp_path_factory, scenario_file):
    """Record, train, run: three commands with files in between."""
    out = tmp_path_factory.mktemp("chain")
    record = command(
        "scripts.record_demonstrations",
        *("--good", 3, "--bad", 1, "--seed", 1, "--scenario", scenario_file, "--jobs", 1),
        *("--out", out / "shown"),
    )
    assert record.returncode == 0, record.stdout + record.stderr
    train = command("scripts.train_skill", "--demonstrations", out / "shown", "--out", out / "skill.npz")
    assert train.returncode == 0, train.stdout + train.stderr
    run = command(
        "scripts.run_rig",
        *("--skill", out / "skill.npz", "--trials", 2, "--seed", 5, "--tilt-deg", 1.0, "--friction", 0.15),
        *("--scenario", scenario_file, "--out", out / "rig", "--json", out / "mine.json", "--jobs", 1),
    )
    assert run.returncode == 0, run.stdout + run.stderr
    return out, record, train, run


# ------------------------------------------------------------------- chain


def test_recording_leaves_one_valid_file_a_demonstration(chain):
    out, record, _, _ = chain
    shown = read_demonstrations(out / "shown")
    assert [d.good for d in shown] == [True, True, True, False]
    assert files(out / "shown") == [
        "000_good_expert.parquet",
        "001_good_novice.parquet",
        "002_good_expert.parquet",
        "003_bad_blind.parquet",
        "demonstrations.png",
    ]
    assert "4 demonstrations in" in record.stdout


def test_training_leaves_a_skill_that_loads_and_shows_its_states(chain):
    out, _, train, _ = chain
    skill = ManipulationSkill.load(out / "skill.npz")
    assert f"{skill.n_states} contact states" in train.stdout
    for name in skill.state_names():
        assert name in train.stdout


def test_the_json_has_one_object_a_trial_with_the_promised_keys(chain):
    out, _, _, run = chain
    results = json.loads((out / "mine.json").read_text())
    assert [r["seed"] for r in results] == [5, 6]
    for r in results:
        assert {"inserted", "reason", *MEASURED_OF_A_TRIAL} <= set(r)
        assert isinstance(r["inserted"], bool)
        assert r["inserted"] == (r["reason"] == "inserted")
        assert all(math.isfinite(r[k]) for k in MEASURED_OF_A_TRIAL)
        assert max(map(abs, r["tilt_deg"])) <= 1.0
    assert f"{sum(r['inserted'] for r in results)} of 2 inserted" in run.stdout


def test_the_trials_insert(chain):
    out, *_ = chain
    results = json.loads((out / "mine.json").read_text())
    assert [r["reason"] for r in results] == ["inserted", "inserted"]


def test_every_run_is_recorded_and_says_what_the_json_says(chain):
    out, *_ = chain
    results = json.loads((out / "mine.json").read_text())
    worst = max(results, key=lambda r: r["peak_lateral_n"])["seed"]
    assert files(out / "rig") == [
        *(f"replay_{worst:04d}.html", "report.html"),
        *("run_0005.parquet", "run_0006.parquet"),
    ]
    for r in results:
        run = read_rig_run(out / "rig" / f"run_{r['seed']:04d}.parquet")
        assert run.result == r
        assert "friction: 0.15" in run.metadata["scenario"]


def test_the_same_command_gives_the_same_recordings(chain, scenario_file, tmp_path):
    out, *_ = chain
    again = command(
        "scripts.record_demonstrations",
        *("--good", 1, "--bad", 0, "--seed", 1, "--scenario", scenario_file, "--jobs", 1),
        *("--out", tmp_path / "again"),
    )
    assert again.returncode == 0, again.stderr
    first, repeated = read_demonstrations(out / "shown")[0], read_demonstrations(tmp_path / "again")[0]
    np.testing.assert_array_equal(first.samples.to_numpy(), repeated.samples.to_numpy())
    assert first.metadata["seed"] == repeated.metadata["seed"]


# -------------------------------------------------------------------- help


@pytest.mark.parametrize("module", MODULES)
def test_help_teaches_with_an_example(module):
    done = called(module, "--help")
    assert done.exit_code == 0, done.output
    _, told = done.output.split("[OPTIONS]", 1)
    assert f"python -m {module} " in " ".join(told.split())
    assert "--out" in done.stdout


def test_the_scripts_of_the_chain_are_there():
    assert {f"scripts.{n}" for n in ("record_demonstrations", "train_skill", "run_rig", "demo")} <= set(MODULES)


def test_a_refused_command_is_one_line_in_a_process_of_its_own_too(tmp_path):
    done = command("scripts.train_skill", "--demonstrations", tmp_path / "nowhere", "--out", tmp_path / "skill.npz")
    assert done.returncode == 1
    assert done.stderr.startswith("error:")
    assert len(done.stderr.splitlines()) == 1
    assert files(tmp_path) == []


@pytest.mark.parametrize("module", MODULES)
def test_an_unknown_option_is_refused(module):
    done = called(module, "--courage", "3")
    assert done.exit_code == 2
    assert "--courage" in done.stderr
    assert "Traceback" not in done.stderr


# --------------------------------------------------------------- bad input

BAD_SCENARIOS = {
    "an unknown key": ("contact: {fricton: 0.2}", "fricton"),
    "a negative clearance": ("geometry: {hole_radius: 0.0099}", "clearance"),
    "facets too coarse": ("geometry: {facets: 20}", "geometry.facets"),
    "a word for a number": ("contact: {friction: much}", "friction"),
}


@pytest.mark.parametrize(("text", "said"), BAD_SCENARIOS.values(), ids=BAD_SCENARIOS)
def test_a_bad_scenario_stops_a_recording_before_it_begins(tmp_path, text, said):
    scenario = tmp_path / "mine.yaml"
    scenario.write_text(text)
    line = complaint(
        called("scripts.record_demonstrations", "--scenario", scenario, "--out", tmp_path / "out", "--jobs", 1)
    )
    assert said in line
    assert "mine.yaml" in line
    assert files(tmp_path) == ["mine.yaml"]


def test_a_bad_scenario_stops_the_rig_before_it_begins(tmp_path, skill_file):
    scenario = tmp_path / "mine.yaml"
    scenario.write_text("geometry: {facets: 20}")
    line = complaint(
        called("scripts.run_rig", "--skill", skill_file, "--scenario", scenario, "--out", tmp_path / "rig")
    )
    assert "geometry.facets" in line
    assert files(tmp_path) == ["mine.yaml"]


def test_a_scenario_that_is_not_there_names_those_that_are(tmp_path):
    line = complaint(called("scripts.record_demonstrations", "--scenario", "nominel", "--out", tmp_path / "out"))
    assert "nominel" in line
    assert "nominal" in line
    assert files(tmp_path) == []


def test_recordings_are_not_overwritten_unasked(tmp_path, demonstration_folder):
    kept = tmp_path / "mine.parquet"
    kept.write_bytes((demonstration_folder / "000.parquet").read_bytes())
    before = kept.read_bytes()
    line = complaint(called("scripts.record_demonstrations", "--out", tmp_path))
    assert "--overwrite" in line
    assert kept.read_bytes() == before
    assert files(tmp_path) == ["mine.parquet"]


def test_overwriting_with_a_bad_scenario_removes_nothing(tmp_path, demonstration_folder):
    kept = tmp_path / "mine.parquet"
    kept.write_bytes((demonstration_folder / "000.parquet").read_bytes())
    complaint(called("scripts.record_demonstrations", "--out", tmp_path, "--overwrite", "--scenario", "nominel"))
    assert files(tmp_path) == ["mine.parquet"]


def test_no_demonstrations_asked_for(tmp_path):
    line = complaint(called("scripts.record_demonstrations", "--good", 0, "--bad", 0, "--out", tmp_path / "out"))
    assert "--good" in line
    assert files(tmp_path) == []


def test_a_habit_that_never_comes_out_as_asked_is_one_error(tmp_path):
    """Nobody can insert from outside the hole's reach in a tenth of a second."""
    scenario = make_quick_scenario()
    scenario.recorder.time_limit = 0.1
    path = tmp_path / "hasty.yaml"
    path.write_text(dump_scenario(scenario))
    line = complaint(
        called(
            "scripts.record_demonstrations",
            *("--good", 1, "--bad", 0, "--jobs", 1, "--scenario", path, "--out", tmp_path / "out"),
        )
    )
    assert "no good example" in line
    assert files(tmp_path) == ["hasty.yaml"]


@pytest.mark.parametrize("fault", ["none", "truncated", "missing column", "renamed column", "not finite"])
def test_training_on_bad_recordings_is_one_error_and_leaves_no_skill(tmp_path, demonstration_folder, fault):
    folder = tmp_path / "shown"
    folder.mkdir()
    if fault != "none":
        source = demonstration_folder / "000.parquet"
        (folder / "000.parquet").write_bytes(source.read_bytes())
        spoilt = folder / "001.parquet"
        if fault == "truncated":
            spoilt.write_bytes(source.read_bytes()[:-100])
        else:
            table = pq.read_table(source)
            frame = table.to_pandas()
            frame = {
                "missing column": lambda f: f.drop(columns="mz"),
                "renamed column": lambda f: f.rename(columns={"mz": "moment_z"}),
                "not finite": lambda f: f.assign(mz=np.where(f.index == 2, np.nan, f["mz"])),
            }[fault](frame)
            new = pa.Table.from_pandas(frame, preserve_index=False)
            pq.write_table(new.replace_schema_metadata(table.schema.metadata), spoilt)
    line = complaint(called("scripts.train_skill", "--demonstrations", folder, "--out", tmp_path / "skill.npz"))
    said = {"none": "no demonstrations", "truncated": "001.parquet: not a complete Parquet file"}
    assert said.get(fault, "001.parquet") in line
    if fault not in said:
        assert "mz" in line
    assert not (tmp_path / "skill.npz").exists()


def test_training_where_none_inserts_is_one_error(tmp_path, demonstration_folder):
    (tmp_path / "shown").mkdir()
    slams = demonstration_folder / f"{len(SHOWN) - 1:03d}.parquet"
    (tmp_path / "shown" / "000.parquet").write_bytes(slams.read_bytes())
    line = complaint(
        called("scripts.train_skill", "--demonstrations", tmp_path / "shown", "--out", tmp_path / "skill.npz")
    )
    assert "none of the 1 demonstrations" in line
    assert files(tmp_path) == ["shown/000.parquet"]


@pytest.mark.parametrize("fault", ["missing", "truncated", "another version", "no skill"])
def test_running_with_a_bad_skill_is_one_error_and_leaves_nothing(tmp_path, skill_file, fault):
    skill = tmp_path / "skill.npz"
    if fault == "truncated":
        skill.write_bytes(skill_file.read_bytes()[:500])
    elif fault == "another version":
        with np.load(skill_file) as stored:
            arrays = dict(stored)
        header = json.loads(arrays["header"].tobytes())
        header["skill_version"] += 1
        arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
        np.savez(skill, **arrays)
    elif fault == "no skill":
        skill.write_text("peg in hole")
    line = complaint(called("scripts.run_rig", "--skill", skill, "--out", tmp_path / "rig", "--trials", 1))
    said = {"missing": "no such skill file", "another version": "version"}
    assert said.get(fault, "not a skill file") in line
    assert "skill.npz" in line
    assert set(files(tmp_path)) <= {"skill.npz"}


def test_a_tilt_that_cannot_enter_is_one_error_before_the_first_trial(tmp_path, skill_file, scenario_file):
    line = complaint(
        called(
            "scripts.run_rig",
            *("--skill", skill_file, "--scenario", scenario_file, "--tilt-deg", 20, "--trials", 8, "--seed", 0),
            *("--out", tmp_path / "rig", "--jobs", 1),
        )
    )
    assert "tilt" in line
    assert files(tmp_path) == []


def test_a_place_that_cannot_be_written_is_one_error(tmp_path, demonstration_folder):
    (tmp_path / "taken").write_text("mine")
    line = complaint(
        called(
            "scripts.train_skill", "--demonstrations", demonstration_folder, "--out", tmp_path / "taken" / "skill.npz"
        )
    )
    assert "taken" in line
    assert (tmp_path / "taken").read_text() == "mine"
