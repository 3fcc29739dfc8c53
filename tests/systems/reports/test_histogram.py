import re

import numpy as np
import pytest

from systems.reports.histogram import bin_edges, histogram
from systems.reports.round_step import round_step


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
