"""Trials of a sweep are performed again and compared with their rows."""

import json
import shutil

import pyarrow.parquet as pq
import pytest
import yaml

from benchmarks.rig import repeats
from experiments.sweeps.trial_rows import trial_code
from models.scenario import dump_scenario
from scripts import sweep
from tests.scripts.commands import ROOT


@pytest.fixture
def results(tmp_path, monkeypatch, quick_scenario, skill_file):
    """Two trials of a skill, which is kept among the results as a learnt one is."""
    monkeypatch.chdir(ROOT)
    quick_scenario.trial.time_limit = 1.0
    scenario, path = tmp_path / "quick.yaml", tmp_path / "sweep.yaml"
    scenario.write_text(dump_scenario(quick_scenario))
    policies = {"mine": {"skill": str(skill_file)}}
    trials = {"first": 84010, "number": 2}
    path.write_text(yaml.safe_dump({"scenario": str(scenario), "policies": policies, "trials": trials}))
    sweep.main(path, tmp_path / "results", jobs=1)
    (digest,) = set(pq.read_table(tmp_path / "results" / "trials")["skill"].to_pylist())
    (tmp_path / "results" / "skills").mkdir(exist_ok=True)
    shutil.copy(skill_file, tmp_path / "results" / "skills" / f"{digest}.npz")
    return tmp_path / "results"


def found(results):
    out = results / "repeats.json"
    repeats.main(results, json=out)
    return {key: value for key, value in json.loads(out.read_text()).items() if key != "machine_speed"}


@pytest.mark.nightly
def test_the_same_code_gives_the_same_records_and_a_changed_figure_is_named(results):
    assert found(results) == {
        **{"code": trial_code(), "present_code": trial_code(), "trials": 2, "same": 2, "differences": []}
    }
    (path,) = (results / "trials").rglob("*.parquet")
    table = pq.read_table(path, partitioning=None)
    column = table.schema.names.index("peak_load_n")
    changed = [value + 0.1 * (k == 0) for k, value in enumerate(table["peak_load_n"].to_pylist())]
    pq.write_table(table.set_column(column, "peak_load_n", [changed]), path)
    summary = found(results)
    assert summary["same"] == 1
    assert [record["columns"] for record in summary["differences"]] == [["peak_load_n"]]
