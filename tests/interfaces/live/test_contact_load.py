import math

import pytest

from interfaces.live.contact_load import WRENCH, ContactLoad
from models.scenario import load_scenario

SAMPLE = dict.fromkeys(WRENCH, 0.0)


def test_the_load_is_force_and_moment_over_the_radius_of_the_peg():
    """A peg of 10 mm: 3 N across, 4 N along and 0.12 N m are 13 N."""
    dut = ContactLoad(load_scenario("live"))
    assert dut.values() == {"load": 0.0, "limit": 40.0, "peak": 0.0, "held": False}
    dut.take(SAMPLE | {"fx": 3.0, "fz": 4.0, "my": 0.12})
    assert dut.load == pytest.approx(13.0)
    dut.take(SAMPLE | {"fy": -2.0})
    assert (dut.load, dut.peak) == pytest.approx((2.0, 13.0))


@pytest.mark.parametrize(("load", "held"), [(9.9, False), (10.1, True)])
def test_the_guard_slows_the_feed_above_its_soft_force(load, held):
    dut = ContactLoad(load_scenario("live"))
    dut.take(SAMPLE | {"fx": load})
    assert dut.values()["held"] is held


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_sample_of_a_run_that_has_diverged_is_ignored(value):
    dut = ContactLoad(load_scenario("live"))
    dut.take(SAMPLE | {"fx": 5.0})
    dut.take(SAMPLE | {"mx": value})
    assert (dut.load, dut.peak) == (5.0, 5.0)
