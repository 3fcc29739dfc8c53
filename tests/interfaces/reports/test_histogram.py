import re

import numpy as np
import pytest

from interfaces.reports.histogram import bin_edges, histogram
from interfaces.reports.round_step import round_step


@pytest.mark.parametrize(
    ("span", "max_steps", "step"), [(10, 10, 1), (10.1, 10, 2), (0.3, 10, 0.05), (45, 10, 5), (0, 5, 0.2)]
)
def test_steps_are_round_and_at_most_the_given_number(span, max_steps, step):
    assert round_step(span, max_steps) == pytest.approx(step)


@pytest.mark.parametrize("values", [[0.0], [0.0, 0.0], [1.0, 10.0], [2.999, 3.0], list(range(100))])
def test_bins_start_at_zero_and_contain_every_value(values):
    edges = bin_edges(np.array(values, dtype=float))
    assert edges[0] == 0
    assert edges[-1] > max(values)
    assert len(edges) <= 30


def test_height_of_a_bar_is_proportional_to_its_count():
    """The first bin holds three of five values, one of which is not good."""
    svg = histogram(np.array([0.1, 0.1, 0.1, 9.9, 9.9]), np.array([True, True, False, True, True]), unit="s")
    bars = re.findall(r'<rect [^>]*height="([\d.]+)" fill="(#\w+)"', svg)
    heights = {colour: [float(h) for h, c in bars if c == colour] for _, colour in bars}
    one_count = heights["#c1121f"][0]
    assert heights["#0072b2"] == pytest.approx([2 * one_count, 2 * one_count], rel=0.01)
    assert ">0.1 s<" in svg  # the median


def test_round_steps_cover_the_span():
    for span in np.geomspace(1e-6, 1e6, 997):
        step = round_step(float(span), 7)
        assert 7 * step >= span * (1 - 1e-9)
        assert f"{step:.0e}"[0] in "125"
        assert step == pytest.approx(float(f"{step:.0e}"))


# ------------------------------------------------------------------- coordinates


def tags(svg: str, name: str) -> list[dict[str, str]]:
    """Attributes and text of every element of a kind, in order."""
    found = re.findall(rf"<{name} ([^>]*?)/?>([^<]*)", svg)
    return [{**dict(re.findall(r'([\w-]+)="([^"]*)"', attributes)), "": text} for attributes, text in found]


def numbers(element: dict[str, str], *names: str) -> list[float]:
    return [float(element[name]) for name in names]


@pytest.mark.parametrize(
    ("values", "edges"),
    [
        ([9.9], [0, 2, 4, 6, 8, 10]),  # at least 8 bins may be used: steps of 1 would need 9.9
        ([9.0], [0, 2, 4, 6, 8, 10]),
        ([8.0], [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]),  # the largest value lies in the last bin
        ([20.0] * 100, list(range(22))),  # 2 sqrt(100) = 20
        ([21.0] * 100, list(range(0, 23, 2))),
        ([24.0] * 900, list(range(26))),  # at most 24
        ([25.0] * 900, list(range(0, 27, 2))),
    ],
)
def test_bins_are_as_narrow_as_the_number_of_values_allows(values, edges):
    np.testing.assert_allclose(bin_edges(np.array(values)), edges)


def test_bars_are_stacked_on_the_axis():
    """Bins of 2 units are 226 / 5 = 45.2 wide, of which 1 is the gap; a count of 1 of 3 is 96 / 3 = 32 high."""
    good = np.array([True, True, False, True, False])
    svg = histogram(np.array([0.1, 0.1, 0.1, 9.9, 9.9]), good, unit="s")
    bars = [(bar["fill"], numbers(bar, "x", "y", "width", "height")) for bar in tags(svg, "rect")]
    assert bars == [
        ("#0072b2", [26.5, 46.0, 44.2, 64.0]),
        ("#0072b2", [207.3, 78.0, 44.2, 32.0]),
        ("#c1121f", [26.5, 14.0, 44.2, 32.0]),
        ("#c1121f", [207.3, 46.0, 44.2, 32.0]),
    ]
    assert 'viewBox="0 0 260 132"' in svg


def test_axis_has_round_ticks_and_the_largest_count():
    svg = histogram(np.array([0.1, 0.1, 0.1, 9.9, 9.9]), np.full(5, True), unit="s")
    axis, _ = tags(svg, "line")
    assert numbers(axis, "x1", "x2", "y1", "y2") == [26, 252, 110, 110]
    *ticks, maximum, zero, _ = tags(svg, "text")
    assert [(tick[""], *numbers(tick, "x", "y")) for tick in ticks] == [
        (f"{value}", x, 123) for value, x in ((0, 26), (2, 71.2), (4, 116.4), (6, 161.6), (8, 206.8), (10, 252))
    ]
    assert [maximum[""], *numbers(maximum, "x", "y")] == ["3", 21, 22]
    assert [zero[""], *numbers(zero, "x", "y")] == ["0", 21, 110]


@pytest.mark.parametrize(
    ("top", "ticks"), [(5.5, "0 1 2 3 4 5 6"), (6.5, "0 2 4 6"), (0.28, "0 0.05 0.1 0.15 0.2 0.25 0.3")]
)
def test_there_are_at_most_six_steps_between_ticks(top, ticks):
    """The axis ends at the last edge: 6, 7 and 0.3."""
    *found, _, _, _ = tags(histogram(np.array([top]), np.array([True]), unit="N"), "text")
    assert " ".join(tick[""] for tick in found) == ticks


def test_the_label_of_the_last_tick_is_not_cut_off():
    """Its middle is 8 units from the border; a number of three digits is wider."""
    svg = histogram(np.array([240.0]), np.array([True]), unit="")
    assert tags(svg, "text")[-4][""] == "250"
    assert tags(svg, "svg")[0]["overflow"] == "visible"


@pytest.mark.parametrize(
    ("median", "shift", "anchor"), [(0.5, 4, "start"), (6.8, 4, "start"), (7.0, -4, "end"), (9.9, -4, "end")]
)
def test_median_is_marked_and_its_label_stays_in_the_drawing(median, shift, anchor):
    """The label changes sides at 0.7 * 260 = 182, which is the value 6.90."""
    svg = histogram(np.array([0.0, median, 9.9]), np.full(3, True), unit="s")
    x = 26 + 22.6 * median
    line, label = tags(svg, "line")[1], tags(svg, "text")[-1]
    assert numbers(line, "x1", "x2", "y1", "y2") == pytest.approx([x, x, 10, 110], abs=0.051)
    assert numbers(label, "x", "y") == pytest.approx([x + shift, 10], abs=0.051)
    assert (label["text-anchor"], label[""]) == (anchor, f"{median:.3g} s")
