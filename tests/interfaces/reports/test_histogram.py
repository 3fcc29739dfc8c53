"""The histograms of a page: round bins, stacked counts, and the median."""

import numpy as np
import pytest

from interfaces.reports.histogram import BAD, GOOD, bin_edges, histogram
from interfaces.reports.page_template import svg_element


@pytest.mark.parametrize(
    ("values", "edges"),
    [
        ([9.9], [0, 2, 4, 6, 8, 10]),  # at most 8 bins may be used: steps of 1 would need 10
        ([0.0], np.arange(0, 1.1, 0.2)),
        ([20.0] * 100, range(21)),  # 2 sqrt(100) = 20
        ([25.0] * 900, range(0, 27, 2)),  # at most 24
    ],
)
def test_bins_are_round_and_as_narrow_as_the_number_of_values_allows(values, edges):
    np.testing.assert_allclose(bin_edges(np.array(values)), list(edges))


def test_bars_are_stacked_and_the_median_is_marked():
    good = np.array([True, True, False, True, False])
    figure = histogram(np.array([0.1, 0.1, 0.1, 9.9, 9.9]), good, unit="s")
    (axes,) = figure.axes
    bars = [(bar.get_y(), bar.get_height()) for bar in axes.patches if bar.get_height()]
    assert bars == [(0, 2), (0, 1), (2, 1), (1, 1)]  # the good ones below
    assert axes.lines[0].get_xdata()[0] == 0.1
    drawn = svg_element(figure)
    assert all(colour in drawn for colour in (GOOD, BAD))
    assert ">0.1 s<" in drawn


@pytest.mark.parametrize(("median", "side"), [(0.5, "left"), (5.9, "left"), (6.1, "right"), (9.9, "right")])
def test_the_label_of_the_median_stays_in_the_drawing(median, side):
    figure = histogram(np.array([0.0, median, 9.9]), np.full(3, True), unit="s")
    assert figure.axes[0].texts[0].get_ha() == side
