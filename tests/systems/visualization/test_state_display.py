import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from models.scenario import Geometry
from skill.states.state_style import state_colours
from systems.visualization.state_display import StateDisplay
from tests.stepping import fixed_context
from tests.systems.visualization.canvas import Canvas

HOME = 0.08


def display(canvas):
    geometry = Geometry(peg_radius=0.01, peg_length=0.02)
    return StateDisplay(meshcat=canvas, n_states=3, geometry=geometry, home=HOME, period=1 / 32)


def test_each_state_has_a_peg_of_its_colour():
    canvas = Canvas()
    display(canvas)
    for k, colour in enumerate(state_colours(3)):
        peg, rgba = canvas.objects[f"contact_state/{k}"]
        assert (peg.radius(), peg.length()) == (0.01, 0.02)
        found = [round(255 * value) for value in (rgba.r(), rgba.g(), rgba.b())]
        assert "#{:02x}{:02x}{:02x}".format(*found) == colour.lower()
        X = canvas.transforms[f"contact_state/{k}"]
        np.testing.assert_allclose(X.GetAsMatrix34(), [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.01]])  # the tip at zero


@pytest.mark.parametrize(("state", "shown"), [(0.0, 0), (1.0, 1), (1.9999999, 2)])
def test_only_the_present_state_is_visible_at_the_height_of_the_carriage(state, shown):
    canvas = Canvas()
    dut = display(canvas)
    context = fixed_context(dut, state=[state], carriage_state=[HOME - 0.007, 5.0])
    context.SetTime(1.5)
    dut._publish(context)
    X = canvas.transforms_at["contact_state", 1.5]
    np.testing.assert_allclose(X.GetAsMatrix34(), [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -0.007]], atol=1e-12)
    for k in range(3):
        assert canvas.properties_at[f"contact_state/{k}", "visible", 1.5] == (k == shown)
    assert canvas.properties_at["plant/feed", "visible", 1.5] is False  # the pegs replace the plant's picture


def test_the_state_is_published_from_the_start_in_every_period():
    canvas = Canvas()
    dut = display(canvas)
    Simulator(dut, fixed_context(dut, state=[0.0], carriage_state=[HOME, 0.0])).AdvanceTo(0.1)
    assert [time for _, time in canvas.transforms_at] == pytest.approx([0.0, 1 / 32, 2 / 32, 3 / 32])
