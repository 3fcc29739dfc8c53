import pytest

from systems.law.depth_encoder import DepthEncoder
from tests.stepping import fixed_context

HOME, RESOLUTION = 0.080, 5e-6


@pytest.mark.parametrize(
    ("position", "counts"),
    [(0.080, 0), (0.0799, 20), (0.07499, 1002), (0.085, -1000), (0.080 - 2.4e-6, 0), (0.080 - 2.6e-6, 1)],
)
def test_depth_is_a_whole_number_of_counts_below_home(position, counts):
    dut = DepthEncoder(home=HOME, resolution=RESOLUTION)
    context = fixed_context(dut, carriage_state=[position, 0.3])
    assert dut.GetOutputPort("depth").Eval(context)[0] == pytest.approx(counts * RESOLUTION, abs=1e-15)
