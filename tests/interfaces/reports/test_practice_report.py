"""The report of a practice, with two rounds made by hand."""

from dataclasses import replace

import pytest

from experiments.practice_results import Check, Round
from experiments.scoreboard.paired_statistics import PairedChange
from interfaces.reports.practice_report import change_table, check_costs, practice_record, round_table
from skill.data.outcome import Outcome
from tests.interfaces.reports.tables import text_of
from tests.trial_results import PLAIN

FAILED = replace(PLAIN, seed=1, outcome=Outcome.TIME_OVER, time=10.0)
CHANGE = PairedChange(before=2.0, after=1.5, change=-0.25, lower=-0.3, upper=-0.1, p_value=0.01)


@pytest.fixture
def rounds(skill):
    first = Round(skill, [], Check([PLAIN, FAILED], [2.0, 5.0]), True)
    kept = Round(skill, [PLAIN, PLAIN, FAILED], Check([PLAIN, PLAIN], [2.0, 2.5]), True)
    discarded = Round(skill, [PLAIN, FAILED], Check([FAILED, FAILED], [5.0, 5.12345]), False)
    return [first, kept, discarded]


def test_the_round_table_counts_trials_and_insertions(rounds):
    text = text_of(round_table(rounds))
    assert "0 3.50 1 of 2 first skill 1 3 2 2.25 2 of 2 kept 2 2 1 5.06 0 of 2 discarded" in text


def test_check_costs_have_one_row_per_check_trial(rounds):
    table = check_costs(rounds)
    assert table.to_dict("list") == {
        "round": [0, 0, 1, 1, 2, 2],
        "kept": [True, True, True, True, False, False],
        "cost": [2.0, 5.0, 2.0, 2.5, 5.0, 5.12345],
    }


def test_the_record_holds_each_trial(rounds):
    after = [replace(PLAIN, time=1.0), replace(FAILED, time=9.0)]
    record = practice_record(rounds, [PLAIN, FAILED], after, {"time_s": CHANGE})
    assert [r["kept"] for r in record["rounds"]] == [True, True, False]
    assert record["rounds"][1]["practised"] == [PLAIN.record(), PLAIN.record(), FAILED.record()]
    assert record["rounds"][2]["checks"] == [{"cost_s": 5.0, **FAILED.record()}, {"cost_s": 5.123, **FAILED.record()}]
    assert record["held_out"]["changes"]["time_s"]["after"] == 1.5
    assert [(t["seed"], t["before"]["time_s"], t["after"]["time_s"]) for t in record["held_out"]["trials"]] == [
        (0, 2.5, 1.0),
        (1, 10.0, 9.0),
    ]


def test_the_change_table_names_only_changes_that_are_large_and_certain():
    changes = {
        "time_s": CHANGE,
        "peak_lateral_n": replace(CHANGE, upper=0.1),
        "peak_axial_n": replace(CHANGE, change=0.25, lower=0.1, upper=0.3),
    }
    text = text_of(change_table(changes, [PLAIN, FAILED], [PLAIN, PLAIN]))
    assert text.startswith("2 held-out trials, median")
    assert "time (s) 2.00 1.50 -25 % -30 to -10 % 0.01" in text
    assert "inserted 1 2" in text
    assert text.endswith("fell by at least 20 %: time; rose by at least 20 %: peak axial force")


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"change": -0.19}, "nothing"),
        ({"change": -0.2}, "time"),
        ({"upper": 0.0}, "nothing"),
        ({"change": 0.2, "lower": 0.01}, "nothing; rose by at least 20 %: time"),
        ({"change": 0.2, "lower": 0.0}, "nothing"),
        ({"change": 0.19, "lower": 0.01}, "nothing"),
    ],
)
def test_limits_of_a_change_that_is_named(change, names):
    text = text_of(change_table({"time_s": replace(CHANGE, **change)}, [PLAIN], [PLAIN]))
    assert text.endswith(f"fell by at least 20 %: {names}")
