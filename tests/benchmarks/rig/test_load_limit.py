"""The distribution of the measured load, from results worked by hand."""

from dataclasses import replace

import pytest

from benchmarks.rig import load_limit
from skill.data.outcome import Outcome
from tests.trial_results import PLAIN

LIMIT = 40.0


def test_loads_beyond_the_limit_and_beyond_its_tolerance_are_counted():
    loads = (10.0, 40.0, 40.1, 48.0, 48.1)
    results = [replace(PLAIN, seed=k, peak_measured_load=load, peak_load=load + 1.0) for k, load in enumerate(loads)]
    results[0] = replace(results[0], outcome=Outcome.JAMMED, trusted=False)
    row = load_limit.summary("default", results, LIMIT)
    assert (row["trials"], row["inserted"], row["trusted"]) == (5, 4, 4)
    assert (row["beyond_limit"], row["beyond_tolerance"]) == (3, 1)
    assert row["measured_n"]["p50"] == 40.1
    assert (row["measured_n"]["max"], row["true_n"]["max"], row["worst_trial"]) == (48.1, 49.1, 4)
    assert row["reasons"] == {"inserted": 4, "jammed": 1}


@pytest.mark.slow
def test_both_arms_are_performed(monkeypatch, tmp_path, quick_scenario, skill):
    path, out = tmp_path / "skill.npz", tmp_path / "load.json"
    skill.save(path)
    quick_scenario.trial.time_limit, quick_scenario.rig.pivot_range = 0.1, 0.003
    monkeypatch.setattr(load_limit, "load_scenario", lambda: quick_scenario)
    monkeypatch.setattr("sys.argv", ["load_limit", "--skill", str(path), "--trials", "2", "--json", str(out)])
    load_limit.main()
    assert out.read_text().count('"arm"') == 2
