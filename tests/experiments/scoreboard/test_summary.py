"""Summaries and comparisons, against numbers worked by hand and against statsmodels and SciPy."""

import json

import numpy as np
import pytest
from scipy.stats import permutation_test
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.proportion import proportion_confint

from experiments.scoreboard.paired_statistics import wilson_over_sets
from experiments.scoreboard.result_store import read_trials
from experiments.scoreboard.summary import compare, make_scoreboard, numeric_factors
from tests.experiments.scoreboard.simulated_trials import FAILED, LAW, LEARNT, OTHER, write_results, write_trials


def board_of(folder, against=None):
    return make_scoreboard(read_trials(folder), against)


def only_row(folder):
    (table,) = board_of(folder).tables
    (row,) = table.rows
    return row


def test_a_summary_is_worked_by_hand(tmp_path):
    jam = FAILED | {"outcome": "jammed", "peak_load_n": 40.0, "peak_contact_n": 60.0, "wedged_s": 0.3}
    fault = FAILED | {"outcome": "fault", "fault": "motor stalled", "trusted": False, "time_s": 3.0}
    rows = [
        {"time_s": 2.0, "back_offs": 1, "peak_load_n": 10.0, "seconds_above_20n": 0.5, "field_score": 98.0},
        {"time_s": 4.0, "lost_steps": 4, "peak_load_n": 14.0, "cpu_s": 4.0},
        jam | {"back_offs": 5, "trusted": None},
        fault,
    ]
    write_trials(tmp_path, rows)
    s = only_row(tmp_path).summary
    assert (s.trials, s.inserted, s.untrusted) == (4, 2, 1)
    assert s.faults == {"motor stalled": 1}
    expected = {
        **{"time": 3.0, "load": 15.0, "contact": 15.0, "above 20 N": 0.125},  # the time without the failures
        **{"within 10 N": 0, "within 20 N": 2, "within 40 N": 2},  # 10 N is not below 10 N, and the jam did not insert
        **{"lost steps": 4, "back-offs": 6, "jams": 1, "wedges": 1, "faults": 1},
        **{"score": (98 + 99 + 45 + 45) / 4, "trial": 2.5},
    }
    assert {name: s.numbers[name] for name in expected} == pytest.approx(expected)
    assert s.interval == pytest.approx(proportion_confint(2, 4, method="wilson"), abs=1e-6)
    assert s.numbers["sets"] == 0
    assert np.isnan([s.numbers[name] for name in ("training", "query", "shown")]).all()


@pytest.mark.parametrize("wins", [[2, 1, 1, 0], [0, 2, 1], [2, 2], [1]])
def test_the_interval_is_that_over_the_sets_and_a_single_one_has_none(tmp_path, wins):
    rows = [
        ({} if k < won else FAILED) | {"trial": 2 * number + k, "demonstration_set": number}
        for number, won in enumerate(wins)
        for k in range(2)
    ]
    write_trials(tmp_path, rows)
    s = only_row(tmp_path).summary
    assert s.numbers["sets"] == len(wins)
    assert s.interval == (pytest.approx(wilson_over_sets(wins, [2] * len(wins))) if len(wins) > 1 else None)


# ------------------------------------------------------------ comparison


def test_pairs_are_the_shared_trials_and_a_failure_takes_the_whole_limit(tmp_path):
    write_trials(tmp_path, [{"trial": k, "time_s": 2.0} for k in range(6)], policy=LEARNT)
    other = [{"time_s": 3.0}, FAILED | {"time_s": 1.0}, FAILED, {"time_s": 2.0}, FAILED | {"time_s": 4.0}, {}, {}]
    write_trials(tmp_path, [{"trial": k + 2} | row for k, row in enumerate(other)], policy=OTHER)
    (table,) = board_of(tmp_path).tables
    first, second = table.rows
    assert first.summary.policy == LEARNT
    assert first.paired is None
    pair = second.paired
    assert (pair.pairs, pair.better, pair.worse) == (4, 0, 2)
    assert pair.slower == pytest.approx((1.0 + 8.0 + 8.0 + 0.0) / 4)
    assert (pair.unit, pair.gains, pair.delays) == ("trials", (0, -1, -1, 0), (1.0, 8.0, 8.0, 0.0))
    assert np.isnan([pair.p, pair.p_time]).all()  # four units


