"""The table of a comparison and the choice of its policies."""

import json
from dataclasses import replace

import pytest

from benchmarks.rig import comparison
from benchmarks.rig.comparison import PRODUCT, compare, prepared, selected
from benchmarks.rig.trials import FIRST_TRIAL, Entry
from skill.data.demonstration import write_demonstration
from systems.runs.trial import Arm


def test_every_policy_is_compared_with_the_product(setting, performed, push, tmp_path):
    rows = compare("two", [Entry("push", push), Entry(PRODUCT, push)], setting, tmp_path / "two.json")
    assert [row["p"] for row in rows] == [1.0, None]
    rows = compare("one", [Entry("push", push)], setting, None)
    assert rows[0]["p"] is None


def test_a_policy_whose_training_fails_does_not_stop_the_others(setting, performed, push, tmp_path, capsys):
    def broken(setting, record, advance, number):
        raise FloatingPointError("no such number")

    rows = compare("both", [Entry("broken", broken), Entry("push", push)], setting, tmp_path / "both.json")
    failures = [f"set {number} not trained: FloatingPointError: no such number" for number in (0, 1)]
    assert rows[0]["error"] == "; ".join(failures)
    assert rows[1]["inserted"] == 3
    assert "no such number" in capsys.readouterr().out
    assert (tmp_path / "both.json").stat().st_size > 100


def test_policies_are_selected_by_a_part_of_their_name(push):
    entries = [Entry("LWR without states", push), Entry("CA states + LWR", push), Entry("no correction", push)]
    assert selected(entries, None) == entries
    assert selected(entries, ["lwr"]) == entries[:2]
    with pytest.raises(ValueError, match=r"--only \['transformer'\] matches none of the policies"):
        selected(entries, ["transformer"])


def test_each_set_is_recorded_with_a_seed_of_its_own_and_once(quick_scenario, demonstrations, tmp_path, monkeypatch):
    seeds = []

    def record(scenario, missing, *, seed, jobs):
        seeds.append(seed)
        return [(request, demonstrations[0]) for request in missing]

    monkeypatch.setattr(comparison, "record_demonstrations", record)
    folders = comparison.recorded(quick_scenario, tmp_path, sets=2, jobs=1)
    assert seeds == [comparison.FIRST_SET, comparison.FIRST_SET + 1]
    assert [len(list(folder.glob("*.parquet"))) for folder in folders] == [30, 30]
    assert comparison.recorded(quick_scenario, tmp_path, sets=2, jobs=1) == folders
    assert len(seeds) == 2


def test_results_belong_to_the_sets_and_the_arm(quick_scenario, demonstrations, tmp_path):
    for k, shown in enumerate(demonstrations[:2]):
        write_demonstration(shown, tmp_path / str(k) / "shown.parquet")
        write_demonstration(shown, tmp_path / "both" / f"{k}.parquet")
    numbers = {"sets": 1, "trials": 4, "jobs": 1}
    one, two = tmp_path / "0", tmp_path / "1"
    settings = [
        prepared(quick_scenario, given, tmp_path, arm=arm, **numbers)
        for given in ([one, two], [two, one], [tmp_path / "both"])
        for arm in Arm
    ]
    assert len({setting.folder for setting in settings}) == len(settings)
    assert [len(setting.sets) for setting in settings] == [2, 2, 2, 2, 1, 1]
    with pytest.raises(ValueError, match="--sets 0; expected at least 1"):
        prepared(quick_scenario, None, tmp_path, sets=0, trials=4, jobs=1)


def test_only_the_trials_of_the_setting_are_compared(setting, performed, push, tmp_path):
    compare("more", [Entry("push", push), Entry(PRODUCT, push)], setting, None)
    fewer = replace(setting, trials=1)
    rows = compare("fewer", [Entry("push", push), Entry(PRODUCT, push)], fewer, tmp_path / "fewer.json")
    assert [(row["trials"], row["inserted"]) for row in rows] == [(1, 1), (1, 1)]
    assert len(performed) == 8
    written = json.loads((tmp_path / "fewer.json").read_text())["trials"]
    assert [[row["seed"] for row in found] for found in written.values()] == [[FIRST_TRIAL]] * 2
