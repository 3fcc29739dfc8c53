import json
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.rig_cost import THIS, checkout, combine, order, positive, report
from models.scenario import dump_scenario

ROOT = Path(__file__).parent.parent.parent


def rows(*times, simulated=2.0):
    return [{"trial": k, "cpu_s": t, "simulated_s": simulated, "inserted": True} for k, t in enumerate(times)]


def test_the_sides_take_turns_to_be_first():
    assert order(4) == ["this", "other", "other", "this", "this", "other", "other", "this"]


def test_the_ratio_is_that_of_the_cpu_times_and_the_rates_are_per_simulated_second():
    found = report({"this": rows(1.0, 3.0), "other": rows(2.0, 6.0, simulated=1.0), "mujoco": []})
    assert found["ratio"] == pytest.approx(0.5)
    assert found["cpu_per_sim_s"] == pytest.approx(1.0)
    assert found["other_cpu_per_sim_s"] == pytest.approx(4.0)
    assert found["mujoco_cpu_per_sim_s"] is None
    assert found[THIS] == rows(1.0, 3.0)


def test_the_time_of_a_trial_is_the_median_of_its_runs():
    assert [r["cpu_s"] for r in combine([rows(1.0, 5.0), rows(2.0, 4.0), rows(9.0, 6.0)])] == [2.0, 5.0]
    with pytest.raises(ValueError, match=r"trial 0 .* expected the same trial in every run"):
        combine([rows(1.0), rows(1.0, simulated=3.0)])


def test_a_folder_that_is_no_checkout_is_refused(tmp_path):
    with pytest.raises(Exception, match=r"no experiments/trial.py or systems/trial.py there"):
        checkout(str(tmp_path))
    assert checkout(str(ROOT)) == ROOT
    (tmp_path / "systems").mkdir()
    (tmp_path / "systems" / "trial.py").touch()  # the layout of older checkouts
    assert checkout(str(tmp_path)) == tmp_path
    with pytest.raises(Exception, match="0: expected a whole number of at least 1"):
        positive("0")


@pytest.mark.slow
def test_a_checkout_costs_as_much_as_itself(tmp_path, skill_file, quick_scenario):
    """Started as a file from another folder, as for a checkout that is not installed."""
    scenario, file = tmp_path / "quick.yaml", tmp_path / "cost.json"
    scenario.write_text(dump_scenario(quick_scenario))
    options = [
        "--skill",
        skill_file,
        "--against-skill",
        skill_file,
        "--trials",
        1,
        "--rounds",
        1,
        "--json",
        file,
        "--scenario",
        scenario,
    ]
    command = [sys.executable, ROOT / "benchmarks" / "rig_cost.py", "--against", ROOT, *options]
    done = subprocess.run([*map(str, command)], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(file.read_text())
    assert 0.4 < found["ratio"] < 2.5
    assert found["this"][0]["simulated_s"] == found["other"][0]["simulated_s"]
    assert "ratio" in done.stdout
