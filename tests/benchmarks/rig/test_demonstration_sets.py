"""The figures over sets of demonstrations, from results worked by hand."""

from dataclasses import replace

import pytest

from benchmarks.rig.demonstration_sets import (
    AFTER,
    ALONE,
    BEFORE,
    PLANNED,
    PLANNED_BARE,
    comparison,
    recoveries,
    row_of,
    show,
    summary,
)
from skill.data.outcome import Outcome
from systems.runs.trial import Arm
from tests.trial_results import PLAIN


def results(inserted, trials):
    failed = [replace(PLAIN, seed=k, outcome=Outcome.JAMMED) for k in range(trials - inserted)]
    return failed + [replace(PLAIN, seed=k, back_offs=2) for k in range(trials - inserted, trials)]


def rows():
    """Two sets: 10 and 6 of 10 by default, 5 and 4 under stress; without contexts 2; with recoveries all but one."""
    found = []
    for seed, default, stress in ((1, 10, 5), (2, 6, 4)):
        found += [row_of(seed, ALONE, arm, 3, results(2, 10)) for arm in Arm]
        found.append(row_of(seed, BEFORE, Arm.DEFAULT, 3, results(default, 10)))
        found.append(row_of(seed, BEFORE, Arm.STRESS, 3, results(stress, 10)))
        found.append(row_of(seed, AFTER, Arm.DEFAULT, 3, results(10, 10)))
        found.append(row_of(seed, AFTER, Arm.STRESS, 3, results(9, 10)))
    return found


def test_a_row_counts_insertions_and_names_failures():
    (row,) = (r for r in rows() if (r["set"], r["skill"], r["arm"]) == (2, BEFORE, "stress"))
    assert (row["inserted"], row["trials"], row["first_trial"]) == (4, 10, 0)
    assert row["failed"] == [0, 1, 2, 3, 4, 5]
    assert row["measured_max_n"] == PLAIN.peak_measured_load


def test_the_summary_is_over_sets_and_not_over_trials():
    found = {(row["skill"], row["arm"]): row for row in summary(rows())}
    default = found[BEFORE, "default"]
    assert (default["inserted"], default["trials"], default["sets"]) == (16, 20, 2)
    assert default["back_offs"] == 16 * 2  # two in each insertion
    assert (default["mean"], default["worst"], default["best"]) == (0.8, 0.6, 1.0)
    assert (default["lower"], default["upper"]) == (0.6, 1.0)  # a bootstrap of two sets draws one of them twice
    assert found[AFTER, "stress"]["mean"] == pytest.approx(0.9)


def test_skills_are_compared_over_the_same_demonstrations_and_trials():
    found = {(row["skill"], row["arm"]): row for row in comparison(rows())}
    contexts = found[BEFORE, "stress"]  # trials 5 to 7 of the first set, and 6 to 7 of the second
    assert (contexts["better"], contexts["worse"], contexts["against"]) == (5, 0, ALONE)
    assert contexts["p_trials"] == pytest.approx(2 / 2**3)  # three trials are better, none is worse
    assert contexts["p_sets"] == pytest.approx(2 / 2**2)
    assert contexts["saved_s"] == pytest.approx(5 / 20 * (10.0 - PLAIN.time))  # a failure counts as ten seconds
    assert contexts["p_time_trials"] == pytest.approx(2 / 2**3)
    assert contexts["p_time_sets"] == pytest.approx(2 / 2**2)
    same = comparison([row | {"failed": []} for row in rows()])
    assert {row["p_trials"] for row in same} == {1.0}


def test_the_table_has_a_line_for_each_set(capsys):
    show(rows())
    printed = " ".join(capsys.readouterr().out.split())
    assert "inserted of 10 trials" in printed
    assert " 2 3 2 2 6 4 10 9 " in printed
    assert "with contexts against without contexts, stress: 5 trials better, 0 worse; p = 0.25 over trials" in printed
    assert "mean over 2 sets 80.0 % (60.0 to 100.0 %), worst set 60.0 %" in printed


def test_the_table_of_one_skill_compares_nothing(capsys):
    alone = [row for row in rows() if row["skill"] == AFTER]
    show(alone)
    printed = " ".join(capsys.readouterr().out.split())
    assert " 2 3 10 9 " in printed
    assert "against" not in printed
    assert comparison(alone) == []
    assert [row["skill"] for row in summary(alone)] == [AFTER, AFTER]


def test_skills_beyond_the_usual_ones_are_compared_in_one_arm(capsys):
    found = [row_of(1, PLANNED, Arm.STRESS, 0, results(9, 10)), row_of(1, PLANNED_BARE, Arm.STRESS, 0, results(6, 10))]
    (pair,) = comparison(found)
    assert (pair["skill"], pair["against"], pair["arm"]) == (PLANNED, PLANNED_BARE, "stress")
    assert (pair["better"], pair["worse"]) == (3, 0)
    show(found)
    printed = " ".join(capsys.readouterr().out.split())
    assert "planned without contact states, stress: 6 of 10" in printed
    assert "default" not in printed


def test_the_recoveries_of_all_rounds_are_counted(tmp_path):
    for round_number, count in ((1, 2), (2, 1)):
        folder = tmp_path / "recoveries" / f"round_{round_number}"
        folder.mkdir(parents=True)
        for k in range(count):
            (folder / f"{k:03d}_recovery_expert.parquet").touch()
    assert recoveries(tmp_path) == 3
