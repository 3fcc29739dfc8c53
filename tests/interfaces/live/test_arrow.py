import numpy as np
import pytest
from pydrake.geometry import Rgba

from interfaces.live.arrow import Arrow
from tests.interfaces.live.test_display import Recorder


def make_arrow(scale=100.0):
    canvas = Recorder()
    return canvas, Arrow(canvas, "a", scale=scale, colour=Rgba(0.5, 0.25, 0.0, 0.99), order=7.0)


@pytest.mark.parametrize(
    "vector", [[3.0, 0, 0], [0, 0, 2.0], [0, 0, -2.0], [1.0, -2.0, 0.5], [0.1, 0, 0.05], [0, 0, 0]]
)
def test_an_arrow_leads_from_its_start_along_the_vector_at_its_scale(vector):
    canvas, dut = make_arrow()
    dut.draw(np.array([1.0, 2.0, 3.0]), np.array(vector))
    start, end = canvas.arrow("a")
    np.testing.assert_allclose(start, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(end - start, np.array(vector) / 100.0, atol=2e-6)


def test_an_arrow_is_drawn_over_the_other_objects_in_linear_light():
    canvas, dut = make_arrow()
    for part in ("a/shaft/rod", "a/head/cone"):
        assert canvas.properties[f"{part}/<object>", "material.depthTest"] is False
        assert canvas.properties[f"{part}/<object>", "renderOrder"] == 7.0
        assert canvas.objects[part][1].a() < 1.0
    dut.set_colour(Rgba(0.5, 0.25, 0.0, 0.99))
    assert ("a/head/cone", "color") not in canvas.properties  # it has this colour already
    dut.set_colour(Rgba(1.0, 0.5, 0.0, 0.99))
    np.testing.assert_allclose(canvas.properties["a/head/cone", "color"], [1.0, 0.5**2.2, 0.0, 0.99])
