"""The tool that makes the documentation's pictures of curves takes what it is asked for from a page, in order."""

import numpy as np
import pytest

from docs._tools.curve_picture import MARGIN, curve_pictures, stacked

COLOURS = {"a": (200, 0, 0), "b": (0, 200, 0)}


@pytest.fixture
def page(tmp_path):
    def section(factor, about, height):
        style = f"height: {height}px; background: rgb{COLOURS[factor]}"
        return f'<section style="{style}"><h2>{factor}</h2><p>{about}</p><div class="curve"></div></section>'

    path = tmp_path / "page.html"
    sections = section("a", "usual, drake", 200), section("a", "usual, mujoco", 250), section("b", "usual, drake", 1500)
    path.write_text(f"<body>{''.join(sections)}<section><h2>a table</h2></section></body>")
    return path


@pytest.mark.slow
def test_curves_are_taken_whole_in_the_order_asked_for(page):
    below, above = curve_pictures(page, ["b", "a"], "drake")
    assert (below.height, above.height) == (1500, 200)
    assert below.getpixel((below.width // 2, 1490)) == COLOURS["b"]
    whole = np.asarray(stacked([below, above]))
    assert whole.shape == (1700 + 3 * MARGIN, below.width + 2 * MARGIN, 3)
    assert tuple(whole[MARGIN + 1500 + MARGIN + 190, 500]) == COLOURS["a"]
    assert len(curve_pictures(page, ["a"], "")) == 2


@pytest.mark.slow
def test_a_factor_without_a_curve_is_an_error_that_names_those_there_are(page):
    with pytest.raises(ValueError, match="no curve over 'c'; found: a, b"):
        curve_pictures(page, ["c"], "")
