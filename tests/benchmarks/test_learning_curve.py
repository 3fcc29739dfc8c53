"""The sets of the learning curve, and its summary and figure, from results worked by hand."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.learning_curve import LARGEST, RECOVERED, SHOWN, SIZES, chosen, draw, points, show, split, summary
from benchmarks.rig.demonstration_sets import row_of
from skill.data.outcome import Outcome
from systems.runs.demonstration_set import requests
from systems.runs.trial import Arm
from tests.trial_results import PLAIN


def rows():
    """Two draws of ten trials; 5 and 10 demonstrations insert 4 and 6, and all, by default, and half under stress."""
    found = []
    for seed, counts in ((1, {5: 4, 10: 10}), (2, {5: 6, 10: 10})):
        for size, inserted in counts.items():
            for arm, number in ((Arm.DEFAULT, inserted), (Arm.STRESS, inserted // 2)):
                results = [
                    replace(PLAIN, seed=k, outcome=PLAIN.outcome if k < number else Outcome.JAMMED) for k in range(10)
                ]
                for kind in (SHOWN, RECOVERED):
                    row = row_of(seed, kind, arm, 2 if kind == RECOVERED else 0, results)
                    found.append({**row, "size": size, "learnt_from": size - 3 * seed if kind == RECOVERED else size})
    return found


@pytest.mark.parametrize("size", SIZES)
def test_four_demonstrations_in_five_are_good_and_at_least_one(size):
    good, bad = split(size)
    assert good + bad == size
    assert good >= 1
    assert abs(good - 0.8 * size) <= 0.5


def test_small_sets_are_nested_in_the_large_one(tmp_path):
    whole = tmp_path / "whole"
    whole.mkdir()
    for request in requests(*split(LARGEST)):
        (whole / request.file_name).write_text(request.file_name)
    names = {n: {path.name for path in chosen(whole, n, tmp_path / str(n)).iterdir()} for n in (1, 3, 5, 10)}
    assert {n: len(files) for n, files in names.items()} == {n: n for n in names}
    assert names[1] < names[3] < names[5] < names[10]
    assert sum("bad" in name for name in names[5]) == 1
    assert names[10] < {path.name for path in whole.iterdir()}
    assert chosen(tmp_path, 10, tmp_path / "10") == tmp_path / "10"  # it is there already


def test_recoveries_need_five_demonstrations():
    assert points((1, 5, 10)) == [(SHOWN, 1), (SHOWN, 5), (SHOWN, 10), (RECOVERED, 5), (RECOVERED, 10)]


def test_the_summary_is_over_the_draws():
    found = {(row["skill"], row["size"], row["arm"]): row for row in summary(rows())}
    row = found[RECOVERED, 5, "default"]
    assert (row["inserted"], row["trials"], row["draws"], row["learnt_from"]) == (10, 20, 2, 0.5)
    assert (row["mean"], row["worst"]) == (0.5, 0.4)
    assert (row["lower"], row["upper"]) == pytest.approx((0.4, 0.6))
    assert found[SHOWN, 10, "default"]["median_time_s"] == PLAIN.time
    assert found[SHOWN, 10, "stress"]["mean"] == 0.5
    assert np.isfinite(found[SHOWN, 5, "stress"]["measured_max_n"])


def test_the_table_and_the_figure_have_every_point(tmp_path, capsys):
    found = summary(rows())
    show(found)
    printed = capsys.readouterr().out
    assert printed.count("of 20") == len(found) == 8
    assert "learnt from demonstrations and recoveries" in printed
    draw(found, tmp_path / "curve.svg")
    assert (tmp_path / "curve.svg").stat().st_size > 10_000
