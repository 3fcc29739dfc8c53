"""Curves over a factor: which there are, and where their points lie."""

import itertools
import json
import re
from xml.etree import ElementTree

import pytest

from experiments.scoreboard.result_store import read_trials
from experiments.scoreboard.summary import make_scoreboard
from interfaces.reports.scoreboard_curves import (
    BOTTOM,
    DASHES,
    HEIGHT,
    LEFT,
    MARKERS,
    RIGHT,
    TOP,
    WIDTH,
    curves_of,
    draw_curve,
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


def svgs(curve):
    styles = {policy: k for k, policy in enumerate(curve.summaries)}
    drawn = draw_curve(curve, styles).replace("&nbsp;", " ")
    panels = ElementTree.fromstring(drawn)
    return panels[0].findall("div/svg"), panels


def test_three_numbers_make_a_curve_two_or_texts_do_not(tmp_path):
    write_trials(tmp_path, rows([0.1, 0.2]) + rows(["a", "b", "c"], name="kind") + rows([True, False], name="flag"))
    assert curves(tmp_path) == []
    write_trials(tmp_path, rows([0.3]), block="0001")
    (curve,) = curves(tmp_path)
    assert (curve.factor, curve.title, curve.values) == ("mu", "default arm, drake", [0.1, 0.2, 0.3])


def test_other_factors_arms_and_engines_have_curves_of_their_own(tmp_path):
    values = [10, 2, 30]
    write_trials(tmp_path, rows(values) + rows(values, others={"kind": "x"}))
    write_trials(tmp_path, rows(values), arm="stress")
    write_trials(tmp_path, rows(values[:2]), engine="mujoco")
    titles = [curve.title for curve in curves(tmp_path)]
    assert sorted(titles) == ["default arm, drake", "default arm, drake, kind x", "stress arm, drake"]
    assert curves(tmp_path)[0].values == [2, 10, 30]


def test_a_policy_without_a_value_has_a_gap(tmp_path):
    write_trials(tmp_path, rows([0.1, 0.2, 0.3]), policy=LEARNT)
    write_trials(tmp_path, rows([0.2, 0.3], wins=0), policy=OTHER)
    (curve,) = curves(tmp_path)
    assert [s is None for s in curve.summaries[OTHER]] == [True, False, False]
    panels, _ = svgs(curve)
    marks = [len(panel.findall("g/path[@class='marker']")) for panel in panels]
    assert marks == [5, 3, 5]  # without insertions there is no time


def test_a_line_does_not_cross_a_missing_value(tmp_path):
    trials = rows([1, 2, 3, 4, 5], wins=2)
    never = {"inserted": False, "time_s": 10.0}  # so that there is no median time
    write_trials(tmp_path, [row | (never if json.loads(row["factors"])["mu"] == 3 else {}) for row in trials])
    [curve] = curves(tmp_path)
    inserted, time, _ = (svg.find("g/path[@class='line']").get("d") for svg in svgs(curve)[0])
    assert re.sub(r"[\d., -]+", "", inserted) == "MLLLL"
    assert re.sub(r"[\d., -]+", "", time) == "MLML"


def test_points_and_intervals_lie_where_the_axes_say(tmp_path):
    """One of two inserts: 50 %, Wilson 9.5 to 90.5 %; the middle value lies in the middle."""
    write_trials(tmp_path, rows([1, 2, 3]))
    panels, _ = svgs(curves(tmp_path)[0])
    places = [m.get("transform") for m in panels[0].findall("g/path[@class='marker']")]
    points = [tuple(map(float, re.findall(r"[\d.]+", place))) for place in places]
    half = TOP + 0.5 * (HEIGHT - TOP - BOTTOM)
    assert [y for _, y in points] == pytest.approx([half] * 3, abs=0.1)
    assert [x for x, _ in points] == pytest.approx([LEFT + 12, (LEFT + WIDTH - RIGHT) / 2, WIDTH - RIGHT - 12], abs=0.1)
    bar = panels[0].findall("g/line")[0]
    assert float(bar.get("y1")) - float(bar.get("y2")) == pytest.approx((HEIGHT - TOP - BOTTOM) * 0.811, abs=0.2)
    labels = [text.text for text in panels[0].findall("text")]
    assert labels[:2] == ["inserted (%), bars: 95 % Wilson interval", "0"]
    assert labels[-4:] == ["1", "2", "3", "mu"]


def test_a_wide_range_has_a_logarithmic_axis_and_crowded_labels_are_left_out(tmp_path):
    write_trials(tmp_path, rows([1, 10, 100]) + rows([1, 1.01, 50], name="size"))
    powers, crowded = (svgs(curve)[0][0] for curve in curves(tmp_path))
    x = [float(re.findall(r"[\d.]+", m.get("transform"))[0]) for m in powers.findall("g/path[@class='marker']")]
    assert x[1] - x[0] == pytest.approx(x[2] - x[1], abs=0.2)
    labels = [text.text for text in crowded.findall("text")]
    assert "1" in labels
    assert "1.01" not in labels


def test_long_labels_do_not_touch(tmp_path):
    write_trials(tmp_path, rows([0.0, 0.0015, 0.003, 0.006, 0.012]))
    [curve] = curves(tmp_path)
    texts = [t for t in svgs(curve)[0][0].findall("text") if t.text in ("0", "0.0015", "0.003", "0.006", "0.012")]
    below = [t for t in texts if t.get("text-anchor") == "middle"]
    edges = [(float(t.get("x")) - 3 * len(t.text), float(t.get("x")) + 3 * len(t.text)) for t in below]
    assert all(a[1] < b[0] for a, b in itertools.pairwise(edges))
    assert len(edges) == 4


def test_policies_differ_without_colour():
    styles = {(k % len(DASHES), k % len(MARKERS)) for k in range(30)}
    assert len(styles) == 30
    assert len(set(itertools.chain(DASHES, MARKERS))) == len(DASHES) + len(MARKERS)


def test_names_are_shown_as_text(tmp_path):
    write_trials(tmp_path, rows([1, 2, 3], name="a<b>&c"), policy="<script>x</script>")
    _, page = svgs(curves(tmp_path)[0])
    assert page.findall("p/span")[0][0].tail.strip() == "<script>x</script>"
    assert "<script>" not in ElementTree.tostring(page, encoding="unicode")
