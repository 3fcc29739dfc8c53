import re

import numpy as np
import pytest

from interfaces.reports.series import bands, curve, drawing

TIME = np.array([0.0, 0.1, 0.2, 0.3, 1.3, 1.4])  # s, with a gap of 1 s


def test_a_band_has_an_element_for_each_run_and_a_gap_has_none():
    found = bands(TIME, np.array([1, 1, 0, 0, 0, 1]), ["#111111", "#222222"], ["<a>", "b"], ["0", "1"])
    runs = re.findall(
        r'data-first="(\d)" title="([^"]*)" style="left: (.*?)%; width: (.*?)%; --colour: (.*?)">(.)<', found
    )
    places = np.array([[float(x) for x in run[2:4]] for run in runs]) * 1.4 / 100
    assert [(run[0], run[1], *run[4:]) for run in runs] == [
        ("0", "b", "#222222", "1"),
        ("2", "&lt;a&gt;", "#111111", "0"),
        ("4", "&lt;a&gt;", "#111111", "0"),
        ("5", "b", "#222222", "1"),
    ]
    assert places == pytest.approx(np.array([[0.0, 0.2], [0.2, 0.2], [1.3, 0.1], [1.4, 0.0]]), abs=1e-4)


def test_a_gap_divides_a_curve_whose_values_grow_upwards():
    assert curve(TIME, [0.4, -1.0, 2.6, 0.0, 5.0, 6.0]) == "M0 0L1000 1L2000 -3L3000 0M13000 -5L14000 -6"
    assert drawing(1.4, -1.0, 6.0, "<path/>", 'class="x"') == (
        '<svg viewBox="0 -6 14000 7" preserveAspectRatio="none" class="x"><path/></svg>'
    )