@pytest.mark.parametrize(("sets", "p"), [(6, 2 / 2**6), (8, 2 / 2**8), (5, None), (2, None)])
def test_sets_are_paired_with_themselves_and_a_law_with_all_of_them(tmp_path, sets, p):
    rows = [{"trial": k, "demonstration_set": s} for k in range(2) for s in range(sets)]
    write_trials(tmp_path, rows, policy=LEARNT)
    write_trials(tmp_path, [row | {"time_s": 3.0} for row in rows], policy=OTHER)
    write_trials(tmp_path, [{"trial": k, "time_s": 3.5} for k in range(2)], policy=LAW)
    table = read_trials(tmp_path).table
    learnt, other, law = (table[table["policy"] == name] for name in (LEARNT, OTHER, LAW))
    for pair in (compare(other, learnt), compare(law, learnt), compare(learnt, law)):
        assert (pair.pairs, pair.unit, len(pair.delays)) == (2 * sets, "sets", sets)
        assert pair.p_time == (pytest.approx(p) if p else pytest.approx(np.nan, nan_ok=True))
    assert compare(law, learnt[learnt["trial"] > 1]) is None


def test_p_values_flip_the_means_of_the_sets_and_are_corrected_over_the_rows(tmp_path):
    write_results(tmp_path, count=60, frictions=(), sets=9)
    found = read_trials(tmp_path).table
    for table in make_scoreboard(read_trials(tmp_path)).tables:
        rows = found[found["trial_set"] == table.conditions.trial_set]
        by_policy = {name: part.set_index("trial").sort_index() for name, part in rows.groupby("policy", observed=True)}
        mine, p, p_time = by_policy[LEARNT], [], []
        for row in table.rows[1:]:
            other = by_policy[row.summary.policy]
            a, b = other["inserted"], mine["inserted"]
            assert (row.paired.better, row.paired.worse) == ((a & ~b).sum(), (b & ~a).sum())
            times = [part["time_s"].where(part["inserted"], 10.0) for part in (other, mine)]
            for list_of_p, one, two in ((p, a.astype(float), b.astype(float)), (p_time, *times)):
                means = (one - two).groupby(mine["demonstration_set"]).mean()
                test = permutation_test((means,), np.sum, permutation_type="samples", n_resamples=2**9)
                list_of_p.append(test.pvalue)
            assert row.paired.slower == pytest.approx(means.mean())
        assert [row.paired.p for row in table.rows[1:]] == pytest.approx(multipletests(p, method="holm")[1])
        assert [row.paired.p_time for row in table.rows[1:]] == pytest.approx(multipletests(p_time, method="holm")[1])


def test_the_reference_is_the_product_or_the_one_asked_for_or_the_best(tmp_path):
    write_results(tmp_path / "all", count=10)
    assert board_of(tmp_path / "all").reference == LEARNT
    asked = board_of(tmp_path / "all", LAW)
    assert asked.reference == LAW
    assert all((row.paired is None) == (row.summary.policy == LAW) for table in asked.tables for row in table.rows)
    write_trials(tmp_path / "two", [{}, {}], policy="best")
    write_trials(tmp_path / "two", [{}, FAILED, {"trial": 7}, {"trial": 8}], policy="more trials")
    assert board_of(tmp_path / "two").reference == "best"
    with pytest.raises(ValueError, match=r"--against 'x': no such policy; there are 'best', 'more trials'"):
        board_of(tmp_path / "two", "x")


# ------------------------------------------------------------ cells


def test_tables_are_sorted_by_arm_and_by_the_size_of_the_factors(tmp_path):
    values = (10, 2, 30)
    rows = [{"trial": k, "factors": json.dumps({"demos": v, "kind": "a"})} for k, v in enumerate(values)]
    write_trials(tmp_path, [*rows, {"trial": 9}])
    write_trials(tmp_path, [{"trial": 9}], trial_set="hard")
    tables = board_of(tmp_path).tables
    assert [table.conditions.title for table in tables] == [
        "usual trials, drake",
        *(f"usual trials, drake, demos {v}, kind a" for v in (2, 10, 30)),
        "hard trials, drake",
    ]
    assert numeric_factors(tables) == ["demos"]


def test_trials_are_compared_under_the_same_factors_only(tmp_path):
    write_trials(tmp_path, [{"factors": '{"mu": 0.1}'}, {"trial": 1, "factors": '{"mu": 0.2}'}], policy=LEARNT)
    write_trials(tmp_path, [FAILED | {"factors": '{"mu": 0.2}'}], policy=OTHER)
    tables = board_of(tmp_path).tables
    assert [len(table.rows) for table in tables] == [1, 2]
    assert tables[1].rows[1].paired is None  # trial 0 of one, trial 1 of the other
