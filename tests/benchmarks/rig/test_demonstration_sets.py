"""The figures over sets of demonstrations, from results worked by hand."""

from dataclasses import replace

import pytest

from benchmarks.rig.demonstration_sets import AFTER, BEFORE, over_sets, recoveries, row_of, show, summary
from skill.data.outcome import Outcome
from systems.runs.trial import Arm
from tests.trial_results import PLAIN


def results(inserted, trials):
    failed = [replace(PLAIN, seed=k, outcome=Outcome.JAMMED) for k in range(trials - inserted)]
    return failed + [replace(PLAIN, seed=k) for k in range(trials - inserted, trials)]


def rows():
    """Two sets: 10 and 6 of 10 by default, 5 and 4 under stress; with recoveries all but one."""
    found = []
    for seed, default, stress in ((1, 10, 5), (2, 6, 4)):
        found.append(row_of(seed, BEFORE, Arm.DEFAULT, 3, results(default, 10)))
        found.append(row_of(seed, BEFORE, Arm.STRESS, 3, results(stress, 10)))
        found.append(row_of(seed, AFTER, Arm.DEFAULT, 3, results(10, 10)))
        found.append(row_of(seed, AFTER, Arm.STRESS, 3, results(9, 10)))
    return found


def test_a_row_counts_insertions_and_names_failures():
    row = rows()[2 * 2 + 1]
    assert (row["set"], row["arm"], row["inserted"], row["trials"]) == (2, "stress", 4, 10)
    assert row["failed"] == [0, 1, 2, 3, 4, 5]
    assert row["measured_max_n"] == PLAIN.peak_measured_load


def test_the_summary_is_over_sets_and_not_over_trials():
    found = {(row["skill"], row["arm"]): row for row in summary(rows())}
    default = found[BEFORE, "default"]
    assert (default["inserted"], default["trials"], default["sets"]) == (16, 20, 2)
    assert (default["mean"], default["worst"], default["best"]) == (0.8, 0.6, 1.0)
    assert (default["lower"], default["upper"]) == (0.6, 1.0)  # a bootstrap of two sets draws one of them twice
    assert found[AFTER, "stress"]["mean"] == pytest.approx(0.9)


def test_equal_sets_have_no_spread():
    assert over_sets([0.9] * 5) == (pytest.approx(0.9), pytest.approx(0.9), pytest.approx(0.9))


def test_the_table_has_a_line_for_each_set(capsys):
    show(rows())
    printed = capsys.readouterr().out
    assert "6 of 10" in printed
    assert "mean over 2 sets 80.0 % (60.0 to 100.0 %), worst set 60.0 %" in " ".join(printed.split())


def test_the_recoveries_of_all_rounds_are_counted(tmp_path):
    for round_number, count in ((1, 2), (2, 1)):
        folder = tmp_path / "recoveries" / f"round_{round_number}"
        folder.mkdir(parents=True)
        for k in range(count):
            (folder / f"{k:03d}_recovery_expert.parquet").touch()
    assert recoveries(tmp_path) == 3
