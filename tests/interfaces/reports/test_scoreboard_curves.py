"""Curves over a factor: which there are, and what is drawn of them."""

import json

import numpy as np
import pytest

from experiments.scoreboard.result_store import read_trials
from experiments.scoreboard.summary import make_scoreboard
from interfaces.reports.page_template import svg_element
from interfaces.reports.scoreboard_curves import (
    MAX_TABLES,
    curve_figure,
    curves_of,
    limit_curves,
    styles_of,
)
from tests.experiments.scoreboard.simulated_trials import FAILED, LEARNT, OTHER, write_trials


def rows(values, *, name="mu", others=None, wins=1, of=2):
    """For each value of a factor some trials of which some insert."""
    found = []
    for value in values:
        factors = json.dumps({name: value, **(others or {})})
        found += [({} if k < wins else FAILED) | {"trial": k, "factors": factors} for k in range(of)]
    return found


def curves(folder):
    return curves_of(make_scoreboard(read_trials(folder)))


def panels(curve):
    return curve_figure(curve, styles_of(list(curve.summaries))).axes


def test_three_numbers_make_a_curve_two_or_texts_do_not(tmp_path):
    write_trials(tmp_path, rows([0.1, 0.2]) + rows(["a", "b", "c"], name="kind") + rows([True, False], name="flag"))
    assert curves(tmp_path) == []
    write_trials(tmp_path, rows([0.3]), block="0001")
    (curve,) = curves(tmp_path)
    assert (curve.factor, curve.title, curve.values) == ("mu", "usual trials, drake", [0.1, 0.2, 0.3])


def test_insertions_under_limits_of_the_load_are_counted_by_hand(tmp_path):
    loads = [9.9, 10.0, 19.0, 20.0, 39.9, 40.0]
    write_trials(tmp_path, [{"trial": k, "peak_load_n": load} for k, load in enumerate(loads)])
    write_trials(tmp_path, [FAILED | {"trial": k, "peak_load_n": 1.0} for k in range(2)], policy=OTHER)
    (curve,) = limit_curves(make_scoreboard(read_trials(tmp_path)))
    (inserted,) = panels(curve)
    learnt, other = (line.get_ydata() for line in sorted(inserted.lines, key=lambda line: -line.get_ydata()[-1]))
    np.testing.assert_allclose(learnt, [100 / 6, 50, 500 / 6])
    np.testing.assert_array_equal(other, [0, 0, 0])
    np.testing.assert_array_equal(inserted.lines[0].get_xdata(), [10, 20, 40])
    assert inserted.get_xlabel() == "limit of the load (N)"


def test_a_page_of_many_tables_has_no_curves_over_the_limits(tmp_path):
    write_trials(tmp_path, rows(range(MAX_TABLES)))
    assert len(limit_curves(make_scoreboard(read_trials(tmp_path)))) == MAX_TABLES
    write_trials(tmp_path, rows([MAX_TABLES]), block="0001")
    assert limit_curves(make_scoreboard(read_trials(tmp_path))) == []


def test_other_factors_sets_and_engines_have_curves_of_their_own(tmp_path):
    values = [10, 2, 30]
    write_trials(tmp_path, rows(values) + rows(values, others={"kind": "x"}))
    write_trials(tmp_path, rows(values), trial_set="hard")
    write_trials(tmp_path, rows(values[:2]), engine="exact")
    titles = [curve.title for curve in curves(tmp_path)]
    assert sorted(titles) == ["hard trials, drake", "usual trials, drake", "usual trials, drake, kind x"]
    assert curves(tmp_path)[0].values == [2, 10, 30]


def test_lines_have_the_numbers_of_the_summaries_and_gaps_where_there_are_none(tmp_path):
    """One of two inserts: 50 %, Wilson 9.5 to 90.5 %; without insertions there is no time."""
    write_trials(tmp_path, rows([1, 2, 3]), policy=LEARNT)
    write_trials(tmp_path, rows([2, 3], wins=0), policy=OTHER)
    inserted, time, load = panels(curves(tmp_path)[0])
    learnt, other = inserted.lines
    np.testing.assert_array_equal(learnt.get_xdata(), [1, 2, 3])
    np.testing.assert_array_equal(learnt.get_ydata(), [50, 50, 50])
    np.testing.assert_array_equal(other.get_ydata(), [np.nan, 0, 0])
    assert inserted.collections[0].get_segments()[0][:, 1] == pytest.approx([9.45, 90.55], abs=0.01)
    assert np.isnan(time.lines[1].get_ydata()).all()
    assert not np.isnan(load.lines[1].get_ydata()[1:]).any()
    for axes in (inserted, time, load):
        assert axes.get_xlim()[0] < 1 < 3 < axes.get_xlim()[1]
        assert axes.get_ylim()[0] == 0


def test_a_wide_range_has_a_logarithmic_axis_and_crowded_labels_are_left_out(tmp_path):
    write_trials(tmp_path, rows([1, 10, 100]) + rows([1, 1.01, 50], name="training.size"))
    powers, crowded = (panels(curve)[0] for curve in curves(tmp_path))
    assert powers.get_xscale() == "log"
    assert [label.get_text() for label in powers.get_xticklabels()] == ["1", "10", "100"]
    assert [label.get_text() for label in crowded.get_xticklabels()] == ["1", "50"]
    assert [axes.get_xlabel() for axes in (powers, crowded)] == ["mu", "number of demonstrations"]


def test_policies_differ_without_colour():
    styles = styles_of(list(map(str, range(28)))).values()
    assert len({(style["linestyle"], style["marker"]) for style in styles}) == 28


def test_names_are_shown_as_text(tmp_path):
    write_trials(tmp_path, rows([1, 2, 3], name="a<b>&$c$"), policy="<script>x</script>")
    (curve,) = curves(tmp_path)
    drawn = svg_element(curve_figure(curve, styles_of(list(curve.summaries))))
    assert "a&lt;b&gt;&amp;$c$" in drawn
    assert "<script>" not in drawn
